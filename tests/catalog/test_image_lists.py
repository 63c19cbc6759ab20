"""Image lists: what is read, what is refused and where, and that what is written is read again."""

import tomllib
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from astropy.io import fits
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from catalog.errors import RefusedError
from catalog.lists import ImageEntry, ImageList, known_lists, load_image_list, write_image_list
from catalog.lists.adding import Wanted, add_to_list, check_list
from catalog.lists.kernel_sets import expanded, known_kernel_sets
from catalog.lists.location import known_archives, parse_location
from catalog.lists.part import parse_part, part_of
from catalog.lists.tables import Row, write_table
from catalog.times import et_from_utc
from flows.cli import build_app
from flows.request import Request
from lab.simulate.europa57 import paper_images

FULL = ImageEntry(
    product="C1",
    image="pds-rings:volumes/V/a.img",
    label="https://example.org/x/a.lbl",
    camera="voyager1-nac",
    target="europa",
    utc="1979-03-04T00:00:00Z",
    exposure_s=0.18,
    filter="CLEAR",
    kernels=("voyager1-jupiter", "own/k.bsp"),
    pose_file="C1.json",
    truth_file="C1.truth.json",
    basemap="map.png",
    map_left_edge_deg=180.0,
    sha256="0" * 64,
    label_sha256="1" * 64,
    bytes=640_000,
    truth={"offset_x_px": -1.25, "law": "hapke"},
    notes='a "note", with commas',
)
BARE = ImageEntry(product="b", image="b.img")


@pytest.mark.parametrize("suffix", ["csv", "toml", "parquet"])
def test_what_is_written_is_read_again(suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"own.{suffix}"
    write_image_list(ImageList(name="own", title="t", entries=(FULL, BARE), missing=("m",)), path)
    again = load_image_list(path)
    assert again.entries == (FULL, BARE)
    assert again.located(again.entries[1].image) == tmp_path / "b.img"
    assert (again.missing == ("m",)) == (suffix == "toml")
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@given(
    titles=st.text(st.characters(exclude_categories=("Cs",)), max_size=30),
    rows=st.lists(
        st.dictionaries(
            st.text(st.characters(exclude_categories=("Cs",)), min_size=1, max_size=8),
            st.text(st.characters(exclude_categories=("Cs",)), max_size=20)
            | st.floats(allow_nan=False, allow_infinity=False)
            | st.integers(-(2**53), 2**53)
            | st.booleans()
            | st.lists(st.text("a'\"\\\x7f\n", max_size=5), max_size=3),
            max_size=5,
        ),
        max_size=4,
    ),
)
def test_any_text_survives_a_toml_list_to_which_images_can_be_added_by_hand(titles: str, rows: list[Row]) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder, "own.toml")
        write_table(path, {"title": titles}, rows)
        written = path.read_text(encoding="utf-8")
    assert tomllib.loads(written) == {"title": titles} | ({"image": rows} if rows else {})
    by_hand = '\n[[image]]\nproduct = "Z"\n'
    assert tomllib.loads(written + by_hand)["image"] == [*rows, {"product": "Z"}]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("product,image\na,a.img\na,b.img\n", "line 3 ('a'): the same product as line 2"),
        ("product,image\nA,a.img\na,b.img\n", "the same product"),
        ("product,image\na,a.img\nb,a.img\n", "the same image as line 2"),
        (f"product,image,sha256\na,a.img,{'0' * 64}\nb,b.img,{'0' * 64}\n", "the same content as line 2"),
        ("product,image\na\n", "line 2 has 1 cells"),
        ("product,image,target\na,a.img,\x1b[31mred\n", "holds control characters"),
        ("product,image,camera\na,a.img,kodak\n", "camera 'kodak' is unknown; known: cassini-nac"),
        ("product,image\n../x,a.img\n", "is no name for a folder in a store"),
        ("product,image,sha256\na,a.img,abc\n", "sha256: String should match"),
        ("product,image,bytes\na,a.img,-5\n", "bytes: Input should be greater"),
        ("product,image\na,nasa:x/y.img\n", "archive 'nasa' of 'nasa:x/y.img' is unknown; known: naif"),
        ("product,image\na,naif:../../etc/passwd\n", "no path of a file inside its archive"),
        ("product,image\na,https://user:word@host/x\n", "no URL of a file"),
        ("product,image,colour\na,a.img,red\n", "colour: Extra inputs are not permitted"),
        ("target\neuropa\n", "image: Field required"),
        ("image\na/x.img\nb/x.fits\n", "line 3: the same product as line 2"),
        ("product,product\na,b\n", "must name each column once"),
        ("", "must name each column once"),
        ('product,image\n"a,a.img\n', "cannot be read"),
        ("product,image\n\udcff,a.img\n", "cannot be read"),
    ],
)
def test_faults_name_the_file_the_row_and_the_remedy(text: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "own.csv").write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(RefusedError) as refusal:
        load_image_list(tmp_path / "own.csv")
    assert words in refusal.value.fault
    assert "own.csv" in refusal.value.fault
    assert refusal.value.remedy


def test_an_image_without_a_product_is_named_by_its_file(tmp_path: Path) -> None:
    places = ("a.img", "raw/b 1.img", "naif:x/c.1.IMG", "https://host/d.fits")
    (tmp_path / "own.csv").write_text("\n".join(["image", *places]) + "\n")
    names = [entry.product for entry in load_image_list(tmp_path / "own.csv").entries]
    assert names == ["a", Request(image=tmp_path / "b 1.img").product, "c.1", "d"]
    (tmp_path / "some.toml").write_text('[[image]]\nimage = "a.img"\n[[image]]\nproduct = "B"\nimage = "b.img"\n')
    assert [entry.product for entry in load_image_list(tmp_path / "some.toml").entries] == ["a", "B"]


def test_a_list_of_nothing_known_is_refused(tmp_path: Path) -> None:
    for name in ("nowhere", str(tmp_path / "absent.csv"), str(tmp_path)):
        with pytest.raises(RefusedError, match="image list"):
            load_image_list(name)
    (tmp_path / "a.parquet").write_bytes(b"PAR1 and no more")
    (tmp_path / "b.toml").write_text("image = 3\n")
    for name in ("a.parquet", "b.toml"):
        with pytest.raises(RefusedError, match=name):
            load_image_list(tmp_path / name)


def test_europa57_has_the_papers_images_at_places_in_archives() -> None:
    found = load_image_list("europa57")
    published = paper_images()
    assert {entry.product: entry.camera for entry in found.entries} == {n: p.camera for n, p in published.items()}
    assert Counter(str(e.camera) for e in found.entries) == {
        "newhorizons-lorri": 18, "voyager1-nac": 14, "voyager2-nac": 16, "voyager2-wac": 9
    }  # fmt: skip
    for entry in found.entries:
        assert abs(et_from_utc(str(entry.utc)) - published[entry.product].pose.et) < 2e-3
        assert parse_location(entry.image).url
        assert entry.kernels[0] in known_kernel_sets()
    places = {entry.product: entry.image for entry in found.entries}
    lorri = "NHxxLO_xxxx/NHJULO_2001/data/20070227_003484/lor_0034849319_0x630_sci.fit"
    assert places["LOR_0034849319"] == f"pds-rings:volumes/{lorri}"  # as published: the one that could be verified
    assert found.missing


def test_every_list_of_the_catalog_and_every_kernel_set_is_sound() -> None:
    for path in known_lists().values():
        assert load_image_list(path).entries
    for name in known_kernel_sets():
        assert all(parse_location(file).archive in known_archives() for file in expanded([name]))


def written(folder: Path, name: str, value: int = 0) -> Path:
    pixels = np.full((800, 800), value, np.uint8)
    hdu = fits.PrimaryHDU(pixels)
    hdu.header.update({"CAMERA": "galileo-ssi", "TARGET": "EUROPA", "DATE-OBS": "2000-05-22T23:52:05"})
    folder.mkdir(exist_ok=True)
    hdu.writeto(folder / name)
    return folder / name


def test_a_folder_is_scanned_and_duplicates_are_refused(tmp_path: Path) -> None:
    folder = tmp_path / "images"
    written(folder, "one.fits", 1)
    written(folder, "two.fits", 2)
    written(folder, "two again.fits", 2)
    (folder / "bad.fits").write_bytes((folder / "one.fits").read_bytes()[:3000])
    (folder / "notes.txt").write_text("nothing")
    added = add_to_list([folder], tmp_path / "own.csv", Wanted(target="europa"))
    assert (added.count, added.passed_over) == (2, 1)
    assert len(added.faults) == 2
    assert any("the same content" in fault for fault in added.faults)
    entry = load_image_list(tmp_path / "own.csv").entries[0]
    assert (entry.product, entry.image, entry.camera, entry.target) == (
        "one",
        "images/one.fits",
        "galileo-ssi",
        "europa",
    )
    assert check_list(tmp_path / "own.csv").faults == ()
    assert add_to_list([folder], tmp_path / "own.csv").count == 0
    (folder / "one.fits").write_bytes((folder / "two.fits").read_bytes())
    faults = check_list(tmp_path / "own.csv").faults
    assert any("is not what the list says" in fault for fault in faults)
    assert any("the same content as one" in fault for fault in faults)


def test_folders_and_files_of_strange_names_are_scanned(tmp_path: Path) -> None:
    for number, folder in enumerate(("naif:x", "$(id)", "a b", "ü")):
        written(tmp_path / folder, f"im{number}.fits", number)
    added = add_to_list([tmp_path], tmp_path / "own.csv")
    assert (added.count, added.faults) == (4, ())
    assert check_list(tmp_path / "own.csv").faults == ()


INDEX_LABEL = """PDS_VERSION_ID = PDS3
RECORD_TYPE = FIXED_LENGTH
RECORD_BYTES = {bytes}
INSTRUMENT_HOST_NAME = "VOYAGER 1"
^INDEX_TABLE = "{table}"
OBJECT = INDEX_TABLE
  ROWS = 3
  ROW_BYTES = {bytes}
{columns}
END_OBJECT = INDEX_TABLE
END
"""
COLUMNS = {
    "VOLUME_ID": 12,
    "FILE_SPECIFICATION_NAME": 34,
    "TARGET_NAME": 10,
    "INSTRUMENT_NAME": 42,
    "START_TIME": 23,
    "STOP_TIME": 23,
}
NARROW = "IMAGING SCIENCE SUBSYSTEM - NARROW ANGLE"


def index(folder: Path, table: str = "INDEX.TAB", cut: int = 0) -> Path:
    """An index of three images: Europa, Io, Europa."""
    start, described = 1, []
    for name, size in COLUMNS.items():
        described.append(
            f"  OBJECT = COLUMN\n  NAME = {name}\n  DATA_TYPE = CHARACTER\n  START_BYTE = {start}\n"
            f"  BYTES = {size}\n  END_OBJECT = COLUMN"
        )
        start += size + 1
    rows = [
        (
            "VGISS_5115",
            f"DATA/C16304XX/C16304{n}_RAW.LBL",
            target,
            NARROW,
            "1979-03-02T16:27:46.7",
            "1979-03-02T16:27:46.9",
        )
        for n, target in ((53, "EUROPA"), (54, "IO"), (55, "EUROPA"))
    ]
    lines = [
        ",".join(f'"{cell}"'.ljust(size) for cell, size in zip(row, COLUMNS.values(), strict=True)) + "\r\n"
        for row in rows
    ]
    folder.mkdir(parents=True, exist_ok=True)
    label = INDEX_LABEL.format(bytes=len(lines[0]), table=table, columns="\n".join(described))
    (folder / "index.tab").write_text("".join(lines)[: -cut or None], newline="")
    (folder / "INDEX.LBL").write_text(label)
    return folder / "INDEX.LBL"


def test_a_pds_index_becomes_a_list(tmp_path: Path) -> None:
    wanted = Wanted("europa", "voyager1-nac", "pds-rings:volumes/VGISS_5xxx", ("voyager1-jupiter",))
    added = add_to_list([index(tmp_path)], tmp_path / "own.toml", wanted)
    assert added.faults == ()
    entries = load_image_list(tmp_path / "own.toml").entries
    assert [entry.product for entry in entries] == ["C1630453_RAW", "C1630455_RAW"]
    path = "pds-rings:volumes/VGISS_5xxx/VGISS_5115/DATA/C16304XX/C1630453_RAW"
    assert (entries[0].image, entries[0].label) == (f"{path}.IMG", f"{path}.LBL")
    assert str(entries[0].utc).startswith("1979-03-02T16:27:46.800")
    assert entries[0].kernels == ("voyager1-jupiter",)


def test_an_index_of_a_volume_on_disk_names_its_files(tmp_path: Path) -> None:
    added = add_to_list([index(tmp_path / "VGISS_5115" / "INDEX")], tmp_path / "own.csv")
    assert added.count == 3
    place = added.image_list.located(added.image_list.entries[0].image)
    assert place == tmp_path / "VGISS_5115" / "DATA" / "C16304XX" / "C1630453_RAW.IMG"


def test_an_index_that_is_cut_or_points_elsewhere_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RefusedError, match=r"index\.tab: row 3 is cut off"):
        add_to_list([index(tmp_path / "cut", cut=30)], tmp_path / "own.csv")
    with pytest.raises(RefusedError, match="is not beside it"):
        add_to_list([index(tmp_path / "away", table="../../other.tab")], tmp_path / "own.csv")
    (tmp_path / "no.lbl").write_text("A = 1\nEND\n")
    with pytest.raises(RefusedError, match="points to no table"):
        add_to_list([tmp_path / "no.lbl"], tmp_path / "own.csv")
    assert not (tmp_path / "own.csv").exists()


def test_an_index_in_an_archive_is_fetched_and_added(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PLANETPOSE_ARCHIVE", str(tmp_path / "archive"))
    index(tmp_path / "mirror" / "pds-rings" / "metadata" / "VGISS_5115", table="index.tab")
    location = "pds-rings:metadata/VGISS_5115/INDEX.LBL"
    arguments = ["catalog", "add", location, "--to", str(tmp_path / "own.csv"), "--target", "europa"]
    options = ["--mirror", str(tmp_path / "mirror"), "--base", "pds-rings:volumes/VGISS_5xxx"]
    done = CliRunner().invoke(build_app(), [*arguments, *options])
    assert done.exit_code == 0, done.output
    assert len(load_image_list(tmp_path / "own.csv").entries) == 2
    assert CliRunner().invoke(build_app(), ["catalog", "add", "nasa:x/y.lbl"]).exit_code == 2


@given(st.sets(st.from_regex(r"[A-Z0-9]{1,8}", fullmatch=True), max_size=40), st.integers(1, 9))
def test_every_image_is_in_one_part_whatever_else_is_in_the_list(names: set[str], count: int) -> None:
    entries = tuple(ImageEntry(product=name, image="a.img") for name in sorted(names))
    whole = ImageList(name="list", entries=entries)
    parts = [[e.product for e in whole.part(f"{number}/{count}").entries] for number in range(1, count + 1)]
    assert sorted(product for part in parts for product in part) == sorted(names)
    half = ImageList(name="list", entries=entries[::2])
    for number, part in enumerate(parts, start=1):
        assert {e.product for e in half.part(f"{number}/{count}").entries} <= set(part)


@pytest.mark.parametrize("text", ["", "1", "0/2", "3/2", "1/0", "-1/2", "1/2/3", "a/b", "1 / 2", "01/2", "1/9999999"])
def test_what_is_no_part_is_refused_with_what_is_one(text: str) -> None:
    with pytest.raises(ValueError, match="2/4"):
        parse_part(text)


def test_parts_are_alike_on_every_machine() -> None:
    """Fixed here, for a run of another version must not do the images of another part."""
    assert [part_of(f"C{number}", 4) for number in range(8)] == [2, 4, 4, 3, 3, 2, 4, 4]
