"""The frame's star images: peaks that have the shape which most bright peaks of the frame share."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from catalog.robust import MAD_TO_SIGMA
from tasks.stars.centroid import FARTHEST_PX, Fits, first, fit_stars, stamps
from tasks.stars.detect import filled, local_noise, peaks
from tasks.stars.settings import DetectionSettings

Array = NDArray[np.float64]
FOR_SHAPE = 60  # brightest peaks that the common shape is taken from
SURE = 10.0  # signal to noise above which a peak has a shape of its own
QUANTISATION_SAMPLE = 100_000
FEWEST_FOR_SHAPE = 4
STAR, POINT, EXTENDED, UNFIT = "star", "point", "extended", "unfit"


@dataclass(frozen=True)
class Sources:
    """Peaks of a frame, highest signal to noise first.

    xy_px: (n, 2) in the frame's own pixels. covariance_px2: (n, 2, 2). height: (n,). signal_to_noise: (n,). kind: (n,)
    text: star, point (a hot pixel or a cosmic ray), extended (a ridge, a limb, a blend) or unfit. shape_px2: (2, 2),
    covariance of the frame's star images."""

    xy_px: Array
    covariance_px2: Array
    height: Array
    signal_to_noise: Array
    kind: NDArray[np.str_]
    shape_px2: Array

    @property
    def stars(self) -> "Sources":
        """Those that look like stars."""
        return self.only(np.asarray(self.kind == STAR))

    def only(self, chosen: NDArray | slice) -> "Sources":
        """Those that an index or mask chooses."""
        names = ("xy_px", "covariance_px2", "height", "signal_to_noise", "kind")
        return replace(self, **{name: getattr(self, name)[chosen] for name in names})

    def __len__(self) -> int:
        return len(self.xy_px)


def find_sources(observation: Observation, psf_sigma_px: float, settings: DetectionSettings) -> Sources:
    """Star images of a frame and what else has a peak. psf_sigma_px: of the camera, to begin with; where enough bright
    peaks agree in another shape (a trail, a better focus), that is the frame's."""
    image, usable = observation.image.astype(np.float64), observation.usable & np.isfinite(observation.image)
    shape, variance = np.eye(2) * max(psf_sigma_px, 0.4) ** 2, sky_variance(image, usable, settings.tile_px)
    for _ in range(2):
        places, ratio = peaks(image, usable, shape, settings)
        places, ratio = places[: settings.most], ratio[: settings.most]
        cut = stamps(image, variance, usable, places, _half(shape))
        common = common_shape(fit_stars(first(cut, FOR_SHAPE), shape, True, settings.model_error), shape)
        if np.allclose(common, shape, rtol=0.15, atol=0.05):
            break
        shape = common
    fits = fit_stars(cut, shape, False, settings.model_error)
    free = fit_stars(cut, shape, True, settings.model_error)
    kind = kinds(fits, free, places, shape, settings)
    sources = Sources(fits.xy_px, fits.covariance_px2, fits.height, ratio, kind, shape)
    return _without_doubles(sources, 1.5 * float(np.sqrt(np.trace(shape) / 2)))


def _half(shape: Array) -> int:
    return max(3, int(np.ceil(3.0 * float(np.sqrt(np.linalg.eigvalsh(shape)[-1])))))


def sky_variance(image: Array, usable: NDArray[np.bool_], tile_px: int) -> Array:
    """Variance (ny, nx) of a single pixel, from its scatter about the median of its neighbours, by tiles, and what
    rounding to the image's steps adds."""
    rough = image - _smooth(filled(image, usable))
    steps = np.diff(np.unique(image[usable][:QUANTISATION_SAMPLE]))
    rounding = float(steps.min()) ** 2 / 12 if len(steps) else 0.0
    return np.asarray(local_noise(rough, usable, tile_px) ** 2 + rounding)


def _smooth(image: Array) -> Array:
    import cv2

    return np.asarray(cv2.medianBlur(image.astype(np.float32), 5), dtype=np.float64)


def common_shape(free: Fits, fallback: Array) -> Array:
    """Covariance (2, 2) of star images that the brighter peaks share: the median over peaks that are neither points nor
    much wider; the fallback where too few are that sure."""
    sure = free.height > SURE * free.height_sigma
    sure &= free.point_chi2 > free.chi2
    wide = np.sqrt(np.maximum(free.shape_px2[:, 0] + free.shape_px2[:, 2], 0) / 2)
    sure &= (wide > 0.35) & (wide < 6.0)
    if sure.sum() < FEWEST_FOR_SHAPE:
        return fallback
    xx, xy, yy = np.median(free.shape_px2[sure], axis=0)
    scatter = MAD_TO_SIGMA * np.median(np.abs(free.shape_px2[sure] - [xx, xy, yy]), axis=0)
    if scatter[0] > 0.5 * xx or scatter[2] > 0.5 * yy:
        return fallback
    return np.array([[xx, xy], [xy, yy]])


def kinds(
    fits: Fits, free: Fits, peak: NDArray[np.int_], shape: Array, settings: DetectionSettings
) -> NDArray[np.str_]:
    """What each peak is, by its fit with the frame's star image and with a shape of its own."""
    whole = np.linalg.inv(np.linalg.cholesky(shape))
    own = np.stack([free.shape_px2[:, [0, 1]], free.shape_px2[:, [1, 2]]], axis=1)
    widths = np.sqrt(np.maximum(np.linalg.eigvalsh(whole @ own @ whole.T), 1e-6))  # in those of the star image
    moved = np.hypot(*(fits.xy_px - free.xy_px).T)
    signal = free.height / np.maximum(free.height_sigma, 1e-12)
    # The width of a faint peak has an error of its own: about 1 / (signal to noise).
    slack = 1.0 + 2.5 / np.maximum(signal, 1.0)
    broad = (widths[:, 1] > settings.widest * slack) | (widths[:, 1] / widths[:, 0] > settings.longest * slack)
    kind = np.full(len(signal), STAR, dtype="<U8")
    kind[broad] = EXTENDED
    kind[fits.point_chi2 < fits.chi2] = POINT
    held = np.abs(fits.xy_px - peak).max(axis=1) >= FARTHEST_PX
    bad = ~np.isfinite(fits.xy_px).all(axis=1) | (fits.height <= 0) | held | (moved > 1.0) | (fits.pixels < 12)
    kind[bad] = UNFIT
    return kind


def _without_doubles(sources: Sources, apart_px: float) -> Sources:
    """One of peaks whose fits went to the same place, the higher."""
    from scipy.spatial import cKDTree

    sources = sources.only(np.asarray(np.isfinite(sources.xy_px).all(axis=1)))
    if len(sources) < 2:
        return sources
    pairs = cKDTree(sources.xy_px).query_pairs(apart_px, output_type="ndarray")
    return sources.only(np.setdiff1d(np.arange(len(sources)), pairs.max(axis=1))) if len(pairs) else sources
