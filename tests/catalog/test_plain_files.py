"""Whatever a JSON or TOML file of the user's holds, it is read or refused by name."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from catalog.camera import find_camera
from catalog.errors import RefusedError
from catalog.lists import load_image_list
from catalog.plain_files import MAX_DEPTH, parsed_json, parsed_toml, read_json_file
from catalog.pose import read_pose_file
from catalog.resumed import pose_to_resume
from catalog.target import find_target
from tasks.profile import find_profile

DEEP = 100_000
DEEP_JSON = ["[" * DEEP, "[" * DEEP + "]" * DEEP, '{"et": ' * DEEP + "1" + "}" * DEEP, '{"et": ' + "[" * DEEP]
DEEP_TOML = [
    "name = " + "[" * DEEP,
    "name = " + "[" * DEEP + "]" * DEEP,
    "name = " + "{a = " * DEEP + "1" + "}" * DEEP,
    "name" + ".a" * DEEP + " = 1",
    "[name" + ".a" * DEEP + "]",
    "[[name" + '."a"' * DEEP + "]]",
    "name" + " . 'a'" * DEEP + " = 1",
]


def resume(path: str) -> Any:
    return pose_to_resume(Path(path), "a")


READ: dict[str, list[Callable[[str], Any]]] = {
    "json": [lambda path: read_pose_file(Path(path)), resume],
    "toml": [find_camera, find_target, find_profile, load_image_list],
}


@pytest.mark.parametrize(("kind", "text"), [("json", t) for t in DEEP_JSON] + [("toml", t) for t in DEEP_TOML])
def test_files_nested_without_end_are_refused_by_name(kind: str, text: str, tmp_path: Path) -> None:
    path = tmp_path / f"deep.{kind}"
    path.write_text(text)
    for read in READ[kind]:
        with pytest.raises(RefusedError, match=r"deep\..*nested more than"):
            read(str(path))


@pytest.mark.parametrize(
    ("kind", "content", "reported"),
    [
        ("json", b'{"et": NaN}', "NaN is no finite number"),
        ("json", b'{"et": -Infinity}', "Infinity is no finite number"),
        ("json", b'{"et": 1e999}', "1e999 is no finite number"),
        ("json", b'{"et": ' + b"1" * 5000 + b"}", "no number of sane size"),
        ("json", b'{"et": 1, "et": 2}', "'et' is given twice"),
        ("json", '{"et": 1}'.encode("utf-16"), "UTF-16"),
        ("json", '{"et": 1}'.encode("utf-32"), "UTF-32"),
        ("json", '{"et": 1}'.encode("utf-16-le"), "UTF-8"),
        ("json", b'{"utc": "\xff"}', "UTF-8"),
        ("json", b'{"et": 1', "no sound JSON"),
        ("json", b"", "no sound JSON"),
        ("toml", b"name = inf", "inf is no finite number"),
        ("toml", b"name = nan", "nan is no finite number"),
        ("toml", b"name = 1e999", "1e999 is no finite number"),
        ("toml", b"name = " + b"1" * 4000, "size"),
        ("toml", b"name = 1\nname = 2", "no sound TOML"),
        ("toml", 'name = "a"'.encode("utf-16"), "UTF-16"),
        ("toml", b'name = "\xff"', "UTF-8"),
    ],
)
def test_numbers_keys_and_encodings_that_mean_nothing_are_refused_by_name(
    kind: str, content: bytes, reported: str, tmp_path: Path
) -> None:
    path = tmp_path / f"odd.{kind}"
    path.write_bytes(content)
    for read in READ[kind]:
        with pytest.raises(RefusedError, match=r"odd\.") as refusal:
            read(str(path))
        assert reported in refusal.value.fault


def test_a_byte_order_mark_of_utf_8_is_no_fault(tmp_path: Path) -> None:
    (tmp_path / "pose.json").write_bytes(b'\xef\xbb\xbf{"et": 5.5}')
    assert read_pose_file(tmp_path / "pose.json").et == 5.5


PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers(-(10**20), 10**20) | st.floats(allow_nan=False, allow_infinity=False),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    max_leaves=20,
)


@given(PLAIN)
@settings(max_examples=50, deadline=None)
def test_sound_json_is_what_the_library_reads(content: Any) -> None:
    assert parsed_json(json.dumps(content)) == content


@pytest.mark.parametrize("read", [parsed_json, parsed_toml])
@given(text=st.text(max_size=60))
@settings(max_examples=50, deadline=None)
def test_any_text_is_read_or_refused(read: Callable[[str], Any], text: str) -> None:
    try:
        read(text)
    except ValueError:
        return


def test_depth_is_counted_to_the_last_allowed_one(tmp_path: Path) -> None:
    path = tmp_path / "a.json"
    path.write_text("[" * MAX_DEPTH + "]" * MAX_DEPTH)
    assert isinstance(read_json_file(path), list)
    assert parsed_toml("a" + ".b" * (MAX_DEPTH - 2) + " = 1")["a"]
    path.write_text("[" * (MAX_DEPTH + 2) + "]" * (MAX_DEPTH + 2))
    with pytest.raises(ValueError, match="nested"):
        read_json_file(path)
