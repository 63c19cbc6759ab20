"""Limb segments: short rows or columns of pixels across the lit limb (paper, section 4.2, figures 14-18)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.pose import Pose
from tasks.project.curves import limb
from tasks.simulate import Scene

Array = NDArray[np.float64]
LIMB_POINTS = 2880


@dataclass(frozen=True)
class Segments:
    """n segments across the predicted limb. horizontal: (n,) along a row, else along a column. line: (n,) the integer
    row (or column) they lie in. crossing: (n,) where the limb crosses it, px. normal: (n, 2) outward unit normals.
    incidence_deg: (n,) on the limb, for choosing the lit ones."""

    horizontal: NDArray[np.bool_]
    line: NDArray[np.int64]
    crossing: Array
    normal: Array
    incidence_deg: Array

    def chosen(self, mask: NDArray[np.bool_]) -> "Segments":
        """The segments where mask (n,) holds."""
        return Segments(*(getattr(self, name)[mask] for name in self.__dataclass_fields__))

    def __len__(self) -> int:
        return len(self.line)

    @property
    def xy_px(self) -> Array:
        """Where limb and segment cross, (n, 2)."""
        x = np.where(self.horizontal, self.crossing, self.line)
        y = np.where(self.horizontal, self.line, self.crossing)
        return np.stack([x, y], axis=-1)


def limb_segments(pose: Pose, scene: Scene) -> Segments:
    """Segments at every row and column where the limb is crossed less tangentially by a row, or by a column."""
    curve = limb(pose, scene.camera, scene.target, LIMB_POINTS)
    xy = curve.xy_px
    centre = scene.camera.project(pose.target_in_camera_km)
    normals = curve.points_km / np.square(scene.target.radii_km)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    incidence = np.degrees(np.arccos(np.clip(normals @ pose.sun_direction_in_body, -1, 1)))
    after = np.roll(xy, -1, axis=0)
    tangent = np.roll(xy, -1, axis=0) - np.roll(xy, 1, axis=0)
    normal = np.stack([tangent[:, 1], -tangent[:, 0]], axis=-1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    normal *= np.sign(np.einsum("ij,ij->i", normal, xy - centre))[:, None]
    parts = [crossings(xy, after, normal, incidence, horizontal) for horizontal in (True, False)]
    return Segments(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def crossings(xy: Array, after: Array, normal: Array, incidence_deg: Array, horizontal: bool) -> tuple[NDArray, ...]:
    """Columns of `Segments` for one direction: where consecutive limb points pass an integer row (or column)."""
    along, across = (0, 1) if horizontal else (1, 0)
    steep = np.abs(normal[:, along]) >= np.abs(normal[:, across])
    first, last = np.floor(xy[:, across]), np.floor(after[:, across])
    index = np.nonzero(steep & (first != last) & np.isfinite(xy).all(axis=1) & np.isfinite(after).all(axis=1))[0]
    line = np.maximum(first[index], last[index])
    step = after[index, across] - xy[index, across]
    fraction = (line - xy[index, across]) / step
    crossing = xy[index, along] + fraction * (after[index, along] - xy[index, along])
    flags = np.full(index.size, horizontal)
    return flags, line.astype(np.int64), crossing, normal[index], incidence_deg[index]


def profiles(image: Array, segments: Segments, origin: tuple[int, int], half_px: int) -> Array:
    """Values (n, 2*half+1) of `image` (ny, nx; its first pixel is `origin` of the frame) along each segment, centred
    on the pixel nearest the crossing; NaN outside."""
    nearest = np.rint(segments.crossing).astype(np.int64)
    steps = nearest[:, None] + np.arange(-half_px, half_px + 1)
    lines = np.broadcast_to(segments.line[:, None], steps.shape)
    x = np.where(segments.horizontal[:, None], steps, lines) - origin[0]
    y = np.where(segments.horizontal[:, None], lines, steps) - origin[1]
    inside = (x >= 0) & (y >= 0) & (x < image.shape[1]) & (y < image.shape[0])
    values = image[np.clip(y, 0, image.shape[0] - 1), np.clip(x, 0, image.shape[1] - 1)].astype(np.float64)
    return np.where(inside, values, np.nan)
