"""Astrometry of a store: its observations, and the files astrometry.csv, .vot, .ades.xml and .png, and stars.csv."""

import csv
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from catalog.errors import RefusedError
from catalog.plain_text import printable
from catalog.reasons import Reason
from catalog.spice import kernel_pool
from tasks.astrometry.ades import ades_of
from tasks.astrometry.observation import COLUMNS, STAR_COLUMNS, BodyObservation, Row, observation_in
from tasks.astrometry.picture import draw_observed_less_computed
from tasks.atomic import file_put_in_place
from tasks.boundary import reason_of, trouble_of
from tasks.publish.check import products_in
from tasks.publish.cube import software_version

TABLE, VOTABLE, ADES, STARS = "astrometry.csv", "astrometry.vot", "astrometry.ades.xml", "stars.csv"
PICTURE = "astrometry.png"


def write_astrometry(
    store: Path, out: Path, kernels: Sequence[Path], station: str | None = None
) -> tuple[list[Row], dict[str, str], list[Path]]:
    """Rows of all products of a store whose camera is known by stars, why others are left out, and the files written.

    kernels: whose ephemerides O-C is against; without any that cover an image, against the pose that it was predicted
    with. Raises RefusedError when no product has stars."""
    observations: list[BodyObservation] = []
    left_out: dict[str, str] = {}
    with kernel_pool(kernels) as loaded:

        def read(folder: Path) -> None:
            observations.append(observation_in(folder, loaded))

        for folder in products_in(store):
            error = trouble_of(partial(read, folder), folder.name)
            if error is not None:
                left_out[printable(folder.name)] = reason_of(error)
        if not observations:
            why = f"{store} holds no image with stars ({len(left_out)} others)."
            raise RefusedError(Reason.STARS_NOT_IDENTIFIED, why, "Correct images with `planetpose correct --stars`.")
        document = ades_of(observations, loaded, station, software_version())
    rows = [each.row for each in observations]
    out.mkdir(parents=True, exist_ok=True)
    for name, write in (
        (TABLE, partial(_write_csv, tuple(COLUMNS), rows)),
        (VOTABLE, partial(_write_votable, rows)),
        (ADES, partial(_write_bytes, document)),
        (STARS, partial(_write_csv, STAR_COLUMNS, star_rows(observations))),
        (PICTURE, partial(draw_observed_less_computed, rows)),
    ):
        with file_put_in_place(out / name) as temporary:
            write(temporary)
    return rows, left_out, [out / name for name in (TABLE, VOTABLE, ADES, STARS, PICTURE)]


def star_rows(observations: Sequence[BodyObservation]) -> list[Row]:
    """The identified stars of all images."""
    return [
        {"image": each.exposure.product} | {name: star[name] for name in STAR_COLUMNS[1:]}
        for each in observations
        for star in each.stars["matches"]
    ]


def _write_csv(columns: Sequence[str], rows: Sequence[Row], path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _write_votable(rows: Sequence[Row], path: Path) -> None:
    import numpy as np
    from astropy.io.votable import from_table
    from astropy.table import MaskedColumn, Table

    table = Table()
    for name, (unit, meaning) in COLUMNS.items():
        values = [row[name] for row in rows]
        is_text = any(isinstance(value, str) for value in values)
        data = [("" if is_text else np.nan) if value is None else value for value in values]
        table[name] = MaskedColumn(data, unit=unit, description=meaning, mask=[value is None for value in values])
    document = from_table(table)
    document.description = f"Directions of bodies from spacecraft by stars, planetpose {software_version()}"
    document.to_xml(str(path))


def _write_bytes(content: bytes, path: Path) -> None:
    path.write_bytes(content)
