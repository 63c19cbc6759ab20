"""The kernels of keys and provenance are those that SPICE has loaded, by its own list, and by what is in them."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import spiceypy

from catalog.errors import RefusedError
from catalog.spice import Kernel, kernel_inputs, kernel_pool, list_kernels

SUFFIXES = (".tm", ".TM", ".Tm", ".mk", ".txt", ".ker", "")
WAYS = ("absolute", "beside", "working folder", "symbol", "in pieces", "dotted")


@pytest.fixture(autouse=True)
def empty_pool() -> Iterator[None]:
    spiceypy.kclear()
    yield
    spiceypy.kclear()


@pytest.fixture
def kernels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Three text kernels; each says a variable of its own, and adds itself to one of all."""
    folder = tmp_path / "some folder"
    folder.mkdir()
    monkeypatch.chdir(tmp_path)
    paths = [folder / name for name in ("a.tpc", "B.TPC", "c.Tls")]
    for number, path in enumerate(paths):
        path.write_text(f"KPL/PCK\n\\begindata\nMARK{number} = 1\nMARKS += {number}\n\\begintext\n")
    return paths


def meta(path: Path, members: list[Path], way: str = "absolute", word: str = "begindata") -> Path:
    """A meta-kernel that names its members in one of the ways."""
    symbols, names = "", [str(member) for member in members]
    if way == "beside":
        names = [str(member.relative_to(path.parent)) for member in members]
    elif way == "working folder":
        names = [str(member.relative_to(Path.cwd())) for member in members]
    elif way == "symbol":
        symbols = f"PATH_VALUES = ( '{members[0].parent}' )\nPATH_SYMBOLS = ( 'KERNELS' )\n"
        names = [f"$KERNELS/{member.name}" for member in members]
    elif way == "dotted":
        names = [f"{member.parent}/../{member.parent.name}/./{member.name}" for member in members]
    pieces = [[name[i : i + 30] for i in range(0, len(name), 30)] if way == "in pieces" else [name] for name in names]
    lines = "\n".join(f"'{part}{'+' if i + 1 < len(each) else ''}'" for each in pieces for i, part in enumerate(each))
    path.write_text(f"KPL/MK\n\\{word}\n{symbols}KERNELS_TO_LOAD = (\n{lines}\n)\n\\begintext\n")
    return path


def check(given: list[Path], expected: list[int]) -> list[Kernel]:
    """What SPICE has of the variables, its own list, the list for the key and the one for the provenance agree."""
    listed = list_kernels(given)
    with kernel_pool(given) as loaded:
        assert list(spiceypy.gdpool("MARKS", 0, 99)) == expected
        held = [Path(spiceypy.kdata(number, "ALL")[0]) for number in range(spiceypy.ktotal("ALL"))]
        files = [kernel for kernel in loaded if kernel.kind != "meta"]
        assert [Path(kernel.for_spice) for kernel in files] == held
        assert [int(spiceypy.gdpool("MARKS", place, 1)[0]) for place in range(len(files))] == expected
        assert kernel_inputs(loaded) == kernel_inputs(listed)
        assert [kernel.provenance()["name"] for kernel in loaded] == [name for name, _ in kernel_inputs(listed)]
    return listed


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("way", WAYS)
def test_a_meta_kernels_members_count_however_it_is_called_and_names_them(
    kernels: list[Path], way: str, suffix: str
) -> None:
    path = meta(kernels[0].parent / f"set{suffix}", kernels, way)
    listed = check([path], [0, 1, 2])
    assert [kernel.path.name for kernel in listed] == [path.name, *(kernel.name for kernel in kernels)]


@pytest.mark.parametrize("word", ["begindata", "BEGINDATA", "BeginData"])
def test_nested_ones_and_kernels_named_twice_count_as_spice_has_them(kernels: list[Path], word: str) -> None:
    a, b, c = kernels
    inner = meta(a.parent / "inner.txt", [b, c], "beside", word)
    outer = meta(a.parent.parent / "outer.tm", [a, inner, a], word=word)
    listed = check([outer], [0, 1, 2, 0])
    assert [k.path.name for k in listed] == ["outer.tm", "a.tpc", "inner.txt", "B.TPC", "c.Tls", "a.tpc"]
    check([b, outer, c], [1, 2, 0, 1, 2, 0])  # meta-kernels come last


@pytest.mark.parametrize("way", ["working folder", "in pieces"])
def test_plain_spice_loads_the_same_from_a_meta_kernel(kernels: list[Path], way: str) -> None:
    """In two ways that SPICE itself knows, whose texts stay within its 80 characters."""
    path = meta(kernels[0].parent / "set.tm", kernels, way)
    spiceypy.furnsh(str(path))
    held = [spiceypy.kdata(number, "ALL")[:2] for number in range(spiceypy.ktotal("ALL"))]
    spiceypy.kclear()
    by_spice = [Path(name).resolve() for name, kind in held if kind != "META"]
    assert [kernel.path.resolve() for kernel in list_kernels([path]) if kernel.kind != "meta"] == by_spice


@pytest.mark.parametrize("fault", ["lost", "another", "more"])
def test_where_spice_has_other_kernels_than_the_key_says_nothing_is_computed(
    kernels: list[Path], monkeypatch: pytest.MonkeyPatch, fault: str
) -> None:
    ours = spiceypy.furnsh

    def furnish(path: str) -> None:
        if path.endswith("B.TPC"):
            if fault == "another":
                ours(str(kernels[2]))
            if fault != "more":
                return
            ours(str(kernels[2]))
        ours(path)

    monkeypatch.setattr(spiceypy, "furnsh", furnish)
    with (
        pytest.raises(RefusedError, match=r"SPICE has loaded .* in place of kernel .*B\.TPC"),
        kernel_pool(kernels[:2]),
    ):
        pass
    assert spiceypy.ktotal("ALL") == 0
