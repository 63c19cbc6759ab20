"""Whether the picture is mirrored or turned: a solution must beat its own mirror images and quarter turns."""

from dataclasses import dataclass
from typing import Any

from catalog.flips import MEANINGS, PLACES, Flip
from catalog.observation import Observation
from catalog.pose import Pose
from catalog.reasons import Reason
from tasks.attitude.markings import FOUND, Markings, best_turn, is_better, is_borne_out, measurements
from tasks.attitude.texture import Texture, texture_of
from tasks.simulate import Scene

# A mirror image whose shading fits the disk less well, by this much correlation, is none: the Sun would be elsewhere.
LESS_LIKE = 0.05
# How much more of the shading's scatter a mirror image must explain to be accepted by that alone.
LEAST_LIKENESS, MORE_LIKE, ENOUGH_PX = 0.8, 0.1, 400


@dataclass(frozen=True)
class Symmetry:
    """flip: what the picture must be flipped by; by: `markings` or `shading`; sigmas: how well the markings match then;
    likeness: correlation of image and shading, as it is and flipped."""

    flip: Flip
    by: str
    sigmas: float | None
    likeness: tuple[float, float]

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {"flip": self.flip, "by": self.by, "sigmas": self.sigmas, "likeness": list(self.likeness)}


def better_flip(
    observation: Observation, pose: Pose, scene: Scene, markings: Markings, prior_deg: float
) -> Symmetry | None:
    """The flip of the picture about the disk's centre that fits the simulation of `pose` significantly better than the
    picture as it is, or None. markings: the verdict on the picture as it is."""
    if is_borne_out(markings):
        return None  # no mirror image can match as well
    own = texture_of(observation, pose, scene)
    if own is None:
        return None
    here = (markings.sigmas or 0.0) * abs(markings.sigmas or 0.0)
    found = []
    for flip in PLACES:
        texture = texture_of(observation, pose, scene, flip)
        if texture is None or texture.likeness < own.likeness - LESS_LIKE:
            continue
        likeness = (own.likeness, texture.likeness)
        if markings.verdict != "no-map":
            evidence = evidence_of_flipped(texture, prior_deg)
            if evidence > FOUND and is_better(evidence, here):
                found.append((evidence, Symmetry(flip, "markings", evidence**0.5, likeness)))
                continue
        tells = markings.verdict != "matched" and len(own.value) >= ENOUGH_PX
        if tells and texture.likeness > max(LEAST_LIKENESS, own.likeness + MORE_LIKE):
            found.append((texture.likeness, Symmetry(flip, "shading", None, likeness)))
    return max(found, key=lambda pair: pair[0])[1] if found else None


def evidence_of_flipped(texture: Texture, prior_deg: float) -> float:
    """The markings' evidence at the best orientation that the prior allows."""
    independent = measurements(texture)
    return best_turn(texture, independent, prior_deg)[1]


def doubt_of_symmetry(symmetry: Symmetry) -> str:
    """The doubt, as `code: fault. Remedy.`"""
    margin = f" ({symmetry.sigmas:.0f} sigmas)" if symmetry.sigmas else ""
    return (
        f"{Reason.PICTURE_IS_FLIPPED}: {symmetry.by} fit better{margin} with the picture {MEANINGS[symmetry.flip]}. "
        f"Try --flip {symmetry.flip}."
    )
