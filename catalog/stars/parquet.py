"""The columns of a star catalog in Parquet: only the row groups that may hold stars of a cone are read."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from catalog.stars.columns import (
    Columns,
    check_directions,
    column_map,
    factors_of,
    in_our_units,
    numbers,
    unit_in,
)
from catalog.stars.source import Cone

MOST_STARS = 20_000_000  # that are kept in memory
NARROWER = "give --near and --cone-deg, and sort the file by declination"


def of_parquet(path: Path, given: Mapping[str, str], cone: Cone | None) -> Columns:
    """Columns of the row groups that may hold stars of a cone. given: the user's choice of columns. Raises ValueError
    where these are too many or the file is none, RefusedError as `column_map` and `check_directions`."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        with pq.ParquetFile(path) as file:
            names = column_map(file.schema_arrow.names, given, str(path))
            factors = factors_of(names, {key: unit_in(name) for key, name in names.items()}, path)
            groups = list(range(file.num_row_groups))
            if factors["ra_deg"] == factors["dec_deg"] == 1:
                groups = [number for number in groups if _may_hold(file, number, names, cone)]
            if (rows := sum(file.metadata.row_group(number).num_rows for number in groups)) > MOST_STARS:
                raise ValueError(f"{rows} stars would be read, {MOST_STARS} are the most; {NARROWER}")
            rows = file.metadata.num_rows
            table = file.read_row_groups(groups, columns=list(names.values()))
    except pa.ArrowException as error:
        raise ValueError(str(error)) from error
    columns = in_our_units(
        {key: table.column(name).to_numpy(zero_copy_only=False) for key, name in names.items()}, factors
    )
    if groups or not rows:
        check_directions(numbers(columns["ra_deg"]), numbers(columns["dec_deg"]), names, str(path))
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
