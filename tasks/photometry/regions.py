"""The regions that a phase function is fitted to, and what came of each."""

import csv
import io
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from catalog.errors import RefusedError, WrongOptionError
from catalog.reasons import Reason
from catalog.regular_file import read_regular_text
from tasks.export.outlines import Outline, read_outlines
from tasks.export.pixels import Selection
from tasks.photometry.each_image import ImageLimbWeight
from tasks.photometry.fit import FitSettings, PhotometricFit
from tasks.photometry.region import RegionPixels

BANDS = ("none", "filter", "camera")
REGION_COLUMNS = ("region", "south", "north", "west", "east")
GEOJSON = (".json", ".geojson")


@dataclass(frozen=True)
class PhotometrySettings:
    """law: name. selection: region and limits of the angles. doubtful: doubtful images too. albedo_map: divide the
    products' base map out. bands: one of BANDS, what images are fitted apart by. fit: see there."""

    law: str = "lunar-lambert"
    selection: Selection = field(default_factory=lambda: Selection(max_incidence_deg=75.0, max_emission_deg=75.0))
    doubtful: bool = False
    albedo_map: bool = False
    bands: str = "none"
    max_pixels_per_image: int = 5_000
    fit: FitSettings = field(default_factory=FitSettings)

    def __post_init__(self) -> None:
        if self.bands not in BANDS:
            raise WrongOptionError("bands", f"there is no {self.bands}.", f"Known are {', '.join(BANDS)}.")


@dataclass(frozen=True)
class RegionResult:
    """One region: its pixels, the fit and L of each image, or the reason why there is none. left_out: products that
    could not be read, and why."""

    name: str
    selection: Selection
    pixels: RegionPixels | None = None
    fit: PhotometricFit | None = None
    each: tuple[ImageLimbWeight, ...] = ()
    reason: str | None = None
    left_out: tuple[tuple[str, str], ...] = ()


def read_regions(path: Path, limits: Selection, west_longitudes: bool = False) -> list[tuple[str, Selection]]:
    """Regions of a CSV file with the columns region, south, north, west, east (degrees, planetocentric), or of GeoJSON
    with polygons (.json, .geojson); the other limits are those of `limits`. west_longitudes: the file's are
    positive westward. Raises RefusedError when the file has no such regions, or two of one name."""
    if path.suffix.lower() in GEOJSON:
        found = [(name, _outlined(outline, limits)) for name, outline in read_outlines(path, west_longitudes)]
    else:
        found = _boxes(path, limits, west_longitudes)
    twice = sorted(name for name, times in Counter(name for name, _ in found).items() if times > 1)
    if twice:
        text = f"{path} has more than one region of the name {', '.join(twice[:5])}."
        raise RefusedError(Reason.REGIONS_UNREADABLE, text, "Give each a name of its own: tables and figures have it.")
    return found


def _outlined(outline: Outline, limits: Selection) -> Selection:
    latitude, longitude = outline.box_deg()
    return replace(limits, latitude_deg=latitude, longitude_deg=longitude, outline=outline)


def _boxes(path: Path, limits: Selection, west_longitudes: bool) -> list[tuple[str, Selection]]:
    """The rows of a CSV file; each runs from its west limit eastward to its east limit."""
    remedy = f"Give a CSV file with the columns {', '.join(REGION_COLUMNS)}, or GeoJSON with polygons (.geojson)."
    try:
        rows = list(csv.DictReader(io.StringIO(read_regular_text(path), newline="")))
        found = [(row["region"], _box(row, limits, west_longitudes)) for row in rows]
    except (OSError, UnicodeDecodeError, csv.Error, KeyError, TypeError, ValueError) as error:
        raise RefusedError(Reason.REGIONS_UNREADABLE, f"{path} lists no regions ({error}).", remedy) from error
    if not found:
        raise RefusedError(Reason.REGIONS_UNREADABLE, f"{path} lists no regions.", remedy)
    return found


def _box(row: Mapping[str, str], limits: Selection, west_longitudes: bool) -> Selection:
    south, north, west, east = (float(row[name]) for name in REGION_COLUMNS[1:])
    if not -90 <= south <= north <= 90 or not math.isfinite(west) or not math.isfinite(east):
        raise ValueError(f"limits of region {row['region']}: {south:g} to {north:g}, {west:g} to {east:g}")
    if west_longitudes:
        west, east = (-west, -east) if abs(west - east) >= 360 else (-west % 360, -east % 360)
    return replace(limits, latitude_deg=(south, north), longitude_deg=(west, east))


def held_values(given: Sequence[str]) -> dict[str, float]:
    """NAME=VALUE pairs. Raises WrongOptionError for anything else."""
    return {name: value for name, (value,) in _named_numbers(given, "hold", "NAME=VALUE", None).items()}


def prior_values(given: Sequence[str]) -> dict[str, tuple[float, float]]:
    """NAME=VALUE+-SIGMA. Raises WrongOptionError for anything else, or a sigma that is not positive."""
    found = _named_numbers(given, "prior", "NAME=VALUE+-SIGMA", "+-")
    if wrong := [name for name, pair in found.items() if not pair[1] > 0]:
        raise WrongOptionError("prior", f"the 1-sigma of {', '.join(wrong)} is not positive.", "")
    return {name: (pair[0], pair[1]) for name, pair in found.items()}


def bound_values(given: Sequence[str]) -> dict[str, tuple[float, float]]:
    """NAME=LOW:HIGH. Raises WrongOptionError for anything else, or limits without room between them."""
    found = _named_numbers(given, "bound", "NAME=LOW:HIGH", ":")
    if wrong := [name for name, pair in found.items() if not pair[0] < pair[1]]:
        raise WrongOptionError("bound", f"the limits of {', '.join(wrong)} leave no room.", "Give the lower one first.")
    return {name: (pair[0], pair[1]) for name, pair in found.items()}


def _named_numbers(given: Sequence[str], option: str, form: str, between: str | None) -> dict[str, tuple[float, ...]]:
    """Names and their numbers: one, or two with `between` between them."""
    found = {}
    for text in given:
        name, _, value = text.partition("=")
        parts = value.split(between) if between else [value]
        try:
            numbers = tuple(float(part) for part in parts)
        except ValueError as error:
            raise WrongOptionError(option, f"{text} is not {form}.", "") from error
        if len(numbers) != (2 if between else 1) or not all(map(math.isfinite, numbers)):
            raise WrongOptionError(option, f"{text} is not {form}.", "")
        found[name.strip()] = numbers
    return found
