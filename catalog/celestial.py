"""Orientations on the sky: right ascension, declination and twist of Galileo's labels, and FITS world coordinates."""

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.flips import PLACES, Flip
from catalog.reasons import Reason
from catalog.rotation import nearest_rotation

if TYPE_CHECKING:
    from catalog.camera import Camera
    from catalog.target import Target

Array = NDArray[np.float64]
# A label whose TWIST and NORAZ disagree by more describes two orientations; four sound ones agree to 0.02 deg.
TWIST_TOLERANCE_DEG = 2.0
# How far a header's pixels may be from the camera's, relative: focal lengths in use differ by less than 1e-3.
SCALE_TOLERANCE = 0.02
REVERSED_ROWS = "ROWS_REVERSED_BY_READER"
WCS_NEEDED = ("CRVAL1", "CRVAL2", "CRPIX1", "CRPIX2")
WCS_SCALES = ("CD1_1", "CD1_2", "CDELT1")  # without any of them a pixel would be taken for a degree
ECLIPTIC = {"ELON", "ELAT"}
SKIES = {"RA--", "DEC-", "GLON", "GLAT", *ECLIPTIC}
WCS_REMEDY = "Give the orientation in a pose file (--pose), or kernels."


def orientation_of_twist(ra_deg: float, dec_deg: float, twist_deg: float) -> Array:
    """camera_from_j2000 (3, 3) of a boresight's right ascension and declination and the twist about it: with n towards
    celestial north and e towards east across the boresight, x = -cos(t) n + sin(t) e and y = sin(t) n + cos(t) e.

    J2000 (checked on Galileo's labels of 1999 and 2000 by their own centre pixel and north azimuth, to 0.02 deg).
    """
    ra, dec, t = (math.radians(angle) for angle in (ra_deg, dec_deg, twist_deg))
    boresight = np.array([math.cos(dec) * math.cos(ra), math.cos(dec) * math.sin(ra), math.sin(dec)])
    north = np.array([-math.sin(dec) * math.cos(ra), -math.sin(dec) * math.sin(ra), math.cos(dec)])
    east = np.array([-math.sin(ra), math.cos(ra), 0.0])
    return np.array([-math.cos(t) * north + math.sin(t) * east, math.sin(t) * north + math.cos(t) * east, boresight])


def twist_of_label(label: Mapping[str, Any]) -> Array | None:
    """camera_from_j2000 of a label's RA, DEC and TWIST; None where it lacks one, or all are 0 (not known)."""
    values = [label.get(key) for key in ("RA", "DEC", "TWIST")]
    if not all(isinstance(value, int | float) and math.isfinite(value) for value in values):
        return None
    ra, dec, twist = (float(value) for value in values if value is not None)
    possible = 0 <= ra <= 360 and -90 <= dec <= 90 and -360 <= twist <= 360
    return orientation_of_twist(ra, dec, twist) if possible and (ra, dec, twist) != (0.0, 0.0, 0.0) else None


def twist_fault(label: Mapping[str, Any], camera_from_j2000: Array, target: "Target", et: float) -> str | None:
    """Why a label's TWIST is not to be used: its NORAZ puts the target's north elsewhere. None where both agree, or
    nothing can be compared. NORAZ: clockwise from growing x, y down, degrees."""
    azimuth = label.get("NORAZ")
    if target.rotation is None or not isinstance(azimuth, int | float) or not 0 < azimuth <= 360:
        return None
    pole = camera_from_j2000 @ target.rotation.body_from_j2000(et)[2]
    by_twist = math.degrees(math.atan2(pole[1], pole[0]))
    apart = abs((by_twist - azimuth + 180.0) % 360.0 - 180.0)
    if apart <= TWIST_TOLERANCE_DEG or math.hypot(pole[0], pole[1]) < math.sin(math.radians(TWIST_TOLERANCE_DEG)):
        return None
    return f"label: TWIST has north at {by_twist % 360:.1f} deg, NORAZ at {azimuth:.1f} deg"


def orientation_of_wcs(
    header: Mapping[str, Any],
    camera: "Camera",
    size_px: tuple[int, int],
    flip: Flip | None = None,
    first_px: tuple[int, int] = (0, 0),
) -> Array | None:
    """camera_from_j2000 of a FITS header's world coordinates (RA---TAN and the like: equatorial, galactic or ecliptic,
    either axis first); None where it has none. size_px: of the picture as it was read; flip: how the user had it
    flipped; first_px: where its first pixel lies in the camera's frame.

    Raises RefusedError where the coordinates do not fit the camera: a mirrored picture, or another pixel scale.
    """
    if not _axis_names(header) & SKIES:
        return None
    nx, ny = size_px
    places = np.array([[0.5, 0.5], [0.3, 0.4], [0.7, 0.45], [0.4, 0.7], [0.65, 0.65]]) * [nx - 1, ny - 1]
    sky = _sky_of(header, _file_places(header, places, size_px, flip))
    rays = camera.detector_ray(places + np.array(first_px))
    mixed = rays.T @ sky
    if np.linalg.det(_planar(rays, places)) * np.linalg.det(_planar(sky, places)) < 0:
        fault = "the header's world coordinates show the picture mirrored, as this camera's pixels go"
        raise RefusedError(
            Reason.WCS_MIRRORED, f"{fault}.", "Flip it: --flip y for pictures stored from the bottom up."
        )
    scale = _spread(sky) / _spread(rays)
    if abs(scale - 1.0) > SCALE_TOLERANCE:
        fault = f"the header's world coordinates have pixels {scale:.3f} times those of camera {camera.name}"
        raise RefusedError(Reason.WCS_SCALE, f"{fault}.", "Give the --camera (and mode) that took the image.")
    return nearest_rotation(mixed)


def _file_places(header: Mapping[str, Any], places: Array, size_px: tuple[int, int], flip: Flip | None) -> Array:
    """Where pixels of the picture are in the file: before the user's flip, and before the reader reversed the rows."""
    size = np.array(size_px, dtype=np.float64)
    centred = places - (size - 1) / 2
    if flip is not None:
        centred = centred @ PLACES[flip]  # the inverse of an orthogonal matrix, applied to rows
        size = size[::-1] if abs(PLACES[flip][0, 0]) < 0.5 else size
    if header.get(REVERSED_ROWS):
        centred = centred * [1.0, -1.0]
    return centred + (size - 1) / 2


def _axis_names(header: Mapping[str, Any]) -> set[str]:
    return {str(header.get(key, "")).upper()[:4] for key in ("CTYPE1", "CTYPE2")}


def _sky_of(header: Mapping[str, Any], places: Array) -> Array:
    """Unit vectors (n, 3) in J2000 (ICRS) of 0-based pixels of the file."""
    import warnings

    from astropy.coordinates import BarycentricMeanEcliptic, SkyCoord
    from astropy.io.fits import Header, VerifyError
    from astropy.time import Time
    from astropy.wcs import WCS

    lacking = [key for key in WCS_NEEDED if not isinstance(header.get(key), int | float)]
    if lacking:  # their usual value, 0, would be taken for a place on the sky
        fault = f"the header's world coordinates lack {' and '.join(lacking)}"
        raise RefusedError(Reason.WCS_UNREADABLE, f"{fault}.", WCS_REMEDY)
    if not any(isinstance(header.get(key), int | float) for key in WCS_SCALES):
        fault = "the header's world coordinates have neither CD1_1 nor CDELT1, the size of a pixel"
        raise RefusedError(Reason.WCS_UNREADABLE, f"{fault}.", WCS_REMEDY)
    kept = Header()
    try:
        for key, value in header.items():
            if isinstance(value, str | int | float) and len(key) <= 8 and key.upper() not in ("COMMENT", "HISTORY", ""):
                kept[key] = value
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            wcs = WCS(kept, naxis=2)
            if _axis_names(header) == ECLIPTIC:  # astropy has no frame for them
                degrees = wcs.all_pix2world(places, 0)[:, [wcs.wcs.lng, wcs.wcs.lat]]
                is_old, year = wcs.wcs.radesys.upper().startswith("FK4"), wcs.wcs.equinox
                equinox = Time(year if math.isfinite(year) else 2000.0, format="byear" if is_old else "jyear")
                sky = SkyCoord(*degrees.T, unit="deg", frame=BarycentricMeanEcliptic(equinox=equinox))
            else:
                sky = wcs.pixel_to_world(places[:, 0], places[:, 1])
        if not isinstance(sky, SkyCoord):
            raise ValueError(f"RADESYS = {header.get('RADESYS')} is no frame that is known")
        sky = sky.icrs
    except (VerifyError, ValueError, TypeError, LookupError, AttributeError, ArithmeticError) as error:
        reason = (str(error).strip().splitlines() or [type(error).__name__])[-1]  # wcslib's last line is its cause
        fault = f"the header's world coordinates cannot be read ({reason})"
        raise RefusedError(Reason.WCS_UNREADABLE, f"{fault}.", WCS_REMEDY) from error
    vectors = np.asarray(sky.cartesian.xyz.value.T, dtype=np.float64)
    if not np.isfinite(vectors).all():
        fault = "the header's world coordinates give parts of the picture no place on the sky"
        raise RefusedError(Reason.WCS_UNREADABLE, f"{fault}.", WCS_REMEDY)
    return vectors


def _planar(vectors: Array, places: Array) -> Array:
    """The change of directions (2, 2), across their mean, per pixel in x and y: its determinant's sign is that of the
    handedness."""
    mean = vectors.mean(axis=0) / np.linalg.norm(vectors.mean(axis=0))
    side = np.cross(mean, [0.0, 0.0, 1.0] if abs(mean[2]) < 0.9 else [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    plane = np.stack([vectors @ side, vectors @ np.cross(mean, side)], axis=-1)
    return np.linalg.lstsq(places - places.mean(axis=0), plane - plane.mean(axis=0), rcond=None)[0]


def _spread(vectors: Array) -> float:
    return float(np.linalg.norm(vectors - vectors.mean(axis=0)))
