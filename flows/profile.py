"""A profile chooses every step's brick and settings. It is a TOML file; what it leaves out keeps its default."""

import tomllib
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from catalog.errors import RefusedError
from tasks.attitude import AttitudeSettings
from tasks.diagnose.settings import DiagnoseSettings
from tasks.joint import JointSettings
from tasks.joint.settings import Group
from tasks.point import PointSettings
from tasks.range import RangeSettings
from tasks.roll import RollSettings
from tasks.simulate import SceneSettings
from tasks.undistort import UndistortSettings
from tasks.validate import ValidateSettings

PROFILE_FOLDER = Path(__file__).parent / "profiles"
CorrectionName = Literal["point", "roll", "range", "attitude", "joint"]
CORRECTIONS: tuple[CorrectionName, ...] = ("point", "roll", "range", "attitude", "joint")
# What a pass does unless the profile says otherwise; the paper's order.
USUAL: tuple[CorrectionName, ...] = ("point", "range", "attitude")
# What each correction changes; the joint one can hold any of them.
CHANGES: dict[CorrectionName, frozenset[str]] = {
    "point": frozenset({"offset"}),
    "roll": frozenset({"roll", "offset", "attitude"}),
    "range": frozenset({"range", "offset"}),
    "attitude": frozenset({"attitude"}),
}
GROUPS: tuple[Group, ...] = ("offset", "range", "roll", "attitude", "psf")


class AcceptSettings(BaseModel):
    """When a corrected pose is believed. max_limb_rms_px: None takes any. require_limb: a pose whose limb could not be
    measured is not believed. min_likeness, sure_likeness: correlation of image and simulation, see `tasks.validate`;
    below the first the pose is not believed, below the second it is doubtful. sure_limb_rms_px: with a limb further off
    the pose is doubtful; None doubts none. A limb is that far off by its robust RMS, see `tasks.validate`: segments
    that lock onto an edge of the surface are no doubt, unless more than limb_share of them lie elsewhere. sure_blur:
    where something else is doubted, a limb so many times as wide as simulated is told first."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    max_limb_rms_px: float | None = Field(3.0, gt=0)
    sure_limb_rms_px: float | None = Field(None, gt=0)
    limb_share: float = Field(0.2, gt=0, le=1)
    require_limb: bool = True
    sure_blur: float = Field(2.5, gt=1)
    min_likeness: float = Field(0.6, ge=-1, le=1)
    sure_likeness: float = Field(0.8, ge=-1, le=1)


class StillSettings(BaseModel):
    """A pass whose every correction is smaller than these is the last."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    offset_px: float = Field(0.03, ge=0)
    range_factor: float = Field(1e-4, ge=0)
    attitude_deg: float = Field(0.03, ge=0)


class LaterPasses(BaseModel):
    """The second pass and those after it. steps: their corrections, in this order. point, roll, range, attitude,
    joint: settings; None keeps those of the first pass."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    steps: tuple[CorrectionName, ...] = Field(USUAL, min_length=1)
    point: PointSettings | None = None
    roll: RollSettings | None = None
    range: RangeSettings | None = None
    attitude: AttitudeSettings | None = None
    joint: JointSettings | None = None


class Profile(BaseModel):
    """The settings of all steps. passes: how often, at most, the corrections are done in turn. steps: the first pass's
    corrections, in this order. hold: what must stay as it is at the start; steps that would change it are left out."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    name: str = Field("unnamed", min_length=1)
    passes: int = Field(2, ge=1, le=20)
    steps: tuple[CorrectionName, ...] = Field(USUAL, min_length=1)
    hold: tuple[Group, ...] = ()
    undistort: UndistortSettings = UndistortSettings()
    simulate: SceneSettings = SceneSettings()
    point: PointSettings = PointSettings()
    roll: RollSettings = RollSettings()
    range: RangeSettings = RangeSettings()
    attitude: AttitudeSettings = AttitudeSettings()
    joint: JointSettings = JointSettings()
    later: LaterPasses = LaterPasses()
    still: StillSettings = StillSettings()
    validate_: ValidateSettings = Field(ValidateSettings(), alias="validate")
    accept: AcceptSettings = AcceptSettings()
    diagnose: DiagnoseSettings = DiagnoseSettings()

    @model_validator(mode="after")
    def _something_is_left(self) -> "Profile":
        if self.hold and not self.corrections(1):
            raise ValueError(f"with {', '.join(self.hold)} held, none of the steps {', '.join(self.steps)} is left")
        return self

    def holding(self, groups: Iterable[str]) -> "Profile":
        """Copy that also holds `groups`. Raises ValidationError when no correction is left, or a group is unknown."""
        content = self.resolved()
        return Profile.model_validate(content | {"hold": list(dict.fromkeys([*content["hold"], *groups]))})

    def resolved(self) -> dict[str, Any]:
        """Every setting with its value, defaults included, as plain JSON."""
        return self.model_dump(mode="json", by_alias=True)

    def corrections(self, number: int) -> tuple[CorrectionName, ...]:
        """The corrections of pass `number`, in the order of doing, without those that would change what is held."""
        steps = self.steps if number == 1 else self.later.steps
        return tuple(step for step in steps if not self._is_held(step))

    def _is_held(self, step: CorrectionName) -> bool:
        held = set(self.hold)
        return bool(CHANGES[step] & held) if step in CHANGES else held >= set(GROUPS)

    def settings_of(self, step: str, number: int = 1) -> dict[str, Any]:
        """Settings of one step in pass `number` as plain JSON."""
        everything = self.resolved()
        later = everything["later"].get(step) if number > 1 else None
        settings = dict(later or everything[step])
        if step == "joint":
            settings["hold"] = [group for group in GROUPS if group in (*settings["hold"], *self.hold)]
        return settings


@cache
def known_profiles() -> dict[str, Path]:
    """Profiles that come with the program: name and file."""
    return {path.stem: path for path in sorted(PROFILE_FOLDER.glob("*.toml"))}


def find_profile(name_or_file: str) -> Profile:
    """Profile by name, or from a user's TOML file. Raises RefusedError naming the fault and what is known."""
    path = known_profiles().get(name_or_file)
    if path is None and not name_or_file.endswith(".toml"):
        raise RefusedError(
            "profile-unknown",
            f"there is no profile {name_or_file!r}.",
            f"Known are {', '.join(known_profiles())}; or give --profile FILE.toml.",
        )
    return read_profile(path or Path(name_or_file))


def read_profile(path: Path) -> Profile:
    """Profile of a TOML file; its name is the file's unless it gives one. Raises RefusedError for each bad setting."""
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
        return Profile.model_validate({"name": path.stem, **content})
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise RefusedError(
            "profile-unreadable",
            f"profile {path} cannot be read: {error}.",
            f"Give a TOML file, or one of {', '.join(known_profiles())}.",
        ) from error
    except ValidationError as error:
        faults = "; ".join(f"{'.'.join(map(str, fault['loc']))}: {fault['msg']}" for fault in error.errors())
        raise RefusedError(
            "profile-invalid", f"profile {path}: {faults}.", "See the README for the settings."
        ) from error
