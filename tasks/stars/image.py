"""The stars of an image file: what the file, kernels and the user say of it, and the search."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera, find_camera
from catalog.celestial import orientation_of_wcs
from catalog.conditions import temperature_of_label
from catalog.errors import RefusedError, WrongOptionError
from catalog.flips import Flip
from catalog.image_mode import ImageMode
from catalog.observation import Frame, Observation
from catalog.pose import read_pose_file
from catalog.readers import read_frame
from catalog.reasons import Reason
from catalog.stars.embedded import EMBEDDED
from catalog.stars.files import FileCatalog
from catalog.stars.observer import Observer, Surroundings, surroundings
from catalog.stars.source import Cone, EmbeddedCatalog, StarCatalog
from catalog.stars.table import unit_vectors
from catalog.target import find_target, known_target
from tasks.stars.field import StarField, find_stars
from tasks.stars.settings import StarSettings
from tasks.stars.solve import BLIND, CONE, PREDICTED, Region
from tasks.undistort import UndistortSettings
from tasks.undistort.saturation import with_plate_flagged
from tasks.undistort.step import masked_by_user

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StarRequest:
    """What is looked for. image: the file; camera, flip, plane, summing, window, mask: as for `planetpose correct`.
    kernels: files and folders. near: a target's name or `RA,DEC` in degrees, which the boresight is within `cone_deg`
    of, and nowhere else; None takes what kernels, label and header say, and then the whole sky. pose_file: whose
    camera_from_j2000 is the predicted orientation."""

    image: Path
    catalog: StarCatalog = field(default_factory=lambda: EmbeddedCatalog("gaia"))
    kernels: tuple[Path, ...] = ()
    near: str | None = None
    cone_deg: float = 10.0
    camera: str | None = None
    pose_file: Path | None = None
    mask: Path | None = None
    flip: Flip | None = None
    plane: str | None = None
    mode: ImageMode | None = None
    settings: StarSettings = field(default_factory=StarSettings)
    undistort: UndistortSettings = field(default_factory=UndistortSettings)


@dataclass(frozen=True)
class StarImage:
    """What was found, and with what. missing: what kernels do not know; warnings: of the file's reader."""

    path: Path
    camera: Camera
    observation: Observation
    observer: Observer
    field: StarField
    missing: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()


def catalog_of(name_or_file: str, columns: Mapping[str, str], epoch: float | None) -> StarCatalog:
    """A packaged catalog by name, or a file. Raises WrongOptionError for columns of a packaged one."""
    if name_or_file.lower() in EMBEDDED:
        if columns or epoch is not None:
            fault = f"the catalog {name_or_file} has its own columns and epoch."
            raise WrongOptionError("columns" if columns else "epoch", fault, "Leave it out, or give a file.")
        return EmbeddedCatalog(name_or_file.lower())
    return FileCatalog(Path(name_or_file), dict(columns), epoch)


def stars_of_image(request: StarRequest) -> StarImage:
    """The stars of an image file. No lock is a result; RefusedError is raised for what cannot be read, an image whose
    camera is not known, and a direction (`near`) that cannot be found."""
    frame = read_frame(request.image, request.camera, None, request.flip, request.plane, request.mode)
    camera = camera_of(frame, request.camera)
    pose = read_pose_file(request.pose_file) if request.pose_file else None
    et = pose.et if pose and pose.et is not None else frame.label_pose.et or frame.et
    given, target_id = near_direction(request.near), target_of(request.near, frame.target)
    around = surroundings(camera, et, request.kernels, target_id)
    known = pose.camera_from_j2000 if pose else None
    regions = regions_of(request, around, given, predicted_orientation(frame, camera, around, known, request.flip))
    observation = with_plate_flagged(masked_by_user(request.mask, frame))
    found = find_stars(
        observation, camera, request.catalog, around.observer, regions, request.settings, request.undistort,
        frame.undistorted,
    )  # fmt: skip
    return StarImage(request.image, camera, observation, around.observer, found, around.missing, frame.warnings)


def camera_of(frame: Frame, given: str | None) -> Camera:
    """The frame's camera in its mode. Raises RefusedError where nobody says which it is."""
    if frame.camera is None:
        raise RefusedError(
            Reason.CAMERA_UNKNOWN,
            f"image {frame.path}: its label names no camera of the catalog.",
            "Give --camera NAME (see `planetpose cameras`), FILE.toml, kernels:NAME or isd:FILE.json.",
        )
    camera = find_camera(str(given or frame.camera)).at(frame.filter, temperature_of_label(frame.label))
    return camera.summed(frame.mode.summing)


def near_direction(near: str | None) -> Array | None:
    """Unit vector (3,) of `RA,DEC` in degrees; None for a name. Raises WrongOptionError for impossible angles."""
    parts = (near or "").split(",")
    if len(parts) != 2:
        return None
    try:
        ra, dec = (float(part) for part in parts)
    except ValueError as error:
        raise WrongOptionError("near", f"{near!r} is neither a target nor RA,DEC in degrees.") from error
    if not (-360 <= ra <= 360 and -90 <= dec <= 90):
        raise WrongOptionError("near", f"{near!r} is no right ascension and declination in degrees.")
    return unit_vectors(ra, dec)


def target_of(near: str | None, label_target: str | None) -> int | None:
    """NAIF id of the body that `near` names, else of the label's target. Raises RefusedError for an unknown name."""
    if near is not None:
        return None if near_direction(near) is not None else find_target(near).naif_id
    known = known_target(label_target) if label_target else None
    return known.naif_id if known else None


def predicted_orientation(
    frame: Frame, camera: Camera, around: Surroundings, given: Array | None, flip: Flip | None
) -> Array | None:
    """camera_from_j2000 (3, 3) by pose file, C-kernel, label or header, whichever has one first."""
    for each in (given, around.camera_from_j2000, frame.label_pose.camera_from_j2000):
        if each is not None:
            return each
    lines, samples = frame.mode.shape or frame.observation.image.shape
    try:
        return orientation_of_wcs(frame.label, camera, (samples, lines), flip, frame.mode.first_px)
    except RefusedError:  # no prediction; the search does without
        return None


def regions_of(
    request: StarRequest, around: Surroundings, given: Array | None, predicted: Array | None
) -> list[Region]:
    """Where the camera may look, in the order of trying. Raises RefusedError where the direction of `near` is not
    known."""
    regions = []
    axis = given if given is not None else around.target
    if request.near is not None and axis is None:
        fault = f"the direction of {request.near} is not known ({'; '.join(around.missing)})."
        raise RefusedError(Reason.POSE_UNKNOWN, fault, "Give --kernels with the trajectories, or --near RA,DEC.")
    cone = None if axis is None else Cone(axis, request.cone_deg)
    if predicted is not None:
        near = Cone(predicted[2], request.settings.identification.predicted_deg)
        inside = request.near is None or cone is None or predicted[2] @ cone.axis >= np.cos(np.radians(cone.radius_deg))
        regions += [Region(PREDICTED, near, predicted)] if inside else []
    regions += [] if cone is None else [Region(CONE, cone)]
    return regions if request.near is not None else [*regions, Region(BLIND)]
