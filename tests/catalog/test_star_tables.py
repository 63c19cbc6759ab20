"""Star tables: motion to an epoch and aberration against astropy and erfa, packaged catalogs, and users' files."""

from pathlib import Path
from typing import Any

import astropy.units as u
import erfa
import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from astropy.coordinates import Distance, SkyCoord
from astropy.table import Table
from astropy.time import Time

from catalog.errors import RefusedError
from catalog.stars.embedded import embedded_stars
from catalog.stars.files import FileCatalog
from catalog.stars.source import Cone, EmbeddedCatalog
from catalog.stars.table import StarTable, aberrated, ra_dec_deg, unit_vectors

MAS_DEG = 1 / 3.6e6


def table_of(ra: Any, dec: Any, pm_ra: Any = 0.0, pm_dec: Any = 0.0, epoch: float = 2016.0) -> StarTable:
    ra = np.atleast_1d(np.asarray(ra, float))
    full = [np.broadcast_to(np.asarray(each, float), ra.shape).copy() for each in (dec, 9.0, pm_ra, pm_dec, 0.0)]
    return StarTable("t", np.arange(len(ra)).astype(str), ra, full[0], full[1], full[2], full[3], full[4], epoch)


def test_motion_to_an_epoch_is_astropys() -> None:
    random = np.random.default_rng(1)
    ra, dec = random.uniform(0, 360, 50), random.uniform(-85, 85, 50)
    motion = random.normal(0, 500, (2, 50))
    ours = table_of(ra, dec, *motion).directions(1979.5)
    stars = SkyCoord(
        ra * u.deg, dec * u.deg, pm_ra_cosdec=motion[0] * u.mas / u.yr, pm_dec=motion[1] * u.mas / u.yr,
        distance=Distance(np.full(50, 1e5) * u.pc), obstime=Time(2016.0, format="jyear", scale="tdb"),
    )  # fmt: skip
    moved = stars.apply_space_motion(new_obstime=Time(1979.5, format="jyear", scale="tdb"))
    theirs = unit_vectors(moved.ra.deg, moved.dec.deg)
    assert np.degrees(np.linalg.norm(ours - theirs, axis=1)).max() < 0.1 * MAS_DEG


@pytest.mark.parametrize("velocity", [(30.0, -12.0, 5.0), (0.0, 0.0, 60.0)])
def test_aberration_is_erfas(velocity: tuple[float, float, float]) -> None:
    random = np.random.default_rng(2)
    directions = unit_vectors(random.uniform(0, 360, 40), random.uniform(-90, 90, 40))
    beta = np.array(velocity) / 299792.458
    theirs = erfa.ab(directions, beta, 1e9, float(np.sqrt(1 - beta @ beta)))
    off = np.linalg.norm(aberrated(directions, np.array(velocity)) - theirs, axis=1)
    assert np.degrees(off).max() < 1e-3 * MAS_DEG


def test_a_parallax_moves_a_star_away_from_the_observers_side() -> None:
    near = table_of(0.0, 0.0)
    near = StarTable(*(getattr(near, name) for name in ("name", "ident", "ra_deg", "dec_deg", "magnitude")),
                     near.pm_ra_mas, near.pm_dec_mas, np.array([768.0]), 2016.0)  # fmt: skip
    seen = near.directions(2016.0, [0.0, 45 * 149597870.7, 0.0])  # Proxima from New Horizons' distance
    assert ra_dec_deg(seen[0])[0] == pytest.approx(360 - 45 * 768 / 3.6e6, abs=1e-7)


def test_the_packaged_catalogs_hold_the_same_sky() -> None:
    gaia, hipparcos = embedded_stars("gaia"), embedded_stars("hipparcos")
    assert (len(gaia), len(hipparcos)) == (482_176, 117_955)
    assert gaia.ident[0] == "HIP 32349"  # Sirius, first by brightness
    sirius = hipparcos.only(hipparcos.ident == "HIP 32349")
    apart = np.degrees(np.linalg.norm(sirius.directions(2016.0) - gaia.only(np.array([0])).directions(2016.0)))
    assert apart < 1 / 3600
    assert (np.diff(gaia.magnitude) >= 0).all()


ROWS = {
    "RA_ICRS": [10.0, 10.2, 200.0, 359.9, 11.0],
    "DE_ICRS": [-5.0, -5.1, 40.0, 0.1, -5.3],
    "Gmag": [9.0, 7.0, 5.0, 6.0, 12.0],
    "pmRA": [100.0, np.nan, 0.0, 0.0, 1.0],
    "Source": ["a", "b", "c", "d", "e"],
}


def written(folder: Path, suffix: str) -> Path:
    path = folder / f"stars{suffix}"
    frame = pd.DataFrame(ROWS)
    if suffix == ".csv":
        frame.to_csv(path, index=False)
    elif suffix == ".parquet":
        frame.to_parquet(path, index=False)
    else:
        Table.from_pandas(frame).write(path, format="votable" if suffix == ".vot" else "fits")
    return path


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".fits", ".vot"])
def test_a_users_file_of_any_kind_gives_the_same_cone(tmp_path: Path, suffix: str) -> None:
    catalog = FileCatalog(written(tmp_path, suffix), epoch=2015.5)
    found = catalog.stars(Cone(unit_vectors(10.1, -5.0), 1.0))
    assert found.ident.tolist() == ["b", "a", "e"]
    assert found.pm_ra_mas.tolist() == [0.0, 100.0, 1.0]
    assert found.epoch == 2015.5
    assert catalog.stars(Cone(unit_vectors(0.0, 0.0), 0.5)).ident.tolist() == ["d"]
    assert len(catalog.stars()) == 5


UNITS = {"RA_ICRS": ("rad", np.pi / 180), "DE_ICRS": ("arcmin", 60.0), "pmRA": ("arcsec / yr", 1e-3)}


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".fits", ".vot"])
def test_columns_in_other_units_are_converted(tmp_path: Path, suffix: str) -> None:
    """Units from TUNIT, a VOTable's fields, or the header of the column."""
    frame = Table.from_pandas(pd.DataFrame(ROWS))
    for name, (unit, factor) in UNITS.items():
        frame[name] = np.asarray(np.ma.filled(frame[name], np.nan)) * factor
        frame[name].unit = unit
    path = tmp_path / f"units{suffix}"
    if suffix in (".csv", ".parquet"):
        named = pd.DataFrame({f"{name} [{UNITS[name][0]}]" if name in UNITS else name: frame[name] for name in ROWS})
        named.to_csv(path, index=False) if suffix == ".csv" else named.to_parquet(path, index=False)
    else:
        frame.write(path, format="votable" if suffix == ".vot" else "fits")
    found = FileCatalog(path).stars(Cone(unit_vectors(10.1, -5.0), 1.0))
    assert found.ident.tolist() == ["b", "a", "e"]
    assert found.ra_deg == pytest.approx([10.2, 10.0, 11.0])
    assert found.dec_deg == pytest.approx([-5.1, -5.0, -5.3])
    assert found.pm_ra_mas == pytest.approx([0.0, 100.0, 1.0])


def test_hours_of_right_ascension_are_converted_and_what_does_not_convert_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "hours.csv"
    path.write_text("ra (h),dec (deg),mag\n2.0,5,6\n")
    assert FileCatalog(path).stars().ra_deg == pytest.approx([30.0])
    for head, fault in (("ra,dec (Jy),mag", "dec .Jy. is in 'Jy'"), ("ra,dec,mag (km)", "does not convert to mag"),
                        ("ra [furlong],dec,mag", "'furlong'")):  # fmt: skip
        path = tmp_path / f"bad{len(head)}.csv"
        path.write_text(f"{head}\n2.0,5,6\n")
        with pytest.raises(RefusedError, match=fault):
            FileCatalog(path).stars()


@pytest.mark.parametrize("large", [False, True])
def test_swapped_columns_are_refused(tmp_path: Path, large: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    if large:
        monkeypatch.setattr("catalog.stars.files.WHOLE_TEXT_BYTES", 1)
    path = tmp_path / "swapped.csv"
    path.write_text("ra,dec,mag\n-10,200,5\n20,40,6\n")
    with pytest.raises(RefusedError, match=r"were swapped.*ra_deg=dec,dec_deg=ra"):
        FileCatalog(path).stars()
    right = FileCatalog(path, {"ra_deg": "dec", "dec_deg": "ra"}).stars()
    assert right.ra_deg.tolist() == [200.0, 40.0]


def test_columns_of_other_names_are_mapped_and_missing_ones_named(tmp_path: Path) -> None:
    path = tmp_path / "own.csv"
    path.write_text("alpha,delta,brightness\n1,2,3\n")
    with pytest.raises(RefusedError, match=r"no column that is known as ra_deg, dec_deg, magnitude.*--columns"):
        FileCatalog(path).stars()
    mapped = FileCatalog(path, {"ra_deg": "alpha", "dec_deg": "delta", "magnitude": "brightness"})
    assert mapped.stars().ra_deg.tolist() == [1.0]
    with pytest.raises(RefusedError, match="has no column beta"):
        FileCatalog(path, {"dec_deg": "beta"}).stars()


@pytest.mark.parametrize(
    ("name", "content", "fault"),
    [("a.parquet", b"PAR1nonsense", "cannot be read"), ("a.fits", b"nonsense", "cannot be read"),
     ("a.vot", b"<x>", "cannot be read"), ("a.txt", b"1 2 3", "its name ends in '.txt'"),
     ("a.csv", b"", "cannot be read")],
)  # fmt: skip
def test_what_is_no_catalog_is_refused_by_name(tmp_path: Path, name: str, content: bytes, fault: str) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(RefusedError, match=fault) as refused:
        FileCatalog(path).stars()
    assert name in refused.value.fault


@pytest.mark.parametrize(
    ("content", "columns", "fault"),
    [("ra,dec,mag\n", {}, "holds no stars"),
     ("ra,dec,mag\n01:02:03,-4:05:06,7\n", {}, "none of its 1 rows has a direction in decimal degrees in ra and dec"),
     ("ra,dec,mag\n170,200,7\n", {}, "none of its 1 rows"),
     ("1.5,2.5,3\n4,5,6\n", {}, "has no names of columns: its first line is 1.5, 2.5, 3"),
     ("ra,dec,mag\n1,2,3\n", {"ra_deg": "mag"}, "magnitude and ra_deg are both mag|ra_deg and magnitude are both mag")],
)  # fmt: skip
@pytest.mark.parametrize("large", [False, True])
def test_a_catalog_without_directions_is_refused_and_says_why(
    tmp_path: Path, content: str, columns: dict[str, str], fault: str, large: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if large:
        monkeypatch.setattr("catalog.stars.files.WHOLE_TEXT_BYTES", 0)
    path = tmp_path / "own.csv"
    path.write_text(content)
    with pytest.raises(RefusedError, match=fault):
        FileCatalog(path, columns).stars(Cone(unit_vectors(1.0, 2.0), 5.0))


@pytest.mark.parametrize("separator", [";", "\t", "|", ","])
def test_a_text_file_may_have_other_separators(tmp_path: Path, separator: str) -> None:
    path = tmp_path / "own.csv"
    path.write_text(
        "# made by hand\n" + "\n".join(separator.join(row) for row in (["ra", "dec", "mag"], ["1", "2", "3"]))
    )
    assert FileCatalog(path).stars().dec_deg.tolist() == [2.0]


def test_a_missing_catalog_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RefusedError, match="does not exist"):
        FileCatalog(tmp_path / "none.csv").stars()


def test_a_cone_reads_only_the_row_groups_that_may_hold_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    dec = np.linspace(-89.5, 89.5, 1800)
    frame = pd.DataFrame({"ra": np.tile([1.0, 359.0], 900), "dec": dec, "mag": 8.0})
    frame.to_parquet(tmp_path / "sky.parquet", index=False, row_group_size=100)
    read: list[int] = []
    whole = pq.ParquetFile.read_row_groups

    def counted(self: Any, groups: list[int], **more: Any) -> Any:
        read.extend(groups)
        return whole(self, groups, **more)

    monkeypatch.setattr(pq.ParquetFile, "read_row_groups", counted)
    cone = Cone(unit_vectors(0.0, 30.0), 2.0)
    found = FileCatalog(tmp_path / "sky.parquet").stars(cone)
    expected = unit_vectors(frame["ra"], frame["dec"]) @ cone.axis >= np.cos(np.radians(2.0))
    assert len(found) == expected.sum() > 10
    assert read in ([11], [11, 12])


@pytest.mark.parametrize("suffix", [".csv", ".tsv"])
def test_a_large_csv_file_is_read_in_pieces_and_gives_the_same_cones(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str
) -> None:
    random, path = np.random.default_rng(3), tmp_path / f"sky{suffix}"
    frame = pd.DataFrame(
        {" ra": random.uniform(0, 360, 5000), "dec": np.degrees(np.arcsin(random.uniform(-1, 1, 5000))), "mag": 8.0}
    )
    frame.to_csv(path, index=False, sep="\t" if suffix == ".tsv" else ",")
    cones = [Cone(unit_vectors(0.0, 80.0), 20.0), Cone(unit_vectors(10.0, 75.0), 5.0), Cone(unit_vectors(90.0, 0.0), 9)]
    whole = [FileCatalog(path).stars(cone) for cone in [*cones, None]]
    monkeypatch.setattr("catalog.stars.files.WHOLE_TEXT_BYTES", 100)
    monkeypatch.setattr("catalog.stars.files.ROWS_AT_ONCE", 700)
    reads, read = [], pd.read_csv

    def counted(*arguments: Any, **more: Any) -> Any:
        reads.append(more.get("chunksize"))
        return read(*arguments, **more)

    monkeypatch.setattr(pd, "read_csv", counted)
    pieces = [FileCatalog(path).stars(cone) for cone in [*cones, None]]
    for one, other in zip(whole, pieces, strict=True):
        assert len(one) > 5
        assert sorted(one.ident) == sorted(other.ident)
        assert sorted(one.ra_deg) == sorted(other.ra_deg)
    # The second cone lies in what was read for the first one.
    assert reads == [None, 700] * 3


def test_stars_of_a_large_csv_file_are_bounded_and_a_large_votable_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("catalog.stars.files.WHOLE_TEXT_BYTES", 10)
    monkeypatch.setattr("catalog.stars.files.MOST_STARS", 3)
    catalog = FileCatalog(written(tmp_path, ".csv"))
    with pytest.raises(RefusedError, match=r"more than 3 stars are in it; give --near and --cone-deg"):
        catalog.stars()
    assert catalog.stars(Cone(unit_vectors(10.1, -5.0), 0.2)).ident.tolist() == ["b", "a"]
    monkeypatch.setattr("catalog.stars.files.MOST_VOTABLE_BYTES", 100)
    with pytest.raises(RefusedError, match=r"a VOTable is read whole.*save it as Parquet"):
        FileCatalog(written(tmp_path, ".vot")).stars()


def test_a_catalog_that_is_too_large_is_not_read_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("catalog.stars.parquet.MOST_STARS", 3)
    catalog = FileCatalog(written(tmp_path, ".parquet"))
    monkeypatch.setattr(pq.ParquetFile, "read_row_groups", None)  # would be a TypeError
    with pytest.raises(RefusedError, match=r"5 stars would be read, 3 are the most; give --near"):
        catalog.stars()


def test_a_cone_of_a_packaged_catalog_has_its_radius() -> None:
    found = EmbeddedCatalog("gaia").stars(Cone(unit_vectors(325.5, -12.2), 1.0))
    inside = unit_vectors(found.ra_deg, found.dec_deg) @ unit_vectors(325.5, -12.2)
    assert len(found) == pytest.approx(30, abs=12)
    assert inside.min() >= np.cos(np.radians(1.0))
