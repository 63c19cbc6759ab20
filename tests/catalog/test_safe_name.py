"""Product names never leave the store's folder, whatever the file or the label is called."""

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from catalog.lists import ImageEntry
from catalog.safe_name import MAX_NAME_BYTES, RESERVED, is_safe_product_name, safe_product_name
from flows.request import Request

WILD = (
    "../../x", "..", ".", "", "/etc/passwd", "a\0b", "x" * 5000, "Ευρώπη" * 60, "\u202egnp.x", "a\nb", "NUL",
    "com1.img", "-rf", "~root", "$(touch x)", "`x`", "a;b", "a|b", "C:\\x", "%2e%2e%2f", "\udcff\udcfe", "🛰" * 100, " ",
    "...", "a/", "[red]x[/red]", "*", "?", "a'b\"c", "\x1b[31m",
)  # fmt: skip


def check(name: str, tmp_path: Path) -> None:
    safe = safe_product_name(name)
    assert safe
    assert len(safe.encode()) <= MAX_NAME_BYTES
    assert not set(safe) & set("/\\\0\n$`;|&<>*?[]'\" ~%!#{}:\x1b")
    assert safe[0] not in ".-"
    assert safe.partition(".")[0].upper() not in RESERVED
    assert is_safe_product_name(safe)
    (tmp_path / safe).mkdir(exist_ok=True)
    assert (tmp_path / safe).resolve().parent == tmp_path.resolve()


@pytest.mark.parametrize("name", WILD)
def test_wild_names_become_folders_inside_the_store(name: str, tmp_path: Path) -> None:
    check(name, tmp_path)


@given(st.text())
def test_any_text_becomes_a_name_that_stays_as_it_is(name: str) -> None:
    safe = safe_product_name(name)
    assert is_safe_product_name(safe)
    assert not set(safe) & set("/\\\0 ")


def test_names_of_the_archives_are_not_changed() -> None:
    for name in ("C0552809300R", "lor_0299140073_0x630_sci", "f1636832.fic", "N1489034146_2", "Ευρώπη-1"):
        assert safe_product_name(name) == name


def test_different_names_that_have_to_be_changed_stay_different() -> None:
    names = ["a b", "a_b", "a/b", "a\tb", "x" * 300, "x" * 301, "NUL", "nul", " ", "\t"]
    assert len({safe_product_name(name).casefold() for name in names}) == len(names)


@pytest.mark.parametrize("name", WILD)
def test_a_request_publishes_inside_its_store(name: str, tmp_path: Path) -> None:
    request = Request(image=Path("in", name.replace("\0", "\x01") + ".img"), store=tmp_path)
    assert request.product_folder.parent == tmp_path
    assert is_safe_product_name(request.product)


@pytest.mark.parametrize("name", [name for name in WILD if not is_safe_product_name(name)])
def test_a_list_refuses_names_that_are_no_folders(name: str) -> None:
    with pytest.raises(ValidationError):
        ImageEntry(product=name, image="a.img")
