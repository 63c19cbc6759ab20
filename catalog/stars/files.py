"""A user's own star catalog: FITS, VOTable, CSV or Parquet, with a column map.

Of Parquet and FITS a cone reads only what it needs: row groups whose declinations (and, where the cone holds no pole,
right ascensions) may be in it, and then the columns that are used; of FITS the two columns of the directions first. CSV
and VOTable are text from end to end. Small ones are read once and remembered; a large CSV file is read in pieces of
which the cone's stars are kept, and those of a somewhat wider one for the next search; a large VOTable is refused.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from catalog.errors import RefusedError, WrongOptionError
from catalog.reasons import Reason
from catalog.regular_file import check_regular
from catalog.stars.columns import (
    Columns,
    are_directions,
    check_directions,
    column_map,
    factors_of,
    in_our_units,
    looks_of,
    numbers,
    refuse_swapped,
    unit_in,
)
from catalog.stars.embedded import EMBEDDED
from catalog.stars.parquet import MOST_STARS, NARROWER, of_parquet
from catalog.stars.source import Cone
from catalog.stars.table import StarTable, unit_vectors

SUFFIXES = {
    ".fits": "fits", ".fit": "fits", ".fts": "fits", ".vot": "votable", ".xml": "votable", ".votable": "votable",
    ".csv": "csv", ".tsv": "csv", ".parquet": "parquet", ".pq": "parquet",
}  # fmt: skip
MAX_BYTES = 200_000_000_000
# Text files that are read whole, and VOTables at most: parsed, they take about ten times as much memory.
WHOLE_TEXT_BYTES, MOST_VOTABLE_BYTES = 100_000_000, 500_000_000
ROWS_AT_ONCE = 200_000
WIDER_SHARE, WIDER_DEG = 1.1, 1.0  # of a cone of a large CSV file: a search's later cones lie about its first one
DEFAULT_EPOCH = 2000.0
LONGEST_LINE, MOST_COMMENTS = 65_536, 1000
OPTIONAL = ("pm_ra_mas", "pm_dec_mas", "parallax_mas")


@dataclass(frozen=True)
class FileCatalog:
    """A catalog in a file. columns: our names of columns (`catalog.stars.columns`) with the file's, where they are not
    among the known ones. epoch: Julian year of the directions, where no column says it; None takes 2000."""

    path: Path
    columns: Mapping[str, str] = field(default_factory=dict)
    epoch: float | None = None

    @property
    def name(self) -> str:
        """The file's name."""
        return self.path.name

    def check(self) -> None:
        """Raise RefusedError where the file is no star catalog. A CSV file that is too large to keep is not read."""
        text = SUFFIXES.get(self.path.suffix.lower()) == "csv"
        if not (text and self.path.is_file() and self.path.stat().st_size > WHOLE_TEXT_BYTES):
            self.stars(Cone(unit_vectors(0.0, 90.0), 1e-6))

    def stars(self, cone: Cone | None = None) -> StarTable:
        """Stars within a cone, or all; brightest first. Raises RefusedError naming the file, the fault, the remedy."""
        try:
            check_regular(self.path, MAX_BYTES)
            return self._table(self._read(cone), cone)
        except FileNotFoundError as error:
            fault = f"star catalog {self.path} does not exist."
            raise RefusedError(Reason.STAR_CATALOG_UNREADABLE, fault, "Give a file, or gaia or hipparcos.") from error
        except (OSError, ValueError, TypeError, KeyError, IndexError, AttributeError) as error:
            fault = f"star catalog {self.path} cannot be read: {error}."
            remedy = "Save it as FITS, VOTable, CSV or Parquet, with directions in degrees."
            raise RefusedError(Reason.STAR_CATALOG_UNREADABLE, fault, remedy) from error

    def _read(self, cone: Cone | None) -> Columns:
        kind = SUFFIXES.get(self.path.suffix.lower())
        if kind is None:
            fault = f"star catalog {self.path}: its name ends in {self.path.suffix!r}."
            raise RefusedError(Reason.STAR_CATALOG_UNREADABLE, fault, f"Known are {', '.join(SUFFIXES)}.")
        if kind == "parquet":
            return of_parquet(self.path, self.columns, cone)
        if kind == "fits":
            return _of_fits(self.path, self.columns, cone)
        stat, given = self.path.stat(), tuple(sorted(self.columns.items()))
        stamp = (stat.st_mtime_ns, stat.st_size)
        if kind == "votable" and stat.st_size > MOST_VOTABLE_BYTES:
            raise ValueError(f"a VOTable is read whole, and {stat.st_size} bytes are too many; save it as Parquet")
        if kind == "csv" and stat.st_size > WHOLE_TEXT_BYTES:
            return _pieces_of(self.path, given, stamp).within(cone)
        return _of_text(self.path, kind, given, stamp)

    def _table(self, columns: Columns, cone: Cone | None) -> StarTable:
        values = {key: numbers(column) for key, column in columns.items() if key not in ("ident", "epoch")}
        ra, dec = values["ra_deg"], values["dec_deg"]
        known = are_directions(ra, dec)
        if cone is not None:
            known &= unit_vectors(ra, dec) @ cone.axis >= np.cos(np.radians(cone.radius_deg))
        chosen = np.flatnonzero(known)
        if len(chosen) > MOST_STARS:
            raise ValueError(f"{len(chosen)} stars are more than {MOST_STARS}; {NARROWER}")
        blank = np.zeros(len(chosen))
        pm_ra, pm_dec, parallax = (np.nan_to_num(values[key][chosen]) if key in values else blank for key in OPTIONAL)
        ident = columns.get("ident")
        names = np.arange(len(ra)) if ident is None else np.asarray(ident)
        table = StarTable(
            self.name, np.array([_text(each) for each in names[chosen].tolist()], dtype=str), ra[chosen], dec[chosen],
            values["magnitude"][chosen], pm_ra, pm_dec, parallax, self._epoch(columns),
        )  # fmt: skip
        return table.by_brightness()

    def _epoch(self, columns: Columns) -> float:
        if self.epoch is not None:
            return self.epoch
        if "epoch" not in columns or not len(columns["epoch"]):
            return DEFAULT_EPOCH
        epochs = np.unique(numbers(columns["epoch"]))
        if len(epochs) != 1 or not 1800 < epochs[0] < 2200:
            raise ValueError("its column of epochs holds no single Julian year; give --epoch")
        return float(epochs[0])


def check_catalog(name_or_file: str | None) -> None:
    """Raise WrongOptionError where what is neither None nor the name of a packaged catalog is no star catalog."""
    if name_or_file and name_or_file.lower() not in EMBEDDED:
        try:
            FileCatalog(Path(name_or_file)).check()
        except RefusedError as error:
            raise WrongOptionError("stars", error.fault, error.remedy) from error


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace").strip() if isinstance(value, bytes) else str(value).strip()


def _of_fits(path: Path, given: Mapping[str, str], cone: Cone | None) -> Columns:
    from astropy.io import fits

    with fits.open(path, memmap=True) as file:
        tables = [part for part in file if isinstance(part, fits.BinTableHDU | fits.TableHDU)]
        if not tables:
            raise ValueError("it holds no table")
        data = tables[0].data
        names = column_map(data.names, given, str(path))
        factors = factors_of(names, {key: tables[0].columns[name].unit for key, name in names.items()}, path)
        chosen: Any = slice(None)
        ra, dec = (np.asarray(data[names[key]], np.float64) * factors[key] for key in ("ra_deg", "dec_deg"))
        check_directions(ra, dec, names, str(path))
        if cone is not None:
            chosen = np.flatnonzero(unit_vectors(ra, dec) @ cone.axis >= np.cos(np.radians(cone.radius_deg)))
        return in_our_units({key: np.array(data[name][chosen]) for key, name in names.items()}, factors)


@lru_cache(maxsize=2)
def _of_text(path: Path, kind: str, given: tuple[tuple[str, str], ...], _: tuple[int, int]) -> Columns:
    """All columns of a CSV file or a VOTable; the last two files are remembered."""
    if kind == "votable":
        from astropy.io.votable import parse_single_table

        table = parse_single_table(path, verify="ignore").to_table(use_names_over_ids=True)
        names = column_map(table.colnames, dict(given), str(path))
        factors = factors_of(names, {key: table[name].unit for key, name in names.items()}, path)
        columns: Columns = in_our_units({key: np.ma.asarray(table[name]) for key, name in names.items()}, factors)
    else:
        content = _read_csv(path)
        names = column_map([str(name).strip() for name in content.columns], dict(given), str(path))
        columns = _columns_of(content, names, path)
    check_directions(numbers(columns["ra_deg"]), numbers(columns["dec_deg"]), names, str(path))
    return columns


def _read_csv(path: Path, **more: Any) -> Any:
    """A data frame, or with `chunksize` an iterator of such."""
    import pandas as pd

    return pd.read_csv(path, sep=_separator(path), comment="#", skipinitialspace=True, **more)


def _separator(path: Path) -> str:
    """What is between the names of the first line: a comma, or else a tab, semicolon or bar."""
    with path.open(encoding="utf-8", errors="replace") as file:
        lines = (file.readline(LONGEST_LINE) for _ in range(MOST_COMMENTS))
        first = next((line for line in lines if line.strip() and not line.startswith("#")), "")
    return next((each for each in ",\t;|" if each in first), ",")


def _columns_of(content: Any, names: Mapping[str, str], path: Path) -> Columns:
    import pandas as pd

    content.columns = [str(name).strip() for name in content.columns]
    columns = {
        key: (content[name] if key == "ident" else pd.to_numeric(content[name], errors="coerce")).to_numpy()
        for key, name in names.items()
    }
    return in_our_units(columns, factors_of(names, {key: unit_in(name) for key, name in names.items()}, path))


@dataclass
class _Pieces:
    """A large CSV file, read piece by piece for a cone. last: the cone that was read last, and its stars."""

    path: Path
    given: Mapping[str, str]
    last: tuple[Cone | None, Columns] | None = None

    def within(self, cone: Cone | None) -> Columns:
        """Stars of a cone at least, or all. Raises ValueError where those are more than may be kept."""
        if self.last is None or not _holds(self.last[0], cone):
            wider = cone and Cone(cone.axis, min(cone.radius_deg * WIDER_SHARE + WIDER_DEG, 180.0))
            self.last = (wider, self._read(wider))
        return self.last[1]

    def _read(self, cone: Cone | None) -> Columns:
        head = [str(name) for name in _read_csv(self.path, nrows=0).columns]
        names = column_map([name.strip() for name in head], self.given, str(self.path))
        used = [name for name in head if name.strip() in names.values()]
        kept: list[Columns] = []
        rows = stars = directions_known = 0
        beyond_90, all_within_90 = False, True
        with _read_csv(self.path, usecols=used, chunksize=ROWS_AT_ONCE) as pieces:
            for piece in pieces:
                count, columns = len(piece), _columns_of(piece, names, self.path)
                # Stars without a name have the number of their row.
                columns.setdefault("ident", np.arange(rows, rows + count))
                rows += count
                directions_known += int(are_directions(columns["ra_deg"], columns["dec_deg"]).sum())
                beyond, within = looks_of(columns["ra_deg"], columns["dec_deg"])
                beyond_90, all_within_90 = beyond_90 or beyond, all_within_90 and within
                inside = np.ones(count, bool)
                if cone is not None:
                    directions = unit_vectors(columns["ra_deg"], columns["dec_deg"])
                    inside = directions @ cone.axis >= np.cos(np.radians(cone.radius_deg))
                kept.append({key: column[inside] for key, column in columns.items()})
                stars += int(inside.sum())
                if stars > MOST_STARS:
                    raise ValueError(f"more than {MOST_STARS} stars are in it; give --near and --cone-deg")
        refuse_swapped(beyond_90, all_within_90, names, str(self.path))
        if not directions_known:
            check_directions(np.full(rows, np.nan), np.full(rows, np.nan), names, str(self.path))
        return {key: np.concatenate([piece[key] for piece in kept]) for key in kept[0]}


def _holds(whole: Cone | None, part: Cone | None) -> bool:
    """Whether a cone, or the sky, holds another."""
    if whole is None or part is None:
        return whole is None
    apart = np.degrees(np.arccos(np.clip(whole.axis @ part.axis, -1, 1)))
    return bool(apart + part.radius_deg <= whole.radius_deg or whole.radius_deg >= 180)


@lru_cache(maxsize=2)
def _pieces_of(path: Path, given: tuple[tuple[str, str], ...], _: tuple[int, int]) -> _Pieces:
    """The last two large CSV files are remembered."""
    return _Pieces(path, dict(given))
