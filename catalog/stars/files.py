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
from numpy.typing import NDArray

from catalog.errors import RefusedError, WrongOptionError
from catalog.reasons import Reason
from catalog.regular_file import check_regular
from catalog.stars.columns import (
    are_directions,
    check_directions,
    column_map,
    factor_to_ours,
    looks_of,
    refuse_swapped,
    unit_in,
)
from catalog.stars.embedded import EMBEDDED
from catalog.stars.source import Cone
from catalog.stars.table import StarTable, unit_vectors

SUFFIXES = {
    ".fits": "fits", ".fit": "fits", ".fts": "fits", ".vot": "votable", ".xml": "votable", ".votable": "votable",
    ".csv": "csv", ".tsv": "csv", ".parquet": "parquet", ".pq": "parquet",
}  # fmt: skip
MAX_BYTES = 200_000_000_000
MOST_STARS = 20_000_000  # that are kept in memory
# Text files that are read whole, and VOTables at most: parsed, they take about ten times as much memory.
WHOLE_TEXT_BYTES, MOST_VOTABLE_BYTES = 100_000_000, 500_000_000
ROWS_AT_ONCE = 200_000
WIDER_SHARE, WIDER_DEG = 1.1, 1.0  # of a cone of a large CSV file: a search's later cones lie about its first one
NARROWER = "give --near and --cone-deg, and sort the file by declination"
DEFAULT_EPOCH = 2000.0
LONGEST_LINE, MOST_COMMENTS = 65_536, 1000
Columns = dict[str, NDArray[Any]]
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
            return _of_parquet(self.path, self.columns, cone)
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
        values = {key: _numbers(column) for key, column in columns.items() if key not in ("ident", "epoch")}
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
        epochs = np.unique(_numbers(columns["epoch"]))
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


def _numbers(column: Any) -> NDArray[np.float64]:
    """Numbers of a column; what is masked or empty becomes NaN."""
    if isinstance(column, np.ma.MaskedArray):
        return np.asarray(np.ma.filled(column.astype(np.float64), np.nan))
    return np.asarray(column, dtype=np.float64)


def _text(value: Any) -> str:
    return value.decode("utf-8", "replace").strip() if isinstance(value, bytes) else str(value).strip()


def _of_parquet(path: Path, given: Mapping[str, str], cone: Cone | None) -> Columns:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(path) as file:
            names = column_map(file.schema_arrow.names, given, str(path))
            factors = _factors(names, {key: unit_in(name) for key, name in names.items()}, path)
            groups = list(range(file.num_row_groups))
            if factors["ra_deg"] == factors["dec_deg"] == 1:
                groups = [number for number in groups if _may_hold(file, number, names, cone)]
            if (rows := sum(file.metadata.row_group(number).num_rows for number in groups)) > MOST_STARS:
                raise ValueError(f"{rows} stars would be read, {MOST_STARS} are the most; {NARROWER}")
            rows = file.metadata.num_rows
            table = file.read_row_groups(groups, columns=list(names.values()))
    except pa.ArrowException as error:
        raise ValueError(str(error)) from error
    columns = _in_our_units(
        {key: table.column(name).to_numpy(zero_copy_only=False) for key, name in names.items()}, factors
    )
    if groups or not rows:
        check_directions(_numbers(columns["ra_deg"]), _numbers(columns["dec_deg"]), names, str(path))
    return columns


def _may_hold(file: Any, number: int, names: Mapping[str, str], cone: Cone | None) -> bool:
    """Whether a row group may hold stars of a cone, by its statistics; true where it has none."""
    if cone is None:
        return True
    (ra_low, ra_high), (dec_low, dec_high) = _bounds(cone)
    group = file.metadata.row_group(number)
    for at in range(group.num_columns):
        column = group.column(at)
        statistics = column.statistics
        if statistics is None or not statistics.has_min_max:
            continue
        if column.path_in_schema == names["dec_deg"] and (statistics.max < dec_low or statistics.min > dec_high):
            return False
        if column.path_in_schema == names["ra_deg"]:
            # A cone over 0 degrees runs from below 0, or to above 360.
            spans = ((ra_low + turn, ra_high + turn) for turn in (-360.0, 0.0, 360.0))
            if not any(statistics.min <= high and statistics.max >= low for low, high in spans):
                return False
    return True


def _bounds(cone: Cone) -> tuple[tuple[float, float], tuple[float, float]]:
    """Limits of right ascension (which may run below 0 or above 360) and declination of a cone, degrees."""
    x, y, z = cone.axis
    ra, dec = np.degrees(np.arctan2(y, x)) % 360.0, np.degrees(np.arcsin(np.clip(z, -1, 1)))
    low, high = dec - cone.radius_deg, dec + cone.radius_deg
    if low <= -90 or high >= 90:
        return (0.0, 360.0), (max(low, -90.0), min(high, 90.0))
    half = np.degrees(np.arcsin(min(1.0, np.sin(np.radians(cone.radius_deg)) / np.cos(np.radians(dec)))))
    return (ra - half, ra + half), (low, high)


def _of_fits(path: Path, given: Mapping[str, str], cone: Cone | None) -> Columns:
    from astropy.io import fits

    with fits.open(path, memmap=True) as file:
        tables = [part for part in file if isinstance(part, fits.BinTableHDU | fits.TableHDU)]
        if not tables:
            raise ValueError("it holds no table")
        data = tables[0].data
        names = column_map(data.names, given, str(path))
        factors = _factors(names, {key: tables[0].columns[name].unit for key, name in names.items()}, path)
        chosen: Any = slice(None)
        ra, dec = (np.asarray(data[names[key]], np.float64) * factors[key] for key in ("ra_deg", "dec_deg"))
        check_directions(ra, dec, names, str(path))
        if cone is not None:
            chosen = np.flatnonzero(unit_vectors(ra, dec) @ cone.axis >= np.cos(np.radians(cone.radius_deg)))
        return _in_our_units({key: np.array(data[name][chosen]) for key, name in names.items()}, factors)


@lru_cache(maxsize=2)
def _of_text(path: Path, kind: str, given: tuple[tuple[str, str], ...], _: tuple[int, int]) -> Columns:
    """All columns of a CSV file or a VOTable; the last two files are remembered."""
    if kind == "votable":
        from astropy.io.votable import parse_single_table

        table = parse_single_table(path, verify="ignore").to_table(use_names_over_ids=True)
        names = column_map(table.colnames, dict(given), str(path))
        factors = _factors(names, {key: table[name].unit for key, name in names.items()}, path)
        columns: Columns = _in_our_units({key: np.ma.asarray(table[name]) for key, name in names.items()}, factors)
    else:
        content = _read_csv(path)
        names = column_map([str(name).strip() for name in content.columns], dict(given), str(path))
        columns = _columns_of(content, names, path)
    check_directions(_numbers(columns["ra_deg"]), _numbers(columns["dec_deg"]), names, str(path))
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


def _factors(names: Mapping[str, str], units: Mapping[str, Any], path: Path) -> dict[str, float]:
    return {key: factor_to_ours(key, units[key], name, str(path)) for key, name in names.items()}


def _in_our_units(columns: Columns, factors: Mapping[str, float]) -> Columns:
    return {key: values if factors[key] == 1 else _numbers(values) * factors[key] for key, values in columns.items()}


def _columns_of(content: Any, names: Mapping[str, str], path: Path) -> Columns:
    import pandas as pd

    content.columns = [str(name).strip() for name in content.columns]
    columns = {
        key: (content[name] if key == "ident" else pd.to_numeric(content[name], errors="coerce")).to_numpy()
        for key, name in names.items()
    }
    return _in_our_units(columns, _factors(names, {key: unit_in(name) for key, name in names.items()}, path))


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
