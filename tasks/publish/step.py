"""The cached step: publish. Its folder is the product's folder in the store."""

from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np

from catalog.observation import Observation
from tasks.project.uncertainty import stated_uncertainty
from tasks.publish.names import CUBE, OVERLAY
from tasks.publish.origin import Origin
from tasks.publish.product import write_product
from tasks.publish.publication import NOT_RESAMPLED, Publication, SensorFrame
from tasks.record import Record, record_in
from tasks.stored import camera_of, load_arrays, load_observation, pose_in, target_of
from tasks.summary import calibrated, summary
from tasks.undistort.model import Identity
from tasks.undistort.step import DISTORTION
from tasks.work import Work

CORRECTIONS = ("point", "roll", "range", "attitude", "joint")
LIBRARIES = (
    "planetpose",
    "numpy",
    "scipy",
    "opencv-python-headless",
    "mitsuba",
    "spiceypy",
    "zarr",
    "xarray",
    "prefect",
)


def run(work: Work) -> dict[str, Any]:
    """Gather what the earlier steps found and write the product (see `write_product`)."""
    records = {name: record_in(Path(folder)) for name, folder in work.places["steps"].items()}
    camera = camera_of(work)
    before, after = pose_in(work.place("predicted")), pose_in(work.place("pose"))
    corrections = {name: r.result for name, r in records.items() if name.partition("-")[0] in CORRECTIONS}
    resumed = {"start": records["start"].result} if "start" in records else {}
    stated = calibrated(resumed | corrections)
    corrected = summary(before, after, camera, stated)
    publication = Publication(
        product=work.inputs["product"],
        observation=load_observation(work.place("undistort")),
        camera=camera,
        target=target_of(work),
        pose_before=before,
        pose_after=after,
        uncertainty=stated_uncertainty(stated),
        result={**work.places["result"], **corrected, **limb_of(records["validate"])},
        settings=dict(work.inputs["profile"]),
        provenance=provenance(work, records, corrections),
        **distortion_of(work, records["undistort"]),
    )
    write_product(publication, work.folder)
    return {"correction": corrected, "cube": CUBE, "overlay": OVERLAY, "image": origin(work).to_dict()}


def origin(work: Work) -> Origin:
    """The image of the product, and where it was seen."""
    known = Origin(work.places["sha256"], tuple(work.places["known_places"]))
    return known.seen_at(work.place("image"), work.places["sha256"])


def distortion_of(work: Work, undistort: Record) -> dict[str, Any]:
    """What the step `undistort` left beside the undistorted frame, in the publication's words."""
    beside = load_arrays(work.place("undistort") / DISTORTION)
    nothing_moved = undistort.result["model"] == Identity.name
    kernel = NOT_RESAMPLED if nothing_moved else undistort.result["evidence"]["kernel"]
    found = {"distortion_uncertainty_px": beside["uncertainty_px"], "kernel": kernel}
    if "sensor_image" not in beside:
        return found
    observation = Observation(*(beside[f"sensor_{name}"] for name in ("image", "noise", "quality")))
    places = np.stack([beside["sensor_x_px"], beside["sensor_y_px"]], axis=-1)
    return found | {"sensor": SensorFrame(observation, places)}


def limb_of(validate: Record) -> dict[str, Any]:
    """The verdict of the step `validate`, in the result's words."""
    limb, orientation = validate.result["limb"], validate.result["orientation"]
    return {
        "limb_rms_px": limb["rms_px"],
        "limb_points": limb["points"],
        "orientation": {
            "markings": orientation["verdict"],
            "sigmas": orientation["sigmas"],
            "kept": orientation["kept"],
        },
        "limb_robust_px": limb["robust_px"],
        "limb_disagreeing": limb["disagreeing"],
        "similarity": validate.result["similarity"],
    }


def provenance(work: Work, records: dict[str, Record], corrections: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Where everything came from: files and hashes, label, kernels, map, every step with its key and code version."""
    frame, predicted = records["ingest"].result, records["pose"].result
    return {
        "image": {key: frame[key] for key in ("product", "sha256", "format", "exposure_s", "filter")},
        "label": frame["label"],
        "initial_pose": {key: predicted[key] for key in ("source", "sources", "missing", "evidence")},
        "kernels": predicted["kernels"],
        "basemap": dict(work.inputs["basemap"]),
        "undistort": records["undistort"].result,
        "profile_origin": work.inputs["profile_origin"],
        "guidance": dict(work.inputs["guidance"]),
        "start": records["start"].inputs if "start" in records else None,
        "corrections": {name: {k: v for k, v in r.items() if k != "pose"} for name, r in corrections.items()},
        "limb": records["validate"].result["limb"],
        "sun": records["validate"].result["sun"],
        "steps": {
            name: {"key": r.key, "code": r.code, "seconds": r.seconds, "written": r.written}
            for name, r in records.items()
        },
        "software": versions(),
    }


def versions() -> dict[str, str]:
    """Installed versions of this program and of the libraries whose results it passes on."""
    found = {}
    for name in LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found
