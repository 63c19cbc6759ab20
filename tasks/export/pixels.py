"""Pixels as a table, one row each, for photometry."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from catalog.errors import RefusedError
from catalog.observation import UNUSABLE, Quality
from catalog.reasons import Reason
from tasks.atomic import file_put_in_place
from tasks.export.outlines import Outline
from tasks.export.source import Source

if TYPE_CHECKING:
    import pandas as pd

PLANES = (
    "image", "latitude", "longitude", "incidence", "emission", "phase", "range_km", "resolution_km",
    "latitude_uncertainty", "longitude_uncertainty", "quality",
)  # fmt: skip
NOT_FOR_PHOTOMETRY = UNUSABLE | Quality.OFF_BODY | Quality.NIGHT_SIDE | Quality.LIMB | Quality.ECLIPSED
DIGITS = "%.7g"


@dataclass(frozen=True)
class Selection:
    """Which pixels: inclusive limits in degrees. longitude_deg may run through 0: (350, 10). With `every_flag` pixels
    are kept whatever their flags say, as long as they see the body. outline: which of them, beside those limits."""

    latitude_deg: tuple[float, float] = (-90.0, 90.0)
    longitude_deg: tuple[float, float] = (0.0, 360.0)
    max_incidence_deg: float = 90.0
    max_emission_deg: float = 90.0
    every_flag: bool = False
    outline: Outline | None = None


def pixel_table(source: Source, selection: Selection | None = None) -> "pd.DataFrame":
    """Rows of the selected pixels: product, x, y, and the planes of the cube."""
    import pandas as pd

    chosen = selection or Selection()
    cube = source.cube
    latitude, longitude = cube["latitude"].values, cube["longitude"].values
    west, east = chosen.longitude_deg
    whole = abs(east - west) >= 360
    banned = Quality.OFF_BODY if chosen.every_flag else NOT_FOR_PHOTOMETRY
    with np.errstate(invalid="ignore"):
        kept = (cube["quality"].values & np.uint16(banned)) == 0
        kept &= (latitude >= chosen.latitude_deg[0]) & (latitude <= chosen.latitude_deg[1])
        kept &= whole | (np.mod(longitude - west, 360.0) <= np.mod(east - west, 360.0))
        kept &= chosen.every_flag | (cube["incidence"].values <= chosen.max_incidence_deg)
        kept &= cube["emission"].values <= chosen.max_emission_deg
    y, x = np.nonzero(kept)
    if chosen.outline is not None:
        inside = chosen.outline.contains(latitude[y, x], longitude[y, x])
        y, x = y[inside], x[inside]
    columns = {name: cube[name].values[y, x] for name in PLANES}
    table = pd.DataFrame({"product": source.product, "x": x.astype(np.int32), "y": y.astype(np.int32), **columns})
    return table.astype({"product": "category"})


def write_table(table: "pd.DataFrame", path: Path) -> Path:
    """Write CSV or Parquet, by the path's suffix, and return it. Raises RefusedError when nothing was selected."""
    if table.empty:
        raise RefusedError(Reason.NO_PIXELS, f"no pixels for {path.name} are within the limits.", "Widen the limits.")
    with file_put_in_place(path) as temporary:
        if path.suffix == ".parquet":
            table.to_parquet(temporary, index=False)
        else:
            table.to_csv(temporary, index=False, float_format=DIGITS)
    return path
