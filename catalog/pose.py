"""What metadata claims about one image: where the camera is and looks, how the target is turned, where the Sun is."""

import dataclasses
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from catalog.errors import RefusedError
from catalog.placed_body import PlacedBody, body_from_dict
from catalog.plain_files import read_json_file
from catalog.reasons import Reason
from catalog.rotation import checked_rotation
from catalog.times import et_from_utc, utc_from_et

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

POSE_KEYS = ("camera_from_j2000", "target_from_spacecraft_km", "sun_from_target_km", "body_from_j2000")
# In place of a pose file: the pose is found in the image itself.
IN_IMAGE = "image"
SAME_TIME_S = 0.01
MAX_VELOCITY_KM_S = 1000.0
VELOCITY_KEYS = ("spacecraft_velocity_km_s", "target_velocity_km_s")  # optional, and known together
BODIES = "bodies"  # optional: what else may be in the frame
# Optional in a pose file: the 1-sigma errors that it states of itself, in place of those that a profile assumes.
ERRORS = "errors"
STATED_ERRORS = ("range_km", "range_share", "roll_deg", "attitude_deg")


def _checked_position(value: ArrayLike, name: str) -> Vector:
    v = np.array(value, dtype=np.float64)
    if v.shape != (3,) or not np.isfinite(v).all() or not np.any(v):
        raise ValueError(f"{name} must be three finite kilometres, not all zero; got {v.tolist()}")
    v.setflags(write=False)
    return v


def _checked_velocity(value: ArrayLike, name: str) -> Vector:
    v = np.array(value, dtype=np.float64)
    if v.shape != (3,) or not np.isfinite(v).all() or np.linalg.norm(v) > MAX_VELOCITY_KM_S:
        raise ValueError(f"{name} must be three finite km/s, at most {MAX_VELOCITY_KM_S:g} together; got {v.tolist()}")
    v.setflags(write=False)
    return v


@dataclass(frozen=True)
class Pose:
    """Geometry of one exposure at its middle.

    et: TDB seconds past J2000. camera_from_j2000, body_from_j2000: (3, 3) rotations (camera: +Z boresight, +X sample,
    +Y line). target_from_spacecraft_km: (3,) J2000, light time and stellar aberration corrected (LT+S).
    sun_from_target_km: (3,) J2000. spacecraft_velocity_km_s, target_velocity_km_s: (3,) J2000, relative to the solar
    system's barycentre, the target's when the light left it; both, or None. With them the projection knows how
    aberration and light time differ over the disk; without, both are taken as the centre's. bodies: others that are
    in the frame or shadow what is, placed relative to the target. Raises ValueError when a matrix is no rotation or a
    vector is not finite.
    """

    et: float
    camera_from_j2000: Matrix
    target_from_spacecraft_km: Vector
    sun_from_target_km: Vector
    body_from_j2000: Matrix
    spacecraft_velocity_km_s: Vector | None = None
    target_velocity_km_s: Vector | None = None
    bodies: tuple[PlacedBody, ...] = ()

    def __post_init__(self) -> None:
        if not np.isfinite(self.et):
            raise ValueError("et must be finite")
        for name in ("camera_from_j2000", "body_from_j2000"):
            object.__setattr__(self, name, checked_rotation(getattr(self, name), name))
        for name in ("target_from_spacecraft_km", "sun_from_target_km"):
            object.__setattr__(self, name, _checked_position(getattr(self, name), name))
        if (self.spacecraft_velocity_km_s is None) != (self.target_velocity_km_s is None):
            raise ValueError(f"{' and '.join(VELOCITY_KEYS)} belong together: give both or none")
        for name in VELOCITY_KEYS:
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _checked_velocity(getattr(self, name), name))

    @property
    def range_km(self) -> float:
        """Distance from the spacecraft to the target's centre."""
        return float(np.linalg.norm(self.target_from_spacecraft_km))

    @property
    def target_in_camera_km(self) -> Vector:
        """Target centre in the camera frame (3,)."""
        return self.camera_from_j2000 @ self.target_from_spacecraft_km

    @property
    def camera_from_body(self) -> Matrix:
        """Rotation from the target's body-fixed frame to the camera frame."""
        return self.camera_from_j2000 @ self.body_from_j2000.T

    @property
    def spacecraft_in_body_km(self) -> Vector:
        """Spacecraft relative to the target's centre, in the body-fixed frame (3,)."""
        return -self.body_from_j2000 @ self.target_from_spacecraft_km

    @property
    def sun_direction_in_body(self) -> Vector:
        """Unit vector from the target to the Sun, in the body-fixed frame (3,)."""
        sun = self.body_from_j2000 @ self.sun_from_target_km
        return sun / np.linalg.norm(sun)

    @property
    def phase_deg(self) -> float:
        """Sun-target-spacecraft angle at the target's centre."""
        to_spacecraft = self.spacecraft_in_body_km / self.range_km
        return float(np.degrees(np.arccos(np.clip(to_spacecraft @ self.sun_direction_in_body, -1, 1))))

    def replaced(self, **changes: Any) -> "Pose":
        """Copy with some fields replaced."""
        return dataclasses.replace(self, **changes)

    def with_range_factor(self, factor: float) -> "Pose":
        """Copy with the target `factor` times as far, along the same line of sight."""
        return self.replaced(target_from_spacecraft_km=self.target_from_spacecraft_km * factor)

    def to_dict(self) -> dict[str, Any]:
        """Pose file content: utc, et, the four geometry keys and, where known, the velocities as plain lists."""
        return {
            "utc": utc_from_et(self.et),
            "et": float(self.et),
            **{key: getattr(self, key).tolist() for key in POSE_KEYS},
            **{key: getattr(self, key).tolist() for key in VELOCITY_KEYS if getattr(self, key) is not None},
            **({BODIES: [body.to_dict() for body in self.bodies]} if self.bodies else {}),
        }

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> "Pose":
        """Pose from a complete pose file's content. Raises ValueError naming what is missing or wrong."""
        partial = PartialPose.from_dict(content)
        missing = partial.missing()
        if missing:
            raise ValueError(f"the pose lacks {', '.join(missing)}")
        return partial.completed()


@dataclass(frozen=True)
class PartialPose:
    """The parts of a pose that one source knows; None marks an unknown part. bodies: placed, or as a file has them.
    errors: 1-sigma errors that a pose file states of itself (STATED_ERRORS); empty where it states none."""

    et: float | None = None
    camera_from_j2000: Matrix | None = None
    target_from_spacecraft_km: Vector | None = None
    sun_from_target_km: Vector | None = None
    body_from_j2000: Matrix | None = None
    spacecraft_velocity_km_s: Vector | None = None
    target_velocity_km_s: Vector | None = None
    bodies: tuple[PlacedBody | Mapping[str, Any], ...] = ()
    errors: Mapping[str, float] = dataclasses.field(default_factory=dict)

    @classmethod
    def from_dict(cls, content: dict[str, Any]) -> "PartialPose":
        """Parts from a pose file's content. Raises ValueError for unknown keys, bad values and bad rotations."""
        if not isinstance(content, dict):
            raise ValueError("a pose file holds one JSON object")
        known_keys = ("utc", "et", *POSE_KEYS, *VELOCITY_KEYS, BODIES, ERRORS)
        unknown = sorted(set(content) - set(known_keys))
        if unknown:
            raise ValueError(f"unknown keys {unknown}; known are {', '.join(known_keys)}")
        bodies = content.get(BODIES) or ()
        if not isinstance(bodies, list | tuple) or not all(isinstance(each, Mapping) for each in bodies):
            raise ValueError(f"{BODIES} is no list of JSON objects")
        et = content.get("et")
        if et is None and content.get("utc") is not None:
            et = et_from_utc(str(content["utc"]))
        keys = (*POSE_KEYS, *VELOCITY_KEYS)
        known: dict[str, Any] = {key: content[key] for key in keys if content.get(key) is not None}
        try:
            for key in known:
                known[key] = _check_of(key)(known[key], key)
            errors = _checked_errors(content.get(ERRORS))
            return cls(et=None if et is None else float(et), bodies=tuple(bodies), errors=errors, **known)
        except TypeError as error:
            raise ValueError(f"a value is not a number: {error}") from error

    def missing(self) -> list[str]:
        """Names of the unknown parts that a pose needs."""
        return [name for name in ("et", *POSE_KEYS) if getattr(self, name) is None]

    def filled_from(self, other: "PartialPose") -> "PartialPose":
        """Copy whose unknown parts are taken from `other`; velocities go with the position."""
        gaps = self.missing()
        taken = (*gaps, *(VELOCITY_KEYS if "target_from_spacecraft_km" in gaps else ()))
        return dataclasses.replace(self, **{name: getattr(other, name) for name in taken})

    def completed(self) -> Pose:
        """The full Pose. Raises ValueError when a part is unknown."""
        missing = self.missing()
        if missing:
            raise ValueError(f"unknown parts: {', '.join(missing)}")
        bodies = tuple(
            each if isinstance(each, PlacedBody) else body_from_dict(each, number)
            for number, each in enumerate(self.bodies)
        )
        parts = {field.name: getattr(self, field.name) for field in dataclasses.fields(Pose)}
        return Pose(**{**parts, BODIES: bodies})


def _check_of(key: str) -> Callable[[ArrayLike, str], Any]:
    if key in VELOCITY_KEYS:
        return _checked_velocity
    return checked_rotation if key.endswith("_j2000") else _checked_position


def _checked_errors(errors: Any) -> dict[str, float]:
    """1-sigma errors as a pose file states them. Raises ValueError for unknown names and values that are no error."""
    if errors is None:
        return {}
    if not isinstance(errors, Mapping):
        raise ValueError(f"{ERRORS} is no JSON object")
    if unknown := sorted(set(errors) - set(STATED_ERRORS)):
        raise ValueError(f"unknown {ERRORS} {unknown}; known are {', '.join(STATED_ERRORS)}")
    values = {}
    for name, value in errors.items():
        try:
            values[name] = float(value)
        except ValueError as error:
            raise ValueError(f"{ERRORS}.{name} is no number: {value!r}") from error
    for name, value in values.items():
        if not (np.isfinite(value) and value > 0):
            raise ValueError(f"{ERRORS}.{name} must be finite and positive, not {value:g}")
    return values


def read_pose_file(path: Path) -> PartialPose:
    """Read a pose file (JSON). Raises RefusedError naming the file, the fault and the remedy."""
    remedy = "See the README's section on pose files for the keys and their shapes."
    try:
        content = read_json_file(Path(path))
        partial = PartialPose.from_dict(content)
        _check_times_agree(content)
        return partial
    except OSError as error:
        raise RefusedError(
            Reason.POSE_FILE_UNREADABLE, f"pose file {path} cannot be read ({error}).", remedy
        ) from error
    except ValueError as error:
        raise RefusedError(Reason.POSE_FILE_INVALID, f"pose file {path}: {error}.", remedy) from error


def _check_times_agree(content: dict[str, Any]) -> None:
    """Both times of a pose file are the same one; when only one was edited, the other would be taken in silence."""
    utc, et = content.get("utc"), content.get("et")
    if utc is None or et is None:
        return
    if abs(et_from_utc(str(utc)) - float(et)) > SAME_TIME_S:
        raise ValueError(f"utc {utc} and et {et} are not the same time ({utc_from_et(float(et))}): leave one out")


def write_pose_file(pose: Pose, path: Path) -> None:
    """Write `pose` as a pose file (JSON) that `read_pose_file` reads back bit for bit."""
    Path(path).write_text(json.dumps(pose.to_dict(), indent=1) + "\n")
