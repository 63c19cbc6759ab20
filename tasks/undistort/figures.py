"""Pictures of a distortion: marks over the raw image, displacement and residual maps, uncertainty."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from catalog.observation import Observation
from tasks.undistort.compare import DisplacementField
from tasks.undistort.mark_set import FitReport
from tasks.undistort.model import DistortionModel
from tasks.undistort.reseau_marks import MarkState, ReseauMarks

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

# Okabe and Ito's colours; the markers differ too.
STATE_STYLE = {
    MarkState.FOUND: ("o", "#56B4E9"),
    MarkState.MISSING: ("s", "#D55E00"),
    MarkState.OUTSIDE: ("^", "#E69F00"),
    MarkState.BLANK: ("v", "#CC79A7"),
    MarkState.DARK: ("D", "#F0E442"),
}
GRID_POINTS = 25
DPI = 110


def marks_figure(observation: Observation, marks: ReseauMarks, title: str) -> "Figure":
    """The marks over the raw image: each state with its symbol, and lines from the nominal places."""
    figure, (panel,) = _figure(1, 9.0)
    _show_image(panel, observation.image)
    for state, (marker, color) in STATE_STYLE.items():
        here = marks.state == state
        if here.any():
            panel.plot(
                marks.xy[here, 0], marks.xy[here, 1], marker, color=color, markerfacecolor="none", markersize=7,
                label=f"{state.name.lower()}: {here.sum()}",
            )  # fmt: skip
    lines = np.stack([marks.nominal_xy, marks.xy], axis=1)
    for line in lines:
        panel.plot(*line.T, color="#009E73", linewidth=0.8)
    panel.set_title(f"{title}: reseau marks (lines from nominal places)")
    panel.set_xlabel("sample (0-based)")
    panel.set_ylabel("line (0-based)")
    panel.margins(0.02)
    figure.legend(loc="outside lower center", ncols=5, fontsize=9)
    return figure


def displacement_figure(model: DistortionModel, title: str) -> "Figure":
    """Undistorted minus raw places over the frame, without the best affine map, as arrows on their length."""
    figure, (panel,) = _figure(1, 8.0)
    raw, beyond_affine = _beyond_affine(model)
    length = np.linalg.norm(beyond_affine, axis=-1)
    filled = panel.contourf(raw[..., 0], raw[..., 1], length, levels=20, cmap="viridis")
    figure.colorbar(filled, ax=panel, label="px (undistorted frame)", shrink=0.8)
    _arrows(panel, raw.reshape(-1, 2), beyond_affine.reshape(-1, 2), float(length.max()))
    panel.set_title(f"{title}: {model.name}, distortion beyond the best affine map")
    _frame(panel, model.raw_size_px)
    return figure


def distortion_map_figure(model: DistortionModel, title: str) -> "Figure":
    """How far each raw pixel lies from its undistorted place (the paper's figure 2)."""
    figure, (panel,) = _figure(1, 7.0)
    raw = _grid(model.raw_size_px, 81)
    shift = model.undistort_points(raw) - raw
    outward = np.sign((shift * (raw - raw.mean(axis=(0, 1)))).sum(axis=-1))
    filled = panel.contourf(
        raw[..., 0], raw[..., 1], np.linalg.norm(shift, axis=-1) * outward, levels=24, cmap="cividis"
    )
    figure.colorbar(filled, ax=panel, label="undistorted minus raw, px (negative: inward)", shrink=0.8)
    panel.set_title(f"{title}: {model.name}")
    _frame(panel, model.raw_size_px)
    return figure


def residuals_figure(reports: Sequence[FitReport], size_px: tuple[int, int], title: str) -> "Figure":
    """Leave-one-out errors of each method at the marks: length as colour, direction as arrows; one panel each."""
    figure, panels = _figure(len(reports), 5.2)
    for panel, report in zip(panels, reports, strict=True):
        length = np.linalg.norm(report.leave_one_out, axis=1)
        limit = float(np.percentile(length, 95))
        points = panel.scatter(
            report.place[:, 0], report.place[:, 1], c=length, cmap="viridis", vmin=0, vmax=limit, s=30
        )
        figure.colorbar(points, ax=panel, label="px", shrink=0.7, extend="max")
        _arrows(panel, report.place, report.leave_one_out, limit)
        panel.set_title(
            f"{report.method}: leave-one-out {report.leave_one_out_px:.2f} rms, "
            f"{report.leave_one_out_median_px:.2f} median; RMSD {report.rmsd_px:.2f}",
            fontsize=9,
        )
        _frame(panel, size_px)
    figure.suptitle(title)
    return figure


def uncertainty_figure(plane: NDArray[np.float32], title: str) -> "Figure":
    """Expected error of the model over the undistorted frame."""
    figure, (panel,) = _figure(1, 7.5)
    shown = panel.imshow(plane, cmap="viridis", vmax=float(np.percentile(plane, 99)))
    figure.colorbar(shown, ax=panel, label="1-sigma of one coordinate, px", shrink=0.8, extend="max")
    panel.set_title(f"{title}: expected error of the distortion model")
    return figure


def comparison_figure(field: DisplacementField, image: NDArray[np.float32], title: str) -> "Figure":
    """Displacement of a second product against ours, over our undistorted image."""
    figure, (panel,) = _figure(1, 8.5)
    _show_image(panel, image)
    length = np.linalg.norm(field.shift_px, axis=1)
    limit = float(np.percentile(length, 95))
    arrows = panel.quiver(
        *field.xy.T, *field.shift_px.T, length, angles="xy", scale_units="xy", scale=max(limit, 1e-6) / 40.0,
        cmap="plasma", clim=(0, limit), width=0.003,
    )  # fmt: skip
    figure.colorbar(arrows, ax=panel, label="px", shrink=0.8, extend="max")
    panel.set_title(f"{title}: median {np.median(length):.2f} px, 95 % {limit:.2f} px")
    return figure


def _figure(panels: int, inches: float) -> "tuple[Figure, list[Axes]]":
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = min(panels, 3 if panels > 4 else 2)
    rows = -(-panels // columns)
    figure = Figure(figsize=(inches * columns, inches * rows), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    grid = list(np.atleast_1d(figure.subplots(rows, columns)).ravel())
    for spare in grid[panels:]:
        spare.set_axis_off()
    return figure, grid[:panels]


def _show_image(panel: "Axes", image: NDArray[np.float32]) -> None:
    low, high = (float(v) for v in np.percentile(image, (1.0, 99.5)))
    stretched = np.clip((image - low) / max(high - low, 1e-6), 0, 1) ** 0.5
    panel.imshow(stretched, cmap="gray", vmin=0, vmax=1)


def _arrows(panel: "Axes", at: Array, vectors: Array, longest: float) -> None:
    """Arrows of which one of length `longest` is drawn 40 px long."""
    panel.quiver(
        *at.T, *vectors.T, angles="xy", scale_units="xy", scale=max(longest, 1e-9) / 40.0, color="white",
        edgecolor="black", linewidth=0.4, width=0.003,
    )  # fmt: skip


def _frame(panel: "Axes", size_px: tuple[int, int]) -> None:
    panel.set_xlim(-0.5, size_px[0] - 0.5)
    panel.set_ylim(size_px[1] - 0.5, -0.5)
    panel.set_aspect("equal")


def _grid(size_px: tuple[int, int], points: int) -> Array:
    x, y = (np.linspace(0.0, n - 1.0, points) for n in size_px)
    return np.stack(np.meshgrid(x, y), axis=-1)


def _beyond_affine(model: DistortionModel) -> tuple[Array, Array]:
    raw = _grid(model.raw_size_px, GRID_POINTS)
    flat = raw.reshape(-1, 2)
    undistorted = model.undistort_points(flat)
    design = np.column_stack([flat, np.ones(len(flat))])
    beyond = undistorted - design @ np.linalg.lstsq(design, undistorted, rcond=None)[0]
    return raw, beyond.reshape(raw.shape)
