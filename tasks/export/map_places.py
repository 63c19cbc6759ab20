"""What a map says of each of its places beside image and angles: coordinates, their errors, and the flags of the pixel
that shows it."""

import json

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Quality
from tasks.export.source import Source
from tasks.project.points import surface_points
from tasks.project.uncertainty import NEEDED, PoseUncertainty, coordinate_sigmas

Array = NDArray[np.float64]
PLACES = ("latitude", "longitude", "latitude_uncertainty", "longitude_uncertainty", "quality")
REACH_PX = 1.5  # of the undistorted frame: a place with no raw pixel nearer than that is shown by none


class MapPlaces:
    """A product's pixels, addressed as those of a map."""

    def __init__(self, source: Source) -> None:
        self.source = source
        stated = json.loads(source.attributes.get("uncertainty", "{}"))
        self.uncertainty = PoseUncertainty.from_dict(stated) if "covariance" in stated else None
        self.quality = source.cube["quality"].values
        self.place_px = source.cube["distortion_uncertainty"].values
        self.tree, self.known = None, np.empty(0, np.intp)
        if source.on_detector:
            from scipy.spatial import KDTree

            places = np.stack([source.cube[name].values.ravel() for name in ("place_x", "place_y")], axis=-1)
            self.known = np.flatnonzero(np.isfinite(places).all(axis=-1))
            self.tree = KDTree(places[self.known].astype(np.float64))

    def layers(self, latitude_deg: Array, longitude_deg: Array, x_px: Array, y_px: Array) -> dict[str, Array]:
        """PLACES (rows, columns) of places that are seen at pixels of the undistorted frame; NaN where those are, and
        errors where the product states none. Errors are of the place that the pixel there shows, as the cube's planes
        of that name are."""
        shown = np.isfinite(x_px)
        found = {name: np.full(shown.shape, np.nan) for name in PLACES}
        found["latitude"][shown], found["longitude"][shown] = latitude_deg[shown], longitude_deg[shown]
        pixel, near = self._nearest(x_px[shown], y_px[shown])
        found["quality"][shown] = np.where(near, self.quality.flat[pixel], Quality.MISSING)
        if self.uncertainty is not None and len(self.uncertainty.not_included) < len(NEEDED) and shown.any():
            target = self.source.target
            points = surface_points(target, latitude_deg[shown], longitude_deg[shown])
            place = np.where(near, np.nan_to_num(self.place_px.flat[pixel]), 0.0)
            sigmas = coordinate_sigmas(self.source.pose, self.source.camera, target, self.uncertainty, points.T, place)
            found["latitude_uncertainty"][shown], found["longitude_uncertainty"][shown] = sigmas
        return found

    def _nearest(self, x_px: Array, y_px: Array) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
        """Numbers (n,) of the cube's pixels nearest to places of the undistorted frame, and whether they are near."""
        if self.tree is None:
            ny, nx = self.quality.shape
            column, row = np.clip(np.rint(x_px), 0, nx - 1), np.clip(np.rint(y_px), 0, ny - 1)
            return (row * nx + column).astype(np.intp), np.ones(len(x_px), bool)
        distance, number = self.tree.query(np.stack([x_px, y_px], axis=-1), distance_upper_bound=REACH_PX)
        near = np.isfinite(distance)
        return self.known[np.where(near, number, 0)], near
