"""What each part of the joint estimator is worth: its profile, and the same with one part left out."""

from typing import Any

from tasks.priors import PriorSettings, SourcePriors
from tasks.profile import Profile, find_profile

FREE = PriorSettings(range_km=None, roll_deg=None, attitude_deg=None, psf_relative=None)


def ablation() -> list[Profile]:
    """Profiles `paper`, `joint`, and `joint` with one photometric law, without local gains, with the camera's PSF,
    without what the disk tells of the beam's bending, and without priors; named for what they lack."""
    joint = find_profile("joint")
    settings = joint.joint
    still = settings.tiles.model_copy(update={"gain": 0.0, "slope": 0.0, "veil": 0.0})
    changes: dict[str, dict[str, Any]] = {
        "one-law": {"mapped": ("lunar-lambert",), "plain": ()},
        "no-tiles": {"tiles": still},
        "no-psf": {"hold": ("psf",), "wings_px": ()},
        "no-bending": {"bending_px": None},
        "no-priors": {"priors": SourcePriors(spice=FREE, label=FREE, file=FREE)},
    }
    lacking = [
        joint.model_copy(update={"name": f"joint-{name}", "joint": settings.model_copy(update=change)})
        for name, change in changes.items()
    ]
    return [find_profile("paper"), joint, *lacking]
