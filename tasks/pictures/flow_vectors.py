"""Where the map's markings lie in the image: how far each cell of the disk is from the simulation of a pose."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.pose import Pose
from tasks.attitude.flow import optical_flow
from tasks.attitude.solve import AttitudeSettings, without_shading
from tasks.compare.match import framed_window, match_scene
from tasks.pictures.product import Product

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FlowVectors:
    """xy_px (n, 2): places in the undistorted frame, one per cell. shift_px (n, 2): from simulation to image.
    correlation (n,): -1..1. places: how many pixels with markings were compared, share: how many of them matched."""

    xy_px: Array
    shift_px: Array
    correlation: Array
    places: int
    share: float


def flow_vectors(product: Product, pose: Pose, settings: AttitudeSettings | None = None) -> FlowVectors:
    """Optical flow of the markings, shading taken out as for the attitude (see `tasks.attitude`), one vector per cell
    as wide as a template: the median of those that match. Raises FailedError where the pose shows nothing."""
    settings = settings or AttitudeSettings()
    match = match_scene(product.observation, product.scene, pose, framed_window(product.scene, pose))
    image, texture, comparable = without_shading(match, settings.min_lit)
    flow = optical_flow(image, texture, comparable, settings.template_px, settings.search_px)
    good = flow.valid & (flow.correlation >= settings.min_correlation)
    places = int(flow.places.sum())
    y, x = np.nonzero(good)
    cell = (y // settings.template_px) * good.shape[1] + x // settings.template_px
    order = np.argsort(cell, kind="stable")
    starts = np.flatnonzero(np.diff(cell[order], prepend=-1))
    groups = [group for group in np.split(order, starts[1:]) if group.size] if order.size else []
    where = np.column_stack([x, y]).astype(np.float64)
    shifts = flow.displacement[good].astype(np.float64)

    def medians(values: Array) -> Array:
        return np.array([np.median(values[group], axis=0) for group in groups]).reshape(len(groups), *values.shape[1:])

    correlation = medians(flow.correlation[good].astype(np.float64))
    share = len(x) / max(places, 1)
    return FlowVectors(medians(where) + match.origin, medians(shifts), correlation, places, share)
