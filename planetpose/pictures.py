"""A plane of a cube as a picture, with the curves of its pose over it."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from tasks.project.curves import Curve, graticule, limb, terminator
from tasks.publish.cube_model import CubeModel
from tasks.publish.overlay import CORRECTED, GRID, GRID_STEP_DEG, TERMINATOR

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PERCENTILES = (2.0, 99.8)


def draw_plane(
    cube: xr.Dataset,
    model: CubeModel,
    name: str,
    layers: Sequence[str],
    axes: "Axes | None",
    imshow: Mapping[str, Any],
) -> "Axes":
    """See `CubeAccessor.plot`."""
    import matplotlib.pyplot as plt

    if axes is None:
        axes = plt.figure(figsize=(7, 7), layout="constrained").add_subplot()
    values = cube[name].values
    x, y = (np.asarray(cube[each].values, dtype=np.float64) for each in ("x", "y"))
    extent = (x[0] - 0.5, x[-1] + 0.5, y[-1] + 0.5, y[0] - 0.5)
    finite = values[np.isfinite(values)]
    limits = np.percentile(finite, PERCENTILES) if name == "image" and finite.size else (None, None)
    usual = {"cmap": "gray" if name == "image" else "viridis", "vmin": limits[0], "vmax": limits[1]}
    picture = axes.imshow(values, extent=extent, **{**usual, **imshow})
    if name != "image":
        axes.figure.colorbar(picture, ax=axes, label=f"{name}, {cube[name].attrs.get('units', '')}", shrink=0.8)
    pose, camera, target = model.pose, model.camera, model.target
    if "grid" in layers:
        for line in graticule(pose, camera, target, GRID_STEP_DEG):
            axes.plot(*_xy(model, line), **GRID)
    if "terminator" in layers:
        axes.plot(*_xy(model, terminator(pose, camera, target)), **TERMINATOR)
    if "limb" in layers:
        axes.plot(*_xy(model, limb(pose, camera, target)), **CORRECTED)
    axes.set(xlim=extent[:2], ylim=extent[2:], xlabel="x (px)", ylabel="y (px)", title=cube.attrs.get("product", ""))
    return axes


def _xy(model: CubeModel, curve: Curve) -> Any:
    return model.pixels_of(curve.visible_xy_px).T
