"""Which column of a user's star catalog is what: by the names that the large catalogs use, or as the user says."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.reasons import Reason

Array = NDArray[np.float64]
Columns = dict[str, NDArray[Any]]
# Names that a column may have, in lower case, the likelier first: Gaia's archive, VizieR's copies of Gaia, Tycho and
# UCAC, and plain English.
KNOWN_NAMES: Mapping[str, tuple[str, ...]] = {
    "ra_deg": ("ra_deg", "ra", "ra_icrs", "raj2000", "_raj2000", "radeg", "ra_j2000", "right_ascension", "_ra"),
    "dec_deg": (
        "dec_deg",
        "dec",
        "de_icrs",
        "dec_icrs",
        "dej2000",
        "_dej2000",
        "dedeg",
        "dec_j2000",
        "declination",
        "_de",
    ),
    "magnitude": (
        "magnitude",
        "mag",
        "phot_g_mean_mag",
        "gmag",
        "g_mag",
        "vtmag",
        "vmag",
        "v",
        "f.mag",
        "fmag",
        "hpmag",
    ),
    "pm_ra_mas": ("pm_ra_mas", "pmra", "pm_ra", "pmra_cosdec", "pmracosdec"),
    "pm_dec_mas": ("pm_dec_mas", "pmdec", "pmde", "pm_dec", "pm_de"),
    "parallax_mas": ("parallax_mas", "parallax", "plx"),
    "ident": ("ident", "source_id", "source", "name", "id", "designation", "hip", "tyc", "ucac4"),
    "epoch": ("epoch", "ref_epoch", "refepoch"),
}
NEEDED = ("ra_deg", "dec_deg", "magnitude")
# Units of our columns, as astropy writes them; epochs are Julian years.
OUR_UNITS: Mapping[str, str] = {
    "ra_deg": "deg",
    "dec_deg": "deg",
    "magnitude": "mag",
    "pm_ra_mas": "mas / yr",
    "pm_dec_mas": "mas / yr",
    "parallax_mas": "mas",
    "epoch": "yr",
}
HOURS = ("h", "hr", "hour", "hours")  # of right ascension: of time elsewhere
NAME_AND_UNIT = re.compile(r"^(?P<name>[^\[(]*[^\[(\s])\s*[\[(](?P<unit>[^\])]*)[\])]$")


def column_map(present: Sequence[str], given: Mapping[str, str], path: str) -> dict[str, str]:
    """Our name of each known column with the file's. given: the user's own choice, which comes first.

    Raises RefusedError for a choice that is no column, or where a needed one is not found."""
    by_lower = {without_unit(name).lower(): name for name in reversed(list(present))}
    by_lower |= {name.lower(): name for name in reversed(list(present))}
    if unknown := [key for key in given if key not in KNOWN_NAMES]:
        fault = f"star catalog {path}: {', '.join(unknown)} is no name of ours."
        raise RefusedError(Reason.STAR_CATALOG_INVALID, fault, f"Give NAME=COLUMN with {', '.join(KNOWN_NAMES)}.")
    if missing := [name for name in given.values() if name not in present and name.lower() not in by_lower]:
        fault = f"star catalog {path} has no column {', '.join(missing)}; it has {_some(present)}."
        raise RefusedError(Reason.STAR_CATALOG_INVALID, fault, "Correct --columns.")
    found = {key: name if name in present else by_lower[name.lower()] for key, name in given.items()}
    for key, names in KNOWN_NAMES.items():
        known = next((by_lower[name] for name in names if name in by_lower), None)
        if key not in found and known is not None:
            found[key] = known
    lacking = [key for key in NEEDED if key not in found]
    if lacking and present and all(_is_number(name) for name in present):
        fault = f"star catalog {path} has no names of columns: its first line is {_some(present)}."
        raise RefusedError(Reason.STAR_CATALOG_INVALID, fault, "Write a first line of names, as ra,dec,mag.")
    if lacking:
        fault = f"star catalog {path} has no column that is known as {', '.join(lacking)}; it has {_some(present)}."
        remedy = f"Say which is which: --columns {','.join(f'{key}=COLUMN' for key in lacking)}."
        raise RefusedError(Reason.STAR_CATALOG_INVALID, fault, remedy)
    by_name: dict[str, list[str]] = {}
    for key, name in found.items():
        by_name.setdefault(name, []).append(key)
    if twice := [f"{' and '.join(keys)} are both {name}" for name, keys in by_name.items() if len(keys) > 1]:
        fault = f"star catalog {path}: {'; '.join(twice)}; it has {_some(present)}."
        raise RefusedError(Reason.STAR_CATALOG_INVALID, fault, "Give --columns a column of its own for each.")
    return found


def without_unit(name: str) -> str:
    """The name of a column whose header holds its unit, too, as `ra [deg]` or `pmRA (mas/yr)`."""
    found = NAME_AND_UNIT.match(name.strip())
    return found["name"] if found else name


def unit_in(name: str) -> str | None:
    """The unit in a column's header; None without one."""
    found = NAME_AND_UNIT.match(name.strip())
    return found["unit"].strip() or None if found else None


def factor_to_ours(key: str, unit: Any, name: str, path: str) -> float:
    """What values of the file's column `name` are multiplied by to be in the unit of ours, `key`. unit: text or
    astropy's own; None or empty is taken for ours. Raises RefusedError where one cannot be made of the other."""
    text = str(unit or "").strip().strip("'\"")
    if not text or key not in OUR_UNITS:
        return 1.0
    from astropy import units as u

    ours = u.Unit(OUR_UNITS[key])
    if key == "magnitude" and text.lower().startswith("mag("):  # of a system, as mag(AB)
        return 1.0
    text = "hourangle" if key == "ra_deg" and text.lower() in HOURS else text
    try:
        with u.add_enabled_units([u.def_unit("degrees", u.deg), u.def_unit("degree", u.deg)]):
            return float(u.Unit(text).to(ours))
    except (ValueError, TypeError, u.UnitConversionError) as error:
        fault = f"star catalog {path}: its column {name} is in {text!r}, which does not convert to {OUR_UNITS[key]}."
        remedy = f"Convert it to {OUR_UNITS[key]}, or name another column: --columns {key}=COLUMN."
        raise RefusedError(Reason.STAR_CATALOG_INVALID, fault, remedy) from error


def numbers(column: Any) -> NDArray[np.float64]:
    """Numbers of a column; what is masked or empty becomes NaN."""
    if isinstance(column, np.ma.MaskedArray):
        return np.asarray(np.ma.filled(column.astype(np.float64), np.nan))
    return np.asarray(column, dtype=np.float64)


def factors_of(names: Mapping[str, str], units: Mapping[str, Any], path: Path) -> dict[str, float]:
    """What each of our columns is multiplied by, as `factor_to_ours`. names: of the file; units: of each."""
    return {key: factor_to_ours(key, units[key], name, str(path)) for key, name in names.items()}


def in_our_units(columns: Columns, factors: Mapping[str, float]) -> Columns:
    """Columns of the file, by our names, in our units."""
    return {key: values if factors[key] == 1 else numbers(values) * factors[key] for key, values in columns.items()}


def are_directions(ra_deg: Array, dec_deg: Array) -> NDArray[np.bool_]:
    """Which of right ascensions and declinations (n,), degrees, are a direction."""
    return np.asarray(np.isfinite(ra_deg) & np.isfinite(dec_deg) & (np.abs(dec_deg) <= 90))


def check_directions(ra_deg: Array, dec_deg: Array, names: Mapping[str, str], path: str) -> None:
    """Raise RefusedError where no row (n,) of a catalog has a direction, or where the two columns look swapped."""
    refuse_swapped(*looks_of(ra_deg, dec_deg), names, path)
    if are_directions(ra_deg, dec_deg).any():
        return
    ra, dec = names["ra_deg"], names["dec_deg"]
    fault = f"star catalog {path}: none of its {len(ra_deg)} rows has a direction in decimal degrees in {ra} and {dec}."
    remedy = "Convert hours and sexagesimal text, or name the right columns: --columns ra_deg=COLUMN,dec_deg=COLUMN."
    if not len(ra_deg):
        fault, remedy = f"star catalog {path} holds no stars.", "Give a file with rows, or gaia or hipparcos."
    raise RefusedError(Reason.STAR_CATALOG_INVALID, fault, remedy)


def looks_of(ra_deg: Array, dec_deg: Array) -> tuple[bool, bool]:
    """Whether some declinations (n,) are beyond 90 degrees, and whether all right ascensions could be declinations."""
    known = np.isfinite(ra_deg) & np.isfinite(dec_deg)
    return bool((np.abs(dec_deg[known]) > 90).any()), bool((np.abs(ra_deg[known]) <= 90).all())


def refuse_swapped(beyond_90: bool, all_within_90: bool, names: Mapping[str, str], path: str) -> None:
    """Raise RefusedError where right ascensions are given as declinations and the other way round; see `looks_of`."""
    if not (beyond_90 and all_within_90):
        return
    ra, dec = names["ra_deg"], names["dec_deg"]
    fault = (
        f"star catalog {path}: declinations in {dec} are beyond 90 deg and all right ascensions in {ra} are within, as "
        "if the two columns were swapped."
    )
    raise RefusedError(Reason.STAR_CATALOG_INVALID, fault, f"Give --columns ra_deg={dec},dec_deg={ra}.")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _some(names: Sequence[str]) -> str:
    return ", ".join(names[:20]) + (", ..." if len(names) > 20 else "")
