"""The result of one image as `--json` prints it: one object, the same keys whatever happened."""

from collections import Counter
from pathlib import Path
from typing import Any

from catalog.errors import PlanetposeError
from catalog.plain_text import shown_path
from flows.chain import Chain
from flows.diagnosis import leave, note
from flows.request import guidance_of
from flows.verdict import doubts, rest_reached
from tasks.boundary import PUBLISHED, reason_of, status_of
from tasks.diagnose.step import OVERLAY, TRIED
from tasks.profile import Profile
from tasks.publish.step import stated_of
from tasks.registry import IMAGE_POSE, INGEST, POSE, PUBLISH, UPLOAD, VALIDATE

EMPTY: dict[str, Any] = {
    "product": None,
    "image": None,
    "status": None,
    "reason": None,
    "camera": None,
    "target": None,
    "utc": None,
    "pose_source": None,
    "profile": None,
    "warnings": [],
    "profile_origin": None,
    "guidance": {
        "start_offset_px": None,
        "held": [],
        "mask": None,
        "flip": None,
        "plane": None,
        "summing": None,
        "window": None,
        "bodies": [],
        "resumed_from": None,
        "overruled": [],
    },
    "centre_px": None,
    "offset_px": None,
    "range_factor": None,
    "attitude_deg": None,
    "roll_deg": None,
    "roll_by": None,
    "range_factor_free": None,
    "psf_sigma_px": None,
    "uncertainty": {
        "centre_px": None,
        "offset_px": None,
        "range_factor": None,
        "attitude_deg": None,
        "roll_deg": None,
        "range_factor_free": None,
        "psf_sigma_px": None,
    },
    "settled": {"passes": None, "pose": None, "attitude": None},
    "orientation": None,
    "stars": None,
    "bodies": [],
    "limb_rms_px": None,
    "limb_points": None,
    "limb_robust_px": None,
    "limb_disagreeing": None,
    "similarity": {"before": None, "after": None},
    "patches": None,
    "pose": None,
    "cube": None,
    "overlay": None,
    "tried": None,
    "seconds": {},
    "cached": [],
}
EXIT_OK, EXIT_SOME_FAILED = 0, 1


def result_of(chain: Chain, error: Exception | None = None) -> dict[str, Any]:
    """The object of a chain that came to its end, or was ended by `error`."""
    request = chain.request
    result = EMPTY | {
        "product": request.product,
        "image": shown_path(request.image_place),
        "profile": request.profile.name,
        "profile_origin": profile_origin(request.profile),
    }
    frame = chain.last(INGEST)
    result["guidance"] = guidance_of(request) | {"overruled": list(frame.result.overruled) if frame else []}
    result |= verdict(error, doubts(chain)) | known_before_correction(chain) | rest_reached(chain)
    result["seconds"] = {name: done.record.seconds for name, done in chain.done.items()}
    result["cached"] = list(chain.cached)
    if PUBLISH.name in chain.done:
        result |= corrected(chain)
    elif isinstance(error, PlanetposeError) and (folder := leave(chain)):
        result |= {"overlay": f"{folder}/{OVERLAY}", "tried": f"{folder}/{TRIED}"}
        note(folder, result)
    return result


def profile_origin(profile: Profile) -> dict[str, Any] | None:
    """What a user's profile builds on and changes, as plain JSON; None for those that come with the program, and for
    one that changes nothing."""
    return profile.origin.model_dump(mode="json") if profile.origin and profile.origin.changes else None


def verdict(error: Exception | None, doubts: list[str]) -> dict[str, Any]:
    """status and reason."""
    if error is None:
        return {"status": "doubtful" if doubts else "ok", "reason": " ".join(doubts) or None}
    return {"status": status_of(error), "reason": reason_of(error)}


def known_before_correction(chain: Chain) -> dict[str, Any]:
    """Camera, target, time and source of the pose, as far as the chain came."""
    frame, predicted = chain.last(INGEST), chain.last(POSE) or chain.last(IMAGE_POSE)
    known: dict[str, Any] = {}
    if frame:
        known |= {"warnings": list(frame.result.warnings)}
        known |= {"camera": frame.result.camera.name, "target": frame.result.target_name}
    if predicted:
        found = predicted.result
        known |= {"target": found.target.name, "utc": found.pose.to_dict()["utc"], "pose_source": found.source}
    return known


def corrected(chain: Chain) -> dict[str, Any]:
    """What the published product says."""
    published, report = chain.last(PUBLISH), chain.last(VALIDATE)
    if published is None or report is None:
        return {}
    product, folder = published.result, product_place(chain, published.folder)
    shown = published.step.inputs
    stated = stated_of(report.result, product.correction, shown.scene.camera, shown.pose)
    return product.correction | stated | {name: f"{folder}/{getattr(product, name)}" for name in ("cube", "overlay")}


def product_place(chain: Chain, folder: Path) -> str:
    """Folder of the product, or its URL once it is in an object store."""
    if chain.last(UPLOAD):
        return f"{chain.request.publish_to}/{chain.request.product}"
    return str(folder)


def exit_status(results: list[dict[str, Any]]) -> int:
    """0 when every image is published, be it with a doubt, else 1."""
    return EXIT_OK if all(result["status"] in PUBLISHED for result in results) else EXIT_SOME_FAILED


def tally(results: list[dict[str, Any]]) -> str:
    """How many images ended how, for people: `5 images: 3 ok, 1 doubtful, 1 refused`."""
    counts = Counter(result["status"] for result in results)
    known = ", ".join(f"{counts[status]} {status}" for status in (*PUBLISHED, "refused", "failed") if counts[status])
    return f"{len(results)} {'image' if len(results) == 1 else 'images'}: {known}"
