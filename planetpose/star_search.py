"""Identify the stars of one image from Python, without Prefect."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from planetpose.correction import AnyPath, Flip


def stars(
    image: AnyPath,
    *,
    catalog: AnyPath = "gaia",
    columns: Mapping[str, str] | None = None,
    epoch: float | None = None,
    near: str | None = None,
    cone_deg: float = 10.0,
    kernels: AnyPath | Sequence[AnyPath] | None = None,
    camera: AnyPath | None = None,
    pose_file: AnyPath | None = None,
    mask: AnyPath | None = None,
    flip: Flip | None = None,
    plane: str | None = None,
    summing: int | None = None,
    out: AnyPath | None = None,
) -> dict[str, Any]:
    """The stars of an image, and from them where its camera looked. No target is needed.

    image: any file that planetpose reads. catalog: gaia, hipparcos, or a FITS, VOTable, CSV or Parquet file; columns:
    of that file, by our names (ra_deg, dec_deg, magnitude, pm_ra_mas, pm_dec_mas, parallax_mas, ident); epoch: Julian
    year of its directions. near: a body, or "RA,DEC" in degrees, J2000, which the boresight is within cone_deg degrees
    of; None takes what is predicted, and then the whole sky. kernels: as of `correct`; their trajectories give the
    stellar aberration. pose_file: whose camera_from_j2000 is the predicted orientation. mask, flip, plane, summing: as
    of `correct`. out: folder for a JSON file and a picture.

    Returns what `planetpose stars --json` prints, see docs/guide/stars.md; without a lock `stars` is 0 and `reason`
    says why. Raises RefusedError for an image or a catalog that cannot be read, an unknown camera, or a direction that
    is not known.
    """
    from tasks.stars.requests import requests_of
    from tasks.stars.write import result_of_image

    given = None if kernels is None else [Path(each) for each in _several(kernels)]
    options = {
        "files": [Path(image)],
        "catalog": str(catalog),
        "columns": [f"{name}={column}" for name, column in (columns or {}).items()],
        "epoch": epoch,
        "near": near,
        "cone_deg": cone_deg,
        "camera": None if camera is None else str(camera),
        "pose_file": None if pose_file is None else Path(pose_file),
        "mask": None if mask is None else Path(mask),
        "flip": flip,
        "plane": plane,
        "summing": summing,
    }
    return result_of_image(next(requests_of(options, given)), None if out is None else Path(out))


def _several(paths: AnyPath | Sequence[AnyPath]) -> Sequence[AnyPath]:
    return (paths,) if isinstance(paths, str | Path) else paths
