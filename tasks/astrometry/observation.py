"""One body in one image: its direction from the spacecraft in the ICRF by the stars of the same image, its error, and
how far it is from where an ephemeris has it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.reasons import Reason
from catalog.spice import Kernel
from catalog.spice_pose import pose_parts_from_loaded
from catalog.stars.table import ra_dec_deg
from catalog.times import utc_from_et
from tasks.kernels.exposure import Exposure, read_exposure, without_aberration
from tasks.publish.stars import stars_of_product

Array = NDArray[np.float64]
Json = dict[str, Any]
Row = dict[str, str | float | int | None]
ARCSEC = 3600.0 * 180.0 / np.pi
KERNELS, PRODUCT = "kernels", "product"


@dataclass(frozen=True)
class BodyObservation:
    """exposure: the product's pose, whose camera is the stars'. stars: what the product states of them. computed_km:
    (3,) J2000, apparent, where the ephemeris has the body; computed_from: `kernels` that are loaded, or the predicted
    pose of the `product`."""

    exposure: Exposure
    stars: Json
    computed_km: Array
    computed_from: str

    @property
    def row(self) -> Row:
        """The columns of the tables, see `COLUMNS`."""
        exposure, pose, camera = self.exposure, self.exposure.pose, self.exposure.camera
        measured = pose.target_from_spacecraft_km
        (ra, dec), boresight = ra_dec_deg(measured), ra_dec_deg(pose.camera_from_j2000[2])
        centre = camera.project(pose.target_in_camera_km)
        off_px = centre - camera.project(pose.camera_from_j2000 @ self.computed_km)
        off, sigma, correlation = self._across()
        row: Row = {
            "image": exposure.product,
            "utc": utc_from_et(pose.et),
            "camera": camera.name,
            "body": exposure.target.name,
            "naif_id": exposure.target.naif_id,
            "ra_c_deg": float(boresight[0]),
            "dec_c_deg": float(boresight[1]),
            "twist_deg": twist_deg(pose.camera_from_j2000),
            "sample_px": float(centre[0]),
            "line_px": float(centre[1]),
            "ra_deg": float(ra),
            "dec_deg": float(dec),
            "ra_astrometric_deg": None,
            "dec_astrometric_deg": None,
            "sigma_ra_arcsec": sigma[0],
            "sigma_dec_arcsec": sigma[1],
            "sigma_correlation": correlation,
            "oc_ra_arcsec": off[0],
            "oc_dec_arcsec": off[1],
            "oc_sample_px": float(off_px[0]),
            "oc_line_px": float(off_px[1]),
            "computed_from": self.computed_from,
            "range_km": pose.range_km,
            "stars": int(self.stars["stars"]),
            "stars_rms_px": float(self.stars["rms_px"]),
            "catalog": str(self.stars["catalog"]),
            "exposure_s": exposure.exposure_s,
        }
        if pose.spacecraft_velocity_km_s is not None and self.stars["aberration"]:
            still = ra_dec_deg(without_aberration(measured, pose.spacecraft_velocity_km_s))
            row |= {"ra_astrometric_deg": float(still[0]), "dec_astrometric_deg": float(still[1])}
        return row

    def _across(self) -> tuple[list[float], list[float | None], float | None]:
        """Measured less computed, in right ascension times cos(dec) and declination, arcseconds; 1-sigma of both, and
        their correlation; None where the errors are not known."""
        measured = self.exposure.pose.target_from_spacecraft_km
        u = measured / np.linalg.norm(measured)
        east = np.array([-u[1], u[0], 0.0]) / np.hypot(u[0], u[1])
        axes = np.stack([east, np.cross(u, east)])
        off = (axes @ (u - self.computed_km / np.linalg.norm(self.computed_km))) * ARCSEC
        covariance = self.stars["target_offset_covariance_km2"]
        if covariance is None:
            return off.tolist(), [None, None], None
        spread = axes @ np.array(covariance) @ axes.T * (ARCSEC / np.linalg.norm(measured)) ** 2
        sigma = np.sqrt(np.diag(spread))
        return off.tolist(), sigma.tolist(), float(spread[0, 1] / sigma.prod())


COLUMNS: dict[str, tuple[str | None, str]] = {
    "image": (None, "Product"),
    "utc": (None, "Middle of the exposure, UTC"),
    "camera": (None, "Camera"),
    "body": (None, "Body"),
    "naif_id": (None, "NAIF number of the body"),
    "ra_c_deg": ("deg", "Right ascension of the boresight (ICRF)"),
    "dec_c_deg": ("deg", "Declination of the boresight (ICRF)"),
    "twist_deg": ("deg", "Twist: x = -cos(t) n + sin(t) e of growing samples, n and e towards north and east"),
    "sample_px": ("pix", "Sample of the body's centre, undistorted frame, first pixel 0"),
    "line_px": ("pix", "Line of the body's centre, undistorted frame, first pixel 0"),
    "ra_deg": ("deg", "Apparent right ascension of the body's centre from the spacecraft (ICRF)"),
    "dec_deg": ("deg", "Apparent declination of the body's centre from the spacecraft (ICRF)"),
    "ra_astrometric_deg": ("deg", "The same without stellar aberration"),
    "dec_astrometric_deg": ("deg", "The same without stellar aberration"),
    "sigma_ra_arcsec": ("arcsec", "1-sigma of right ascension times cos(dec)"),
    "sigma_dec_arcsec": ("arcsec", "1-sigma of declination"),
    "sigma_correlation": (None, "Correlation of the two"),
    "oc_ra_arcsec": ("arcsec", "Observed less computed, right ascension times cos(dec)"),
    "oc_dec_arcsec": ("arcsec", "Observed less computed, declination"),
    "oc_sample_px": ("pix", "Observed less computed sample"),
    "oc_line_px": ("pix", "Observed less computed line"),
    "computed_from": (None, "kernels: the loaded ones; product: the pose that the image was predicted with"),
    "range_km": ("km", "Distance of the body"),
    "stars": (None, "Stars that the orientation is fitted to"),
    "stars_rms_px": ("pix", "Their root mean square residual"),
    "catalog": (None, "Star catalog"),
    "exposure_s": ("s", "Exposure"),
}
STAR_COLUMNS = (
    "image", "star", "ra_deg", "dec_deg", "magnitude", "x_px", "y_px", "sigma_px", "residual_x_px", "residual_y_px",
    "signal_to_noise", "used",
)  # fmt: skip


def twist_deg(camera_from_j2000: Array) -> float:
    """The twist (0-360) of an orientation, see `catalog.celestial.orientation_of_twist`."""
    x, boresight = camera_from_j2000[0], camera_from_j2000[2]
    east = np.array([-boresight[1], boresight[0], 0.0]) / np.hypot(boresight[0], boresight[1])
    return float(np.degrees(np.arctan2(x @ east, -(x @ np.cross(boresight, east)))) % 360.0)


def observation_in(folder: Path, loaded: list[Kernel]) -> BodyObservation:
    """The observation of a product's folder. loaded: kernels that a `kernel_pool` around the call holds. Raises
    RefusedError for a product without stars: its camera and its target cannot be separated."""
    exposure, stars = read_exposure(folder), stars_of_product(folder)
    if not stars.get("stars"):
        fault = f"{exposure.product}: no stars say where its camera looked"
        why = stars.get("reason") or "it was corrected without --stars"
        raise RefusedError(Reason.STARS_NOT_IDENTIFIED, f"{fault} ({why}).", "Correct it with `--stars gaia`.")
    parts = pose_parts_from_loaded(exposure.camera, exposure.target, exposure.pose.et, loaded).parts
    if parts.target_from_spacecraft_km is not None:
        return BodyObservation(exposure, stars, parts.target_from_spacecraft_km, KERNELS)
    predicted = exposure.pose.target_from_spacecraft_km - np.array(stars["target_offset_km"])
    return BodyObservation(exposure, stars, predicted, PRODUCT)
