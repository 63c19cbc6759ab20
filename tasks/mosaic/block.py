"""One block of a mosaic: every image projected on it, normalised, levelled, weighed; outliers left out."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.mosaic.model import Model
from tasks.mosaic.settings import MosaicSettings
from tasks.mosaic.view import Ground, Seen, View, ground_at, seen_from

Array = NDArray[np.float64]
LAYERS = (
    "reflectance", "sigma", "sigma_noise", "sigma_pose", "sigma_photometry", "count", "phase", "incidence", "emission",
    "resolution_km", "image_index",
)  # fmt: skip
NO_IMAGE = -1
LARGEST_OVERSAMPLE = 12
LEAST_FADE = 0.02
EDGE_PX = 4.0  # images fade out over so many pixels before the edge of what is usable of them


@dataclass(frozen=True)
class Share:
    """What one image adds at n pixels of the block (`where`, flat indices): normalised reflectance and its 1-sigma by
    noise, pose and photometry, weight, angles in degrees, size of the image's pixel on the ground."""

    index: int
    where: NDArray[np.intp]
    value: Array
    noise: Array
    pose: Array
    photometry: Array
    weight: Array
    phase: Array
    incidence: Array
    emission: Array
    resolution_km: Array


def combined_block(
    latitude: Array, longitude: Array, views: Sequence[tuple[int, View]], model: Model, settings: MosaicSettings,
    pixel_km: float,
) -> dict[str, NDArray]:  # fmt: skip
    """The layers of a block whose pixels have these places (rows, columns): float32, NaN where no image shows the
    ground; `count` int16, 0 there, `image_index` int16, -1 there. views: with their number, those that may show it."""
    shares = []
    ground = None
    for index, view in views:
        ground = ground or ground_at(view.target, latitude, longitude)
        share = share_of(index, view, ground, model, settings, pixel_km)
        if share is not None:
            shares.append(share)
    return _combined(shares, latitude.shape, settings)


def share_of(
    index: int, view: View, ground: Ground, model: Model, settings: MosaicSettings, pixel_km: float
) -> Share | None:
    """What an image adds to a block; None when it shows nothing of it."""
    with np.errstate(invalid="ignore"):
        seen = seen_from(view.pose, view.camera, ground)
        lit = (seen.mu0 >= math.cos(math.radians(settings.max_incidence_deg))) & (
            seen.mu >= math.cos(math.radians(settings.max_emission_deg))
        )
        xy = seen.xy_px - np.asarray(view.corner_px)
        ny, nx = view.image.shape
        lit &= (xy[..., 0] > 0) & (xy[..., 0] < nx - 1) & (xy[..., 1] > 0) & (xy[..., 1] < ny - 1)
    if not lit.any():
        return None
    value, steep, edge = _sampled(view, xy, lit)
    where = np.flatnonzero(lit.ravel() & np.isfinite(value).ravel() & (edge.ravel() > 0))
    if not len(where):
        return None
    return _share(index, view, model, settings, pixel_km, seen, where, value, steep, edge)


def _share(
    index: int, view: View, model: Model, settings: MosaicSettings, pixel_km: float, seen: Seen,
    where: NDArray[np.intp], value: Array, steep: Array, edge: Array,
) -> Share:  # fmt: skip
    mu0, mu, phase, resolution = (
        part.ravel()[where] for part in (seen.mu0, seen.mu, seen.phase_deg, seen.resolution_km)
    )
    incidence, emission = (np.degrees(np.arccos(np.clip(cosine, -1, 1))) for cosine in (mu0, mu))
    units = (settings.units_per_if or 1.0) * model.levels[index]
    factor = model.law.normalising_factor(model.values, incidence, emission, phase, settings.standard_deg) / units
    reflectance = value.ravel()[where] * factor
    finer = np.minimum(
        resolution / pixel_km, 1.0
    )  # where the map's pixel is larger, several of the image's are averaged
    noise = view.noise * factor * finer
    pose = steep.ravel()[where] * np.hypot(view.still_px, view.turning_px * mu) * factor
    photometry = np.abs(reflectance) * math.hypot(model.scatter, float(model.level_sigma[index]))
    fade = np.ones_like(mu)
    for angle, limit in ((incidence, settings.max_incidence_deg), (emission, settings.max_emission_deg)):
        fade *= np.clip((limit - angle) / settings.fade_deg, LEAST_FADE, 1) ** 2
    weight = fade * edge.ravel()[where]
    if "sigma" in settings.weights:
        weight = weight / (noise**2 + pose**2 + photometry**2)
    if "resolution" in settings.weights:
        weight = weight / np.maximum(resolution, pixel_km) ** 2
    return Share(index, where, reflectance, noise, pose, photometry, weight, phase, incidence, emission, resolution)


def _sampled(view: View, xy: Array, lit: NDArray[np.bool_]) -> tuple[Array, Array, Array]:
    """Brightness, its gradient and how far from the image's edge (0 at it, 1 well inside), where `lit` (rows, columns):
    the mean over the pixel's footprint in the image, whose corners follow from those of its neighbours."""
    import cv2

    down, right = (np.nan_to_num(_difference(xy, axis)) for axis in (0, 1))
    largest = max(float(np.abs(step[lit]).max()) for step in (down, right))
    parts = min(max(math.ceil(largest - 0.25), 1), LARGEST_OVERSAMPLE)
    kernel = cv2.INTER_CUBIC if parts == 1 else cv2.INTER_LINEAR
    inside = view.usable.astype(np.uint8)
    inside = np.pad(inside, 1)
    depth = cv2.distanceTransform(inside, cv2.DIST_L2, 3)[1:-1, 1:-1]
    safe = np.where(lit[..., None], xy, -10.0)
    total, count = np.zeros(lit.shape), np.zeros(lit.shape)
    offsets = (np.arange(parts) + 0.5) / parts - 0.5
    for a in offsets:
        for b in offsets:
            x, y = (safe[..., k] + a * down[..., k] + b * right[..., k] for k in (0, 1))
            value = cv2.remap(view.image, x.astype(np.float32), y.astype(np.float32), kernel, borderValue=0.0)
            near = cv2.remap(depth, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR, borderValue=0.0)
            good = near >= (2.0 if kernel == cv2.INTER_CUBIC else 1.5)
            total += np.where(good, value, 0)
            count += good
    middle = safe.astype(np.float32)
    steep = cv2.remap(view.steep, middle[..., 0], middle[..., 1], cv2.INTER_LINEAR, borderValue=0.0)
    near = cv2.remap(depth, middle[..., 0], middle[..., 1], cv2.INTER_LINEAR, borderValue=0.0)
    with np.errstate(invalid="ignore", divide="ignore"):
        value = np.where(2 * count >= parts * parts, total / count, np.nan)
    return value, steep.astype(np.float64), np.clip((near - 1.5) / EDGE_PX, 0, 1).astype(np.float64)


def _difference(xy: Array, axis: int) -> Array:
    """From pixel to pixel along an axis (rows, columns, 2); 0 for a block of one pixel."""
    return np.asarray(np.gradient(xy, axis=axis)) if xy.shape[axis] > 1 else np.zeros_like(xy)


def _combined(shares: Sequence[Share], shape: tuple[int, int], settings: MosaicSettings) -> dict[str, NDArray]:
    size = shape[0] * shape[1]
    layers: dict[str, NDArray] = {name: np.full(size, np.nan, np.float32) for name in LAYERS}
    layers["count"], layers["image_index"] = np.zeros(size, np.int16), np.full(size, NO_IMAGE, np.int16)
    if shares:
        kept = _without_outliers(shares, size, settings.outlier_sigma)
        total = _sum(shares, kept, size, lambda s: s.weight)
        shown = total > 0
        for name in ("value", "phase", "incidence", "emission", "resolution_km"):
            mean = _sum(shares, kept, size, lambda s, name=name: s.weight * getattr(s, name))
            layers["reflectance" if name == "value" else name][shown] = (mean[shown] / total[shown]).astype(np.float32)
        squares = np.zeros(size)
        for name in ("noise", "pose", "photometry"):
            variance = _sum(shares, kept, size, lambda s, name=name: (s.weight * getattr(s, name)) ** 2)
            squares += variance
            layers[f"sigma_{name}"][shown] = (np.sqrt(variance[shown]) / total[shown]).astype(np.float32)
        layers["sigma"][shown] = (np.sqrt(squares[shown]) / total[shown]).astype(np.float32)
        best = np.zeros(size)
        for share, good in zip(shares, kept, strict=True):
            layers["count"][share.where[good]] += 1
            better = good & (share.weight > best[share.where])
            best[share.where[better]] = share.weight[better]
            layers["image_index"][share.where[better]] = share.index
    return {name: values.reshape(shape) for name, values in layers.items()}


def _sum(shares: Sequence[Share], kept: Sequence[NDArray[np.bool_]], size: int, part) -> Array:  # type: ignore[no-untyped-def]
    total = np.zeros(size)
    for share, good in zip(shares, kept, strict=True):
        total[share.where] += np.where(good, part(share), 0.0)
    return total


def _without_outliers(shares: Sequence[Share], size: int, limit: float) -> list[NDArray[np.bool_]]:
    """Which values of each share (n,) are kept: those within `limit` sigma of the median of at least three."""
    stack = np.full((len(shares), size), np.nan, np.float32)
    for row, share in zip(stack, shares, strict=True):
        row[share.where] = share.value
    count = np.isfinite(stack).sum(axis=0)
    several = count >= 3
    kept = [np.ones(len(share.where), bool) for share in shares]
    if not several.any():
        return kept
    middle = np.full(size, np.nan)
    middle[several] = np.nanmedian(stack[:, several], axis=0)
    for good, share in zip(kept, shares, strict=True):
        sigma = np.sqrt(share.noise**2 + share.pose**2 + share.photometry**2)
        off = np.abs(share.value - middle[share.where])
        good &= ~(off > limit * sigma)  # NaN where too few are there
    return kept
