"""Profile files build on a profile: what they leave out is as there, and what they change is reported."""

from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from catalog.errors import RefusedError
from catalog.settings import DEFAULT_PROFILE
from flows.cli import build_app
from flows.request import Request
from tasks.profile import Profile, find_profile, known_profiles, profile_of, read_profile
from tasks.profile.layers import differences, in_words, merged

LINE = "[accept]\nmax_limb_rms_px = 6.0\n"


def settings_of(profile: Profile) -> dict[str, Any]:
    return profile.model_dump(mode="json", by_alias=True, exclude={"name", "origin"})


def written(folder: Path, text: str, name: str = "own.toml") -> Path:
    (folder / name).write_text(text)
    return folder / name


@pytest.mark.parametrize(
    ("text", "key", "was", "now"),
    [
        (LINE, "accept.max_limb_rms_px", 3.0, 6.0),
        ("passes = 2\n", "passes", 1, 2),
        ('hold = ["attitude"]\n', "hold", [], ["attitude"]),
        ("[joint.priors.file]\nrange_share = 0.001\n", "joint.priors.file.range_share", 0.02, 0.001),
        ("[joint]\nplain = []\n", "joint.plain", ["lambert", "lommel-seeliger"], []),
        ("[range.limb]\nacross = 100\n", "range.limb.across", 200, 100),
        ('[joint]\nlimb_led_px = "none"\n', "joint.limb_led_px", 0.3, None),
        ('[accept]\nsure_limb_rms_px = "none"\n', "accept.sure_limb_rms_px", 0.5, None),
        ('[undistort]\nspace = "sensor"\n', "undistort.space", "resampled", "sensor"),
    ],
)
def test_a_profile_of_one_line_is_the_default_one_but_for_that_line(
    tmp_path: Path, text: str, key: str, was: Any, now: Any
) -> None:
    own = read_profile(written(tmp_path, text))
    found = differences(settings_of(find_profile(DEFAULT_PROFILE)), settings_of(own))
    assert {name: (change.base, change.here) for name, change in found.items()} == {key: (was, now)}
    assert own.origin is not None
    assert (own.name, own.origin.bases, own.origin.changes) == ("own", (DEFAULT_PROFILE,), found)


@pytest.mark.parametrize("base", [*known_profiles()])
def test_a_profile_builds_on_the_one_that_it_names(tmp_path: Path, base: str) -> None:
    own = read_profile(written(tmp_path, f'base = "{base}"\n{LINE}'))
    assert list(differences(settings_of(find_profile(base)), settings_of(own))) == ["accept.max_limb_rms_px"]


def test_the_defaults_of_the_settings_themselves_are_a_base_too(tmp_path: Path) -> None:
    own = read_profile(written(tmp_path, 'base = "defaults"\npasses = 1\n'))
    assert settings_of(own) == settings_of(Profile(passes=1))


def test_profiles_that_come_with_the_program_say_what_they_build_on_and_are_not_reported_as_changed() -> None:
    for path in known_profiles().values():
        assert 'base = "defaults"' in path.read_text()
        assert read_profile(path).origin is None


def test_files_build_on_files_and_all_that_differs_from_the_programs_profile_is_reported(tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    written(
        tmp_path / "deep", 'base = "standard"\nname = "bottom"\n[point]\nstop_px = 0.2\nmax_iterations = 7\n', "a.toml"
    )
    written(tmp_path, 'base = "deep/a.toml"\n[point]\nstop_px = 0.4\n', "b.toml")
    own = read_profile(written(tmp_path, 'base = "b.toml"\nsteps = ["point"]\n', "c.toml"))
    assert own.origin is not None
    assert own.name == "c"
    assert own.origin.bases == ("b.toml", "deep/a.toml", "standard")
    assert set(own.origin.changes) == {"steps", "point.stop_px", "point.max_iterations"}
    assert (own.point.stop_px, own.point.max_iterations, own.steps) == (0.4, 7, ("point",))
    reported = in_words(own.name, own.origin)
    print(reported)
    assert (
        "c builds on b.toml, which builds on deep/a.toml, which builds on standard; of standard it changes" in reported
    )


def test_a_later_pass_keeps_the_first_ones_settings_but_for_what_it_changes(tmp_path: Path) -> None:
    text = "[joint]\noversample = 3\n[later.joint]\nmax_iterations = 4\n"
    own = read_profile(written(tmp_path, text))
    first, later = own.settings_of("joint", 1), own.settings_of("joint", 2)
    assert later == first.model_copy(update={"max_iterations": 4})
    assert first.oversample == 3


@pytest.mark.parametrize(
    ("files", "code", "words"),
    [
        ({"own": 'base = "own.toml"'}, "profile-base-circular", "own.toml -> "),
        (
            {"own": 'base = "b.toml"', "b": 'base = "./c.toml"', "c": 'base = "own.toml"'},
            "profile-base-circular",
            "c.toml",
        ),
        ({"own": 'base = "nowhere"'}, "profile-base-missing", "nowhere"),
        ({"own": "base = 3"}, "profile-base-missing", "builds on 3"),
        ({"own": 'base = "b.toml"', "b": "passes = 99"}, "profile-invalid", "b.toml: passes"),
        ({"own": 'base = "b.toml"', "b": "passes = "}, "profile-unreadable", "b.toml"),
        ({"own": "joint = 3"}, "profile-invalid", "own.toml: joint"),
        ({"own": "[origin]\nbases = []"}, "profile-invalid", "origin"),
        ({"own": '[accept]\nmin_likeness = "none"'}, "profile-invalid", "accept.min_likeness"),
    ],
)
def test_what_cannot_be_built_on_is_named(tmp_path: Path, files: dict[str, str], code: str, words: str) -> None:
    for name, text in files.items():
        written(tmp_path, text + "\n", f"{name}.toml")
    with pytest.raises(RefusedError) as refused:
        read_profile(tmp_path / "own.toml")
    print(refused.value)
    assert refused.value.code == code
    assert words in refused.value.reason


def test_settings_given_as_parameters_of_a_request_build_on_the_default_profile_too() -> None:
    request = Request.model_validate({"image": "a.img", "profile": {"accept": {"max_limb_rms_px": 6.0}}})
    assert request.profile.steps == find_profile(DEFAULT_PROFILE).steps
    assert Request.model_validate_json(request.model_dump_json(by_alias=True)) == request
    named = Request.model_validate({"image": "a.img", "profile": "paper"})
    assert Request.model_validate_json(named.model_dump_json(by_alias=True)) == named


def test_the_command_says_what_a_profile_changes(tmp_path: Path) -> None:
    own = written(tmp_path, LINE)
    missing = str(tmp_path / "none.png")
    done = CliRunner().invoke(
        build_app(), ["correct", missing, "--profile", str(own), "--hold", "everything", "--no-kernels"]
    )
    assert "profile own builds on joint; of joint it changes accept.max_limb_rms_px 3.0 -> 6.0." in done.stderr
    done = CliRunner().invoke(build_app(), ["correct", missing, "--hold", "everything", "--no-kernels"])
    assert "builds on" not in done.stderr
    quiet = ["correct", missing, "--profile", str(own), "--hold", "everything", "--no-kernels", "--quiet"]
    assert "builds on" not in CliRunner().invoke(build_app(), quiet).stderr


def test_tables_merge_and_all_else_replaces() -> None:
    base = {"a": {"b": 1, "c": {"d": [1, 2], "e": 3}}, "f": {"g": 1}, "h": 2}
    over = {"a": {"c": {"d": [5]}}, "f": 4, "h": {"i": 6}}
    assert merged(base, over) == {"a": {"b": 1, "c": {"d": [5], "e": 3}}, "f": 4, "h": {"i": 6}}
    assert merged(base, {}) == merged({}, base) == merged(base, base) == base


def test_the_model_of_a_whole_profile_is_read_back_as_it_is() -> None:
    for name in known_profiles():
        whole = find_profile(name).holding(["attitude"])
        assert profile_of(whole.model_dump(mode="json", by_alias=True)) == whole
        assert profile_of(whole.resolved()).resolved() == whole.resolved()
