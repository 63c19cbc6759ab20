"""A profile chooses the method and the settings of every step. It is a TOML file that builds on another profile: what
it leaves out is as there."""

from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator

from catalog.errors import RefusedError
from catalog.plain_files import read_toml_file
from catalog.plain_text import shown_path
from catalog.pose import Pose
from catalog.settings import DEFAULT_PROFILE
from tasks.accept.settings import AcceptSettings, StillSettings
from tasks.attitude import AttitudeSettings
from tasks.closeup import CloseUpSettings, is_close_up
from tasks.diagnose.settings import DiagnoseSettings
from tasks.initial_pose.settings import ImagePoseSettings
from tasks.joint.settings import Group, JointSettings
from tasks.point import PointSettings
from tasks.profile.layers import Content, Origin, differences, merged, with_later_completed, with_nothing
from tasks.range import RangeSettings
from tasks.registry import CLOSEUP, CORRECTIONS
from tasks.roll import RollSettings
from tasks.scene_inputs import UNIFORM, SceneInputs
from tasks.simulate import SceneSettings
from tasks.undistort import UndistortSettings
from tasks.validate import ValidateSettings

PROFILE_FOLDER = Path(__file__).parent / "profiles"
# In a profile file: what it builds on, and the word for no profile, but the defaults that each setting has by itself.
BASE, BARE = "base", "defaults"


def known_correction(name: str) -> str:
    """The name of a correction. Raises ValueError when there is none of that name."""
    if name not in CORRECTIONS:
        raise ValueError(f"there is no correction {name!r}; known are {', '.join(CORRECTIONS)}")
    return name


CorrectionName = Annotated[str, AfterValidator(known_correction), Field(json_schema_extra={"enum": list(CORRECTIONS)})]
# What a pass does unless the profile says otherwise; the paper's order.
USUAL: tuple[CorrectionName, ...] = ("point", "range", "attitude")
GROUPS: tuple[Group, ...] = ("offset", "range", "roll", "attitude", "psf")


class LaterPasses(BaseModel):
    """The second pass and those after it. steps: their corrections, in this order. point, roll, range, attitude,
    joint, closeup: settings; None keeps those of the first pass."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    steps: tuple[CorrectionName, ...] = Field(USUAL, min_length=1)
    point: PointSettings | None = None
    roll: RollSettings | None = None
    range: RangeSettings | None = None
    attitude: AttitudeSettings | None = None
    joint: JointSettings | None = None
    closeup: CloseUpSettings | None = None


class Profile(BaseModel):
    """The settings of all steps. passes: how often, at most, the corrections are done in turn. steps: the first pass's
    corrections, in this order. hold: what must stay as it is at the start; steps that would change it are left out.
    origin: not a setting; what a user's profile builds on and changes, None for those that come with the program.

    Made directly, what is left out has the defaults of the settings themselves, which are no profile that comes with
    the program: `find_profile` and `profile_of` build on one.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")
    name: str = Field("unnamed", min_length=1)
    passes: int = Field(2, ge=1, le=20)
    steps: tuple[CorrectionName, ...] = Field(USUAL, min_length=1)
    hold: tuple[Group, ...] = ()
    undistort: UndistortSettings = UndistortSettings()
    image_pose: ImagePoseSettings = ImagePoseSettings()
    simulate: SceneSettings = SceneSettings()
    point: PointSettings = PointSettings()
    roll: RollSettings = RollSettings()
    range: RangeSettings = RangeSettings()
    attitude: AttitudeSettings = AttitudeSettings()
    joint: JointSettings = JointSettings()
    closeup: CloseUpSettings = CloseUpSettings()
    later: LaterPasses = LaterPasses()
    still: StillSettings = StillSettings()
    validate_: ValidateSettings = Field(ValidateSettings(), alias="validate")
    accept: AcceptSettings = AcceptSettings()
    origin: Origin | None = None
    diagnose: DiagnoseSettings = DiagnoseSettings()

    @model_validator(mode="after")
    def _something_is_left(self) -> "Profile":
        if self.hold and not self.corrections(1):
            raise ValueError(f"with {', '.join(self.hold)} held, none of the steps {', '.join(self.steps)} is left")
        return self

    def holding(self, groups: Iterable[str]) -> "Profile":
        """Copy that also holds `groups`. Raises ValidationError when no correction is left, or a group is unknown."""
        held = list(dict.fromkeys([*self.hold, *groups]))
        return Profile.model_validate(self.model_dump(mode="json", by_alias=True) | {"hold": held})

    def resolved(self) -> dict[str, Any]:
        """Every setting with its value, defaults included, as plain JSON."""
        return self.model_dump(mode="json", by_alias=True, exclude={"origin"})

    def takes_for_close_up(self, pose: Pose, scene: SceneInputs) -> bool:
        """Whether a frame is matched to the base map, in one pass, in place of the usual corrections."""
        has_map = scene.basemap != UNIFORM
        return not self._is_held(CLOSEUP.name) and is_close_up(pose, scene.camera, scene.target, self.closeup, has_map)

    def corrections(self, number: int) -> tuple[CorrectionName, ...]:
        """The corrections of pass `number`, in the order of doing, without those that would change what is held."""
        steps = self.steps if number == 1 else self.later.steps
        return tuple(step for step in steps if not self._is_held(step))

    def _is_held(self, step: CorrectionName) -> bool:
        held = set(self.hold)
        changed = CORRECTIONS[step].parameters
        return bool(changed & held) if changed else held >= set(GROUPS)

    def settings_of(self, correction: str, number: int = 1) -> BaseModel:
        """Settings of a correction in pass `number`. Raises AttributeError when there is no such correction."""
        later = getattr(self.later, correction) if number > 1 else None
        settings: BaseModel = later or getattr(self, correction)
        if isinstance(settings, JointSettings | CloseUpSettings):
            held = tuple(group for group in GROUPS if group in (*settings.hold, *self.hold))
            return settings.model_copy(update={"hold": held})
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
    """Profile of a TOML file; its name is the file's unless it gives one. Raises RefusedError for each bad setting,
    for a base that is not there, and for profiles that build on each other."""
    return _of_layer(_content_of(path), path, (path,))[0]


def profile_of(content: Content, name: str = "unnamed") -> Profile:
    """Profile of settings as a TOML file has them (files that it builds on are relative to the working folder), or of a
    dump of the whole model, `origin` included. Raises RefusedError as `read_profile`."""
    if "origin" in content:
        return Profile.model_validate(content)
    return _of_layer(content, Path(f"{name}.toml"), ())[0]


def _of_layer(content: Content, path: Path, above: tuple[Path, ...]) -> tuple[Profile, Content]:
    """Profile of a file's content, and its settings with those that it builds on; above: the files that lead here."""
    shipped = path in known_profiles().values()
    named = content.get(BASE, BARE if shipped else DEFAULT_PROFILE)
    settings = {key: value for key, value in content.items() if key != BASE}
    bases: tuple[str, ...] = (BARE,)
    if named == BARE:
        # Value by value: a table that names some settings of a group leaves the others as this group has them.
        settings = merged(_plain(Profile()), settings)
    else:
        base = _base_of(named, path, above)
        below, under = _of_layer(_content_of(base), base, (*above, base))
        settings = merged(under, settings)
        bases = (named, *(below.origin.bases if below.origin else ()))
    profile = _validated(settings | {"name": content.get("name", shown_path(path.stem))}, path)
    if shipped:
        return profile, settings
    root = Profile() if bases[-1] == BARE else find_profile(bases[-1])
    origin = Origin(bases=bases, changes=differences(_plain(root), _plain(profile)))
    return profile.model_copy(update={"origin": origin}), settings


def _plain(profile: Profile) -> Content:
    """All that a file can set, but the name."""
    return {key: value for key, value in profile.resolved().items() if key != "name"}


def _base_of(named: Any, path: Path, above: tuple[Path, ...]) -> Path:
    """The file of the profile that the one of `path` names as its base."""
    base = known_profiles().get(named) if isinstance(named, str) else None
    if base is None and isinstance(named, str):
        base = path.parent / Path(named).expanduser()
    if base is None or not base.is_file():
        raise RefusedError(
            "profile-base-missing",
            f"profile {path} builds on {named!r}, which is neither a profile that comes with the program nor a file.",
            f'Known are {", ".join(known_profiles())}, and "{BARE}"; a file is looked for beside the profile.',
        )
    if base.resolve() in [each.resolve() for each in above]:
        chain = " -> ".join(str(each) for each in (*above, base))
        raise RefusedError(
            "profile-base-circular",
            f"profiles build on each other: {chain}.",
            f'Let one of them say base = "{DEFAULT_PROFILE}".',
        )
    return base


def _content_of(path: Path) -> Content:
    try:
        return read_toml_file(path)
    except (OSError, ValueError) as error:
        raise RefusedError(
            "profile-unreadable",
            f"profile {path} cannot be read: {error}.",
            f"Give a TOML file, or one of {', '.join(known_profiles())}.",
        ) from error


def _validated(settings: Content, path: Path) -> Profile:
    try:
        if "origin" in settings:
            raise ValueError("origin: this describes a profile, and is no setting")
        return Profile.model_validate(with_nothing(Profile, with_later_completed(settings)))
    except ValidationError as error:
        faults = "; ".join(f"{'.'.join(map(str, fault['loc']))}: {fault['msg']}" for fault in error.errors())
        raise _invalid(path, faults) from error
    except ValueError as error:
        raise _invalid(path, str(error)) from error


def _invalid(path: Path, faults: str) -> RefusedError:
    return RefusedError("profile-invalid", f"profile {path}: {faults}.", "`planetpose profiles` shows every setting.")
