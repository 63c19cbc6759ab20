"""What a failed image is told: the cause that explains it, and a folder with what was tried.

The folder is STORE/.failed/PRODUCT: hidden, as what belongs to no product is, and passed over by who reads the store.
It goes when the product is published.
"""

import logging
import shutil
from pathlib import Path
from typing import Any

from catalog.errors import FailedError, PlanetposeError
from flows.chain import Chain
from flows.profile import CORRECTIONS
from flows.request import UNIFORM, Request
from tasks.atomic import folder_put_in_place
from tasks.record import RECORD_FILE, read_record

logger = logging.getLogger("planetpose")
FAILED = ".failed"
OVERLAY, TRIED = "overlay.png", "tried.json"
MAP = "map-does-not-match"
# Failures that a wrong pose, camera, target or map can have; others tell their cause themselves.
EXAMINED = (
    "target-not-found",
    "did-not-converge",
    "range-out-of-bounds",
    "range-unsettled",
    "limb-not-measured",
    "limb-does-not-fit",
    "image-unlike-simulation",
    "no-usable-pixels",
    "joint-not-enough",
)


def diagnose(chain: Chain, error: PlanetposeError, scene: dict[str, Any], basemap: dict[str, Any]) -> PlanetposeError:
    """The failure with its cause, as far as the step `diagnose` finds one; else as it was."""
    if error.code == "interrupted":
        return error
    request, predicted = chain.request, chain.records["pose"].result["pose"]
    inputs = scene | {
        "observation": chain.key("undistort"),
        "pose": predicted,
        "product": request.product,
        "reason": error.reason,
        "try": error.code in EXAMINED,
        "settings": request.profile.settings_of("diagnose"),
    }
    places = basemap | {"undistort": chain.folder("undistort"), "pose": chain.folder("pose")}
    found = chain.do("diagnose", "tasks.diagnose.step", inputs, places)["diagnosis"]
    if found:
        return FailedError(found["code"], found["fault"], found["remedy"])
    return error


def may_do_without(chain: Chain, error: PlanetposeError, scene: dict[str, Any]) -> bool:
    """Whether the corrections are worth another try without the map's markings, another body or stray light."""
    found = chain.result("diagnose") or {}
    return bool(found.get("replaced")) or (error.code == MAP and scene["basemap"] != UNIFORM)


def without_cause(
    chain: Chain, scene: dict[str, Any], basemap: dict[str, Any]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Scene and places of a body without markings, or of an image without another body or stray light; what the
    corrections found before is forgotten."""
    for name in list(chain.records):
        if name.partition("-")[0] in (*CORRECTIONS, "validate"):
            for known in (chain.records, chain.steps):
                del known[name]
    if (chain.result("diagnose") or {}).get("replaced"):
        return scene | {"observation": chain.key("diagnose")}, basemap | {"undistort": chain.folder("diagnose")}
    return scene | {"basemap": dict(UNIFORM)}, basemap | {"basemap": None}


def failed_without(cause: PlanetposeError, before: PlanetposeError, after: PlanetposeError) -> PlanetposeError:
    """The failure of an image that fails without its cause, too. A base map that is left out in vain is no cause: the
    failure is then the one `before`. Another body or stray light is seen in the image all the same."""
    if cause.code == MAP:
        return before
    return type(after)(cause.code, f"{cause.fault} Corrected so: {after.fault}", after.remedy)


def failed_folder(request: Request) -> Path:
    """Where what was tried for a failed image is left."""
    return request.store / FAILED / request.product


def leave(chain: Chain) -> Path | None:
    """Put what the step `diagnose` left into the store; its folder, None when the image did not come so far, or nothing
    can be written there."""
    if "diagnose" not in chain.steps or "diagnose" not in chain.records:
        return None
    step, folder = chain.steps["diagnose"], failed_folder(chain.request)
    if read_record(folder, step.key) is not None:
        return folder
    try:
        with folder_put_in_place(folder) as new:
            for name in (OVERLAY, TRIED, RECORD_FILE):
                shutil.copyfile(step.folder / name, new / name)
    except OSError as trouble:  # the image's own fault matters more
        logger.warning("%s was not written: %s", folder, trouble)
        return None
    return folder


def forget(request: Request) -> None:
    """Take away what was left of an earlier failure."""
    shutil.rmtree(failed_folder(request), ignore_errors=True)
