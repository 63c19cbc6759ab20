"""`planetpose benchmark stars`: frames of all cameras, with planted orientations and without any."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera, known_cameras
from catalog.rotation import rotation_from_vector_deg, vector_deg_from_rotation
from catalog.stars.observer import Observer
from catalog.stars.source import Cone
from lab.stars.frame import Faults, frame_of, height_of, is_undistorted, places_of
from lab.stars.sky import made_up_sky, seen_directions
from tasks.stars.field import StarField, find_stars
from tasks.stars.settings import StarSettings
from tasks.stars.solve import CONE, PREDICTED, Region, half_diagonal_deg
from tasks.undistort import UndistortSettings

Array = NDArray[np.float64]
Json = dict[str, Any]
STARS, NONE, ELSEWHERE, WRONG_CONE = "stars", "no stars", "stars elsewhere", "wrong cone"
KINDS = (STARS, NONE, ELSEWHERE, WRONG_CONE)
IN_FRAME = 40.0  # stars per frame down to a signal to noise of about 3
FAINTEST, EXPOSURES = 3.0, (1.0, 3.0, 8.0)  # signal to noise of magnitude 12, and how much longer others are exposed
SURE = 20.0  # signal to noise of the stars that the bars count
FAULTS_OF_A_FRAME = 15
WIDE_DEG = 60.0  # cameras wider than this are no pinholes that stars of a patch of sky fill
LARGEST_FRAME_PX = 2100


@dataclass(frozen=True)
class Scene:
    """A frame to make. seed: of all that is random in it."""

    camera: Camera
    kind: str
    seed: int


def scenes(count: int, seed: int, kinds: tuple[str, ...] = KINDS) -> Iterator[Scene]:
    """As many scenes, over all cameras and kinds in turn."""
    fit = [camera for camera in known_cameras().values() if usable(camera)]
    random = np.random.default_rng(seed)
    for number in range(count):
        camera = fit[int(random.integers(len(fit)))]
        yield Scene(camera, kinds[number % len(kinds)], seed * 1_000_003 + number)


def usable(camera: Camera) -> bool:
    """Whether star fields are made for a camera: frames that are no mere strips or mosaics, and no fish eyes."""
    small = max(camera.detector_size_px) <= LARGEST_FRAME_PX and min(camera.detector_size_px) >= 128
    return small and half_diagonal_deg(camera) < WIDE_DEG / 2


def do(scene: Scene) -> Json:
    """Make a frame, search it, and compare."""
    camera, random = scene.camera, np.random.default_rng(scene.seed)
    psf = max(camera.psf_sigma_px, 0.6) * float(random.uniform(0.85, 1.25))
    half = half_diagonal_deg(camera)
    truth = rotation_from_vector_deg(random.uniform(-180, 180, 3))
    year, velocity = float(random.uniform(1979, 2025)), random.normal(0, 15.0, 3)
    area = np.prod(2 * np.degrees(np.arctan(np.array(camera.size_px) / 2 / camera.focal_length_px)))
    sky = made_up_sky(truth[2], 5 * half, IN_FRAME / float(area), random)
    drawn = sky if scene.kind != ELSEWHERE else made_up_sky(truth[2], 2 * half, IN_FRAME / float(area), random)
    seen = seen_directions(drawn.table, year, velocity)
    places = places_of(camera, truth, seen)
    strength = (
        FAINTEST
        * random.choice(EXPOSURES)
        * 10 ** (0.4 * (12.0 - drawn.table.magnitude))
        * 10 ** random.normal(0, 0.08, len(seen))
    )
    strength = np.minimum(strength, 2000.0)
    shown = np.zeros(len(seen), bool) if scene.kind == NONE else np.isfinite(places).all(axis=1)
    faults = Faults(
        int(random.poisson(FAULTS_OF_A_FRAME)), int(random.poisson(FAULTS_OF_A_FRAME)), float(random.uniform(0.05, 0.4))
    )
    heights = np.array([height_of(each, psf) for each in strength[shown]])
    observation = frame_of(camera, places[shown], heights, psf, faults, random)
    found = find_stars(
        observation, camera, sky, Observer((year - 2000.0) * 365.25 * 86400.0, velocity),
        regions_for(scene.kind, truth, half, random), StarSettings(), UndistortSettings(), is_undistorted(camera),
    )  # fmt: skip
    return {"camera": camera.name, "kind": scene.kind, "seed": scene.seed, **compared(found, camera, truth)}


def regions_for(kind: str, truth: Array, half_deg: float, random: np.random.Generator) -> list[Region]:
    """Where the search is made to look: by a prediction that is off, then in a cone; a wrong cone holds the wrong part
    of the sky."""
    off = random.normal(0, 0.3 * half_deg, 3)
    predicted = rotation_from_vector_deg(off) @ truth
    if kind == WRONG_CONE:
        axis = rotation_from_vector_deg(np.array([3.2 * half_deg, 0.0, 0.0])) @ truth
        return [Region(CONE, Cone(axis[2], half_deg))]
    near = Region(PREDICTED, Cone(predicted[2], max(2.0, 2 * half_deg)), predicted)
    cone = Region(CONE, Cone(predicted[2], 2 * half_deg))
    return [near, cone] if random.uniform() < 0.5 else [cone]


def compared(found: StarField, camera: Camera, truth: Array) -> Json:
    """Whether there is a lock, and how far it is from the truth: error_px of the boresight, roll_deg, z: errors about
    the camera's axes over their stated 1-sigma."""
    lock = found.lock
    content: Json = {"lock": lock is not None, "false_alarm": found.false_alarm, "reason": found.reason}
    if lock is None:
        return content
    orientation = lock.matched.orientation
    off = vector_deg_from_rotation(orientation.camera_from_j2000 @ truth.T)
    signal = found.sources.signal_to_noise[lock.matched.detection]
    return content | {
        "stars": len(lock.matched.star),
        "sure_stars": int((signal >= SURE).sum()),
        "error_px": float(np.radians(np.hypot(off[0], off[1])) * camera.focal_length_px),
        "roll_deg": float(abs(off[2])),
        "z": [float(each) for each in off / np.sqrt(np.diag(orientation.covariance_deg2))],
        "rms_px": orientation.rms_px,
    }


def summary(results: list[Json]) -> Json:
    """Figures over all frames, by kind; a lock more than 5 sigmas and 1 px from the truth is a false one, and so is any
    where there is nothing to find."""
    locked = [each for each in results if each["lock"]]
    with_stars = [each for each in results if each["kind"] == STARS]
    right = [each for each in with_stars if each["lock"] and not is_false(each)]
    sure = [each for each in right if each["sure_stars"] >= 10]
    z = np.array([each["z"] for each in right]).reshape(-1, 3)
    return {
        "frames": len(results),
        "false_locks": sum(is_false(each) for each in locked),
        "with_stars": len(with_stars),
        "locked": len(right),
        "ten_sure_stars": len(sure),
        "error_px_median": _percentile(sure, "error_px", 50),
        "error_px_95": _percentile(sure, "error_px", 95),
        "roll_deg_median": _percentile(sure, "roll_deg", 50),
        "roll_deg_95": _percentile(sure, "roll_deg", 95),
        "within_1_sigma": float((np.abs(z) <= 1).mean()) if len(z) else None,
        "within_2_sigma": float((np.abs(z) <= 2).mean()) if len(z) else None,
    }


def is_false(result: Json) -> bool:
    """Whether a lock is none of the truth's."""
    if not result["lock"]:
        return False
    wrong = result["error_px"] > 1.0 and max(map(abs, result["z"])) > 5.0
    return result["kind"] in (NONE, ELSEWHERE, WRONG_CONE) or wrong


def _percentile(results: list[Json], name: str, percent: float) -> float | None:
    return float(np.percentile([each[name] for each in results], percent)) if results else None
