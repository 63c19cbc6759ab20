"""Whether the image confirms an orientation: its markings beside the map's, here and at other orientations.

The correlation of the image's markings with the map's is judged by what the same map gives at orientations that have
nothing to do with the body's: their scatter tells how many independent measurements the disk holds.
"""

from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.rotation import rotation_from_vector_deg, vector_deg_from_rotation
from tasks.attitude.texture import Texture, texture_of
from tasks.simulate import Scene

Array = NDArray[np.float64]
Verdict = Literal["matched", "mismatched", "undetermined", "no-map"]

# Orientations that have nothing to do with the body's, and how far from it they are at least.
CHANCE_TURNS, UNRELATED_DEG = 100, 25.0
# Squares of sigmas: what an orientation needs to be accepted, and the best of many others.
SEEN, FOUND = 20.0, 36.0
# How much better than it another must be: what maps and laws get wrong is no chance, and grows with the evidence.
BETTER, BETTER_FACTOR = 16.0, 2.0
# The map's markings are absent where the best orientation stays by so many sigmas below what they would give at so
# large a part of the map's contrast (measured on 30 simulated images of six laws, radius 8-137 px: 0.42 and more).
LEAST_CONTRAST, ABSENT_SIGMAS = 0.4, 4.0
# They are absent, too, where the disk as it is excludes by as many sigmas that it holds this part of their contrast.
EXCLUDED_CONTRAST = 0.25
# How far around the search looks, in sigmas of the prior; into so many steps per side.
REACH_SIGMAS, STEPS, MOST_REACH_DEG = 3.3, 2, 30.0
REFINED, ROUNDS = 2, 5
OTHER_LONGITUDE_DEG, LONGITUDE_STEP_DEG = 20.0, 10.0
OWN_PEAK_PX = 2.5
# A turn of so many sigmas of its prior contradicts it, unless markings of so many sigmas confirm it.
CONFLICT_SIGMAS, STRONG_SIGMAS = 3.0, 8.0
# Where nothing is known of the orientation's error it is taken for so large, 1-sigma.
UNKNOWN_DEG = 10.0


@dataclass(frozen=True)
class Markings:
    """verdict: `matched`, the map's markings are where the orientation has them; `mismatched`, they are seen elsewhere,
    or not at all although they would show; `undetermined`, the image cannot tell; `no-map`. correlation: of the image's
    and the map's markings. sigmas: the same in units of what chance gives. contrast: of the image's markings, the map's
    being 1. better_deg: rotation vector (3,) of a turn of the body that matches significantly better; None where
    there is none within the search. better_sigmas: how well that matches. independent: measurements on the disk.
    expected_sigmas: what the map's markings would give at LEAST_CONTRAST."""

    verdict: Verdict
    correlation: float | None = None
    sigmas: float | None = None
    contrast: float | None = None
    better_deg: Array | None = None
    better_sigmas: float | None = None
    independent: float | None = None
    expected_sigmas: float | None = None

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        values = dict(self.__dict__)
        values["better_deg"] = None if self.better_deg is None else [round(float(v), 3) for v in self.better_deg]
        return {key: round(v, 3) if isinstance(v, float) else v for key, v in values.items()}


def markings_at_pose(observation: Observation, pose: Pose, scene: Scene, prior_deg: float) -> Markings:
    """The verdict on the orientation of `pose`, whose centre and range must be right to a pixel.

    prior_deg: 1-sigma of the orientation's prior; other orientations are looked for within some times that.
    """
    if np.ptp(scene.basemap.albedo) == 0:
        return Markings("no-map")
    texture = texture_of(observation, pose, scene)
    if texture is None:
        return Markings("undetermined")
    return compared_markings(texture, prior_deg)


def compared_markings(texture: Texture, prior_deg: float) -> Markings:
    """The verdict on the orientation at which `texture` was made."""
    by_chance, independent = chance(texture), measurements(texture)
    other = max(evidence_of(found, independent) for found in by_chance)
    around, other_longitude = best_longitude(texture, independent)
    other = max(other, other_longitude)
    here = evidence_of(texture.correlations(np.eye(3)), independent)
    overall, contrast = texture.correlation(np.eye(3))
    turn, found = best_turn(texture, independent, prior_deg)
    expected = signed_root(expected_evidence(texture, independent))
    figures: dict[str, Any] = {
        "correlation": overall,
        "sigmas": signed_root(here),
        "contrast": contrast,
        "independent": float(independent.sum()),
        "expected_sigmas": expected,
    }
    # The peak of its own correlation is some pixels wide.
    elsewhere = float(np.linalg.norm(turn)) > OWN_PEAK_PX * texture.pixel_deg
    if found > FOUND and is_better(found, here) and elsewhere:
        figures |= {"better_deg": turn, "better_sigmas": signed_root(found)}
        return Markings("mismatched", **figures)
    if other_longitude > FOUND and is_better(other_longitude, here):
        figures |= {"better_deg": around, "better_sigmas": signed_root(other_longitude)}
        return Markings("mismatched", **figures)
    if here > SEEN and is_better(here, other):
        return Markings("matched", **figures)
    if max(signed_root(here), signed_root(found)) < expected - ABSENT_SIGMAS:
        return Markings("mismatched", **figures)
    contrasts, errors = contrasts_of(texture, independent)
    weight = errors**-2.0
    figures["contrast"] = float((contrasts * weight).sum() / weight.sum())
    if figures["contrast"] + ABSENT_SIGMAS * weight.sum() ** -0.5 < EXCLUDED_CONTRAST:
        return Markings("mismatched", **figures)
    return Markings("undetermined", **figures)


def is_better(evidence: float, than: float) -> bool:
    """Whether the evidence for one orientation excludes another, that has `than`."""
    return evidence > BETTER_FACTOR * max(than, 0.0) + BETTER


def signed_root(evidence: float) -> float:
    """Sigmas of an evidence, negative for a negative one."""
    return float(np.sign(evidence) * np.sqrt(abs(evidence)))


def measurements(texture: Texture) -> Array:
    """How many independent measurements the disk holds of each size of markings: one over the mean square of the
    correlations by chance, at most one per pixel."""
    return np.clip(1 / np.maximum((chance(texture) ** 2).mean(axis=0), 1e-9), 1.0, len(texture.value))


@lru_cache(maxsize=2)
def chance(texture: Texture) -> Array:
    """Correlations (turns, sizes) at orientations that have nothing to do with the body's."""
    return np.array([texture.correlations(turn) for turn in unrelated_turns()])


def best_longitude(texture: Texture, independent: Array) -> tuple[Array, float]:
    """Rotation vector (3,), degrees, of the turn about the body's pole, by OTHER_LONGITUDE_DEG or more, that matches
    best, and its evidence: bands and caps that follow the latitude match at all of them."""
    angles = np.arange(OTHER_LONGITUDE_DEG, 360 - OTHER_LONGITUDE_DEG + 1e-6, LONGITUDE_STEP_DEG)
    turns = np.outer(angles, (0.0, 0.0, 1.0))
    scores = [evidence_at(texture, independent, turn) for turn in turns]
    best = int(np.argmax(scores))
    return turns[best], scores[best]


def evidence_of(correlations: Array, independent: Array) -> float:
    """Twice the logarithm of the likelihood ratio of correlations, size by size, against none; negative ones count
    against it."""
    free = np.maximum(independent - 1.0, 0.0)
    return float(np.sum(-np.sign(correlations) * free * np.log(np.maximum(1 - correlations**2, 1e-9))))


def contrasts_of(texture: Texture, independent: Array) -> tuple[Array, Array]:
    """Contrast of the image's markings by size, the map's being 1, and their 1-sigma by chance."""
    other = texture.bands(texture.of_map(np.eye(3)))
    square = np.array([max(float(b @ b), 1e-12) for b in other])
    own = np.array([float(a @ a) for a in texture.own])
    contrast = np.array([float(a @ b) for a, b in zip(texture.own, other, strict=True)]) / square
    return contrast, np.sqrt(own / square / np.maximum(independent - 1.0, 0.5))


def expected_evidence(texture: Texture, independent: Array) -> float:
    """The evidence that the map's markings at LEAST_CONTRAST would give on this disk. What else the image holds is
    noise, and errors of the laws as large as they are stated, evenly spread over the sizes; markings of another kind
    do not count, for where the map is right there are none."""
    own = np.array([float(band @ band) for band in texture.own])
    of_map = LEAST_CONTRAST**2 * np.array([float(band @ band) for band in texture.bands(texture.of_map(np.eye(3)))])
    noise = texture.noise * float(texture.value @ texture.value)
    errors = np.minimum(len(texture.value) / len(own) + noise, own)
    return evidence_of(np.sqrt(of_map / np.maximum(of_map + errors, 1e-12)), independent)


def best_turn(texture: Texture, independent: Array, prior_deg: float) -> tuple[Array, float]:
    """Rotation vector (3,), degrees, of the turn within the prior's range that matches best, and its evidence."""
    reach = min(REACH_SIGMAS * prior_deg, MOST_REACH_DEG)
    steps = int(np.clip(np.ceil(reach / (2 * texture.pixel_deg)), 2, 3))
    line = np.linspace(-reach, reach, 2 * steps + 1)
    turns = np.stack(np.meshgrid(line, line, line, indexing="ij"), axis=-1).reshape(-1, 3)
    turns = turns[np.linalg.norm(turns, axis=1) <= 1.01 * reach]
    scores = np.array([evidence_at(texture, independent, turn) for turn in turns])
    order = np.argsort(-scores)[:REFINED]
    refined = [climbed(texture, independent, turns[i], scores[i], line[1] - line[0], reach) for i in order]
    return max(refined, key=lambda found: found[1])


def evidence_at(texture: Texture, independent: Array, turn_deg: Array) -> float:
    """Evidence for a turn given by its rotation vector, degrees."""
    return evidence_of(texture.correlations(rotation_from_vector_deg(turn_deg)), independent)


def climbed(
    texture: Texture, independent: Array, turn: Array, score: float, step: float, reach: float
) -> tuple[Array, float]:
    """The nearest maximum of the evidence: ever shorter steps along the axes, not beyond the reach."""
    for _ in range(ROUNDS):
        step /= 2
        for axis in range(3):
            for sign in (1, -1):
                trial = turn.copy()
                trial[axis] += sign * step
                value = evidence_at(texture, independent, trial)
                if value > score and np.linalg.norm(trial) <= 1.01 * reach:
                    turn, score = trial, value
                    break
    return turn, score


def is_borne_out(markings: Markings) -> bool:
    """Whether the markings support an orientation so strongly that they outweigh what its prior says against it."""
    return markings.verdict == "matched" and (markings.sigmas or 0.0) >= STRONG_SIGMAS


def mismatch_of(markings: Markings) -> str:
    """Why the markings do not match, as `code: fault. Remedy.`"""
    seen = "the map's markings are not seen where the orientation puts them"
    if markings.better_deg is not None:
        angle = float(np.linalg.norm(markings.better_deg))
        sigmas = f"{markings.better_sigmas:.0f} sigmas"
        seen = f"the map's markings match better ({sigmas}) with the body turned by {angle:.1f} deg"
    return (
        f"{Reason.MARKINGS_DO_NOT_MATCH}: "
        f"{seen} (correlation {markings.correlation:.2f}). Check the predicted attitude, the "
        f"target, whether the picture is mirrored or turned (--flip), and the base map."
    )


@cache
def unrelated_turns() -> tuple[Array, ...]:
    """Rotations (3, 3) spread over all orientations by a fixed seed, none of them near to no turn at all."""
    from scipy.spatial.transform import Rotation

    turns = Rotation.random(2 * CHANCE_TURNS, rng=np.random.default_rng(1)).as_matrix()
    far = [turn for turn in turns if np.linalg.norm(vector_deg_from_rotation(turn)) > UNRELATED_DEG]
    return tuple(far[:CHANCE_TURNS])
