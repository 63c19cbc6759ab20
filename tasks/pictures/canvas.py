"""What all pictures share: canvas, colours that colour-blind eyes tell apart, the stretch of an image."""

import threading
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito (2008).
BLUE, ORANGE, GREEN, RED, SKY, PINK, YELLOW = (
    "#0072B2",
    "#E69F00",
    "#009E73",
    "#D55E00",
    "#56B4E9",
    "#CC79A7",
    "#F0E442",
)
CYCLE = (BLUE, ORANGE, GREEN, RED, PINK, SKY, "#000000")
DPI = 110
GAMMA = 0.65

DRAWING = threading.Lock()  # matplotlib's font machinery is not made for threads


def canvas(rows: int, columns: int, panel_inches: tuple[float, float]) -> "tuple[Figure, list[Axes]]":
    """An Agg figure of rows x columns panels, in reading order."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    width, height = panel_inches
    figure = Figure(figsize=(width * columns, height * rows), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, list(np.atleast_1d(figure.subplots(rows, columns)).ravel())


def show_image(panel: "Axes", image: NDArray, origin: tuple[int, int] = (0, 0)) -> None:
    """An image (ny, nx) in grey, stretched to its 0.5-99.7 % range, its first pixel at frame pixel `origin`."""
    low, high = (float(v) for v in np.nanpercentile(image, (0.5, 99.7)))
    stretched = np.clip((image - low) / max(high - low, 1e-9), 0, 1) ** GAMMA
    ny, nx = image.shape
    extent = (origin[0] - 0.5, origin[0] + nx - 0.5, origin[1] + ny - 0.5, origin[1] - 0.5)
    panel.imshow(stretched, cmap="gray", vmin=0, vmax=1, extent=extent, interpolation="nearest")


def bare(panel: "Axes") -> None:
    """No upper and right border."""
    panel.spines[["top", "right"]].set_visible(False)
