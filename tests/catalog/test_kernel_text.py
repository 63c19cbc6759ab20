"""Text kernels and meta-kernels that SPICE would pass over in silence count, or are refused by name."""

import os
from pathlib import Path
from typing import Any

import pytest

from catalog.errors import RefusedError
from catalog.kernel_text import read_text_kernel
from catalog.spice import kernel_inputs, kernel_kind, kernel_pool, list_kernels, refuse_what_holds_no_kernel

PCK = "KPL/PCK\n\n\\begindata\nBODY999_RADII = ( 1 2 3 )\nBODY999_PM = ( 4.5D1, -6 )\n\\begintext\n"
GOOD = {"BODY999_RADII": [1.0, 2.0, 3.0], "BODY999_PM": [45.0, -6.0]}
LONG = "KPL/PCK\n\\begindata\nBODY999_RADII = ( 1 2 " + " " * 130 + "3 )\nBODY999_PM = ( 4.5D1, -6 )\n"
AS_MEANT = {
    "plain": PCK,
    "without a final end of line": PCK.rpartition("\n\\begintext")[0],
    "CRLF": PCK.replace("\n", "\r\n"),
    "CR": PCK.replace("\n", "\r"),
    "BEGINDATA in capitals": PCK.replace("begindata", "BEGINDATA"),
    "BEGINTEXT in capitals": PCK.replace("begintext", "BEGINTEXT") + "BODY999_RADII = ( 7 7 7 )\n",
    "mixed letters": PCK.replace("begindata", "BeginData"),
    "variables in small letters": PCK.replace("BODY999_RADII", "body999_radii").replace("BODY999_PM", "Body999_pm"),
    "no first word": PCK.replace("KPL/PCK\n", ""),
    "small first word": PCK.replace("KPL/PCK", "kpl/pck"),
    "a byte order mark": "\ufeff" + PCK,
    "tabs": PCK.replace(" ", "\t").replace("BODY999_PM", "\tBODY999_PM"),
    "an end-of-file mark": PCK + "\x1a",
    "a long line": LONG,
    "two parts": PCK.replace("BODY999_PM", "\\begintext\nwords = 5\n\\begindata\nBODY999_PM"),
    "appended values": PCK.replace("( 1 2 3 )", "( 1 2 )\nBODY999_RADII += 3"),
}


def pool(*paths: Path) -> dict[str, list[float]]:
    """Radii and meridian in SPICE's pool."""
    import spiceypy

    with kernel_pool(paths):
        found = {}
        for name in GOOD:
            try:
                found[name] = list(spiceypy.gdpool(name, 0, 9))
            except spiceypy.NotFoundError:
                found[name] = []
    assert spiceypy.ktotal("ALL") == 0
    return found


def written(path: Path, text: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(text.encode("utf-8"))
    return path


@pytest.mark.parametrize("text", AS_MEANT.values(), ids=AS_MEANT.keys())
@pytest.mark.parametrize("name", ["a.tpc", "a.txt"])
def test_a_text_kernel_counts_as_it_was_meant(text: str, name: str, tmp_path: Path) -> None:
    path = written(tmp_path / name, text)
    assert pool(path) == GOOD
    refuse_what_holds_no_kernel([path])


@pytest.mark.parametrize("text", [PCK, PCK.replace("\n", "\r\n"), AS_MEANT["tabs"]])
def test_what_spice_reads_whole_is_given_to_it_as_it_is(text: str, tmp_path: Path) -> None:
    path = written(tmp_path / "a.tpc", text)
    assert read_text_kernel(path).as_spice_reads
    with kernel_pool([path]) as loaded:
        assert [kernel.furnished for kernel in loaded] == [None]


@pytest.mark.parametrize(
    ("content", "reported"),
    [
        (b"KPL/PCK\nBODY999_RADII = ( 1 2 3 )\n", r"nor a text with \\begindata"),
        (b"KPL/PCK\n\\begindata now\nBODY999_RADII = ( 1 2 3 )\n", r"line 2 .*must be \\begindata and nothing else"),
        (b"KPL/PCK\n\\begindata\n\\begintext\n", "followed by no assignment"),
        (b"KPL/PCK\n\\begindata\nBODY999_RADII = ( 1 2 \n", "BODY999_RADII have no closing bracket"),
        (PCK.encode("utf-16"), "plain text"),
        (b"DAFETF NAIF DAF ENCODED TRANSFER FILE\n", "transfer format"),
        (b"", "nor a text with"),
        (bytes(range(256)) * 20, "plain text"),
        (b"KPL/PCK\n\\begindata\nA = '" + b"x" * 200 + b"'\n", "A a value of 202 characters"),
    ],
)
def test_a_text_kernel_that_loads_nothing_is_refused_by_name(content: bytes, reported: str, tmp_path: Path) -> None:
    for path in (tmp_path / "a.tpc", tmp_path / "a.kernel"):
        path.write_bytes(content)
        for use in (
            pool,
            lambda path: refuse_what_holds_no_kernel([path]),
            lambda path: kernel_inputs(list_kernels([path])),
        ):
            with pytest.raises(RefusedError, match=rf"a\.(tpc|kernel).*{reported}"):
                use(path)


def meta_text(*members: object, extra: str = "") -> str:
    names = "\n".join(f"'{member}'" for member in members)
    return f"KPL/MK\n\\begindata\n{extra}\nKERNELS_TO_LOAD = (\n{names} )\n\\begintext\n"


@pytest.mark.parametrize("name", ["m.tm", "m.txt", "m.mk", "m", "m.tpc", "m.ker"])
@pytest.mark.parametrize("first", ["KPL/MK", "kpl/mk", "comment"])
def test_a_meta_kernel_is_known_by_its_content_and_its_members_are_in_the_keys(
    name: str, first: str, tmp_path: Path
) -> None:
    member = written(tmp_path / "far" / "a.tpc", PCK)
    meta = written(tmp_path / name, meta_text(member).replace("KPL/MK", first))
    assert kernel_kind(meta) == "meta"
    assert pool(meta) == GOOD
    before = kernel_inputs(list_kernels([meta]))
    assert [kernel for kernel, _ in before] == [name, "a.tpc"]
    written(member, PCK.replace("1 2 3", "1 2 9"))
    assert kernel_inputs(list_kernels([meta]))[1] != before[1]
    assert pool(meta)["BODY999_RADII"] == [1.0, 2.0, 9.0]


def test_members_are_relative_to_the_working_folder_or_to_the_meta_kernel(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    written(tmp_path / "set" / "sub" / "a.tpc", PCK)
    meta = written(tmp_path / "set" / "m.tm", meta_text("sub/a.tpc"))
    assert pool(meta) == GOOD
    written(tmp_path / "here" / "sub" / "a.tpc", PCK.replace("1 2 3", "7 8 9"))
    monkeypatch.chdir(tmp_path / "here")
    assert pool(meta)["BODY999_RADII"] == [7.0, 8.0, 9.0]  # as SPICE has it


@pytest.mark.parametrize("relative", [False, True])
def test_symbols_and_values_that_go_on_in_the_next_are_put_together(relative: bool, tmp_path: Path) -> None:
    folder = tmp_path / ("p" * 60) / ("q" * 60)
    written(folder / "a.tpc", PCK)
    place = str(folder.relative_to(tmp_path) if relative else folder)
    parts = [place[i : i + 50] for i in range(0, len(place), 50)]
    values = "+'\n'".join(parts)
    whole = f"{place}/a.tpc"
    for text in (
        meta_text("$S/a.tpc", extra=f"PATH_VALUES = ( '{values}' )\nPATH_SYMBOLS = ( 'S' )"),
        meta_text("$DATA1/a.tpc", extra=f"PATH_VALUES = ('x', '{values}')\nPATH_SYMBOLS = ('DATA', 'DATA1')"),
        meta_text("+'\n'".join(whole[i : i + 40] for i in range(0, len(whole), 40))),
        meta_text(whole),  # one value of more than 80 characters
        f"KPL/MK\n\\begindata\nKERNELS_TO_LOAD = '{whole}'",
        f"KPL/MK\n\\begindata\nkernels_to_load += '{whole}'\n",
        f"KPL/MK\r\n\\BEGINDATA\r\nKERNELS_TO_LOAD = ( '{whole}' )\r\n",
    ):
        meta = written(tmp_path / "m.tm", text)
        if all(len(line) <= 132 or relative for line in text.splitlines()) or len(whole) <= 130:
            assert pool(meta) == GOOD, text


def test_meta_kernels_may_name_others_but_not_themselves(tmp_path: Path) -> None:
    written(tmp_path / "a.tpc", PCK)
    written(tmp_path / "inner.tm", meta_text("a.tpc"))
    outer = written(tmp_path / "outer.tm", meta_text("inner.tm"))
    assert pool(outer) == GOOD
    assert [kernel.path.name for kernel in list_kernels([outer])] == ["outer.tm", "inner.tm", "a.tpc"]
    written(tmp_path / "inner.tm", meta_text("outer.tm"))
    with pytest.raises(RefusedError, match=r"outer\.tm names itself"):
        list_kernels([outer])


def test_what_a_meta_kernel_says_beside_its_members_counts_too(tmp_path: Path) -> None:
    written(tmp_path / "a.tpc", PCK)
    both = meta_text("a.tpc", extra="BODY998_RADII = ( 4 4 4 )")
    import spiceypy

    with kernel_pool([written(tmp_path / "both.tpc", both)]):
        assert list(spiceypy.gdpool("BODY998_RADII", 0, 3)) == [4, 4, 4]
        assert list(spiceypy.gdpool("BODY999_RADII", 0, 3)) == [1, 2, 3]


@pytest.mark.parametrize("named", ["gone.tpc", "$T/a.tpc"])
def test_a_member_that_is_not_there_is_refused_with_both_names(named: str, tmp_path: Path) -> None:
    meta = written(tmp_path / "m.txt", meta_text(named))
    with pytest.raises(RefusedError, match=r"m\.txt.*(gone\.tpc is not there|symbol)"):
        list_kernels([meta])


def test_paths_longer_than_spice_takes(tmp_path: Path, data_folder: Path) -> None:
    folder = tmp_path / ("v" * 150) / ("w" * 150)
    path = written(folder / "a.tpc", PCK)
    assert len(str(path)) > 255
    assert pool(path) == GOOD
    binary: Any = next((data_folder / "kernels").rglob("*.bsp"))
    os.symlink(binary, folder / "long.bsp")
    with kernel_pool([folder / "long.bsp"]) as loaded:
        assert loaded[0].path == folder / "long.bsp"
        assert loaded[0].kind == "spk"
        import spiceypy

        assert len(spiceypy.spkobj(loaded[0].for_spice))


def test_binary_kernels_are_known_by_content(tmp_path: Path, data_folder: Path) -> None:
    for suffix, kind in ((".bsp", "spk"), (".bc", "ck")):
        original = next((data_folder / "kernels").rglob(f"*{suffix}"))
        os.symlink(original, tmp_path / f"{kind}.dat")
        assert kernel_kind(tmp_path / f"{kind}.dat") == kind == kernel_kind(original)


def meta_of(folder: Path, *names: str, file: str = "m.tm") -> Path:
    return written(folder / file, "KPL/MK\n\\begindata\nKERNELS_TO_LOAD = (" + "\n".join(names) + ")\n")


def test_a_member_s_name_may_have_letters_beyond_ascii(tmp_path: Path) -> None:
    written(tmp_path / "größe.tpc", PCK)
    assert pool(meta_of(tmp_path, "'größe.tpc'")) == GOOD


def test_a_member_that_is_no_file_is_reported_as_what_it_is(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.tpc")
    (tmp_path / "zero.tpc").symlink_to("/dev/zero")
    (tmp_path / "loop.tpc").symlink_to("loop.tpc")
    (tmp_path / "folder").mkdir()
    for name, reported in {
        "pipe.tpc": "a pipe",
        "zero.tpc": "a device",
        "loop.tpc": "links",
        "folder": "directory",
    }.items():
        with pytest.raises(RefusedError, match=f"{name} cannot be read.*{reported}"):
            list_kernels([meta_of(tmp_path, f"'{name}'")])
    endless = " ".join(["'" + "b" * 100 + "+'"] * 50)
    with pytest.raises(RefusedError, match="is not there"):
        list_kernels([meta_of(tmp_path, endless, "'.tpc'")])


def test_meta_kernels_that_name_each_other_over_and_over_end(tmp_path: Path) -> None:
    """Ten names in each of nine levels are 10^9 kernels."""
    written(tmp_path / "m9.tm", PCK)
    for level in range(9):
        meta_of(tmp_path, *[f"'m{level + 1}.tm'"] * 10, file=f"m{level}.tm")
    with pytest.raises(RefusedError, match="more than the 5300 that SPICE can load"):
        list_kernels([tmp_path / "m0.tm"])


@pytest.mark.parametrize("data", ["A" * 200_000, "A = (" + "'" * 20_001, "A = '" + "''" * 50_000, "A ( " * 50_000])
def test_damaged_text_is_not_tried_in_every_way(data: str, tmp_path: Path) -> None:
    with pytest.raises(RefusedError, match=r"m\.tm"):
        list_kernels([written(tmp_path / "m.tm", f"KPL/MK\n\\begindata\n{data}\n")])
