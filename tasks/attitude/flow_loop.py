"""The optical flow's inner loop, compiled by numba: every displacement of every template in one pass over the rows."""

import numpy as np
from numpy.typing import NDArray

from tasks.compiled import compiled

Found = tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_]]


@compiled
def paraboloid_peak(s: NDArray[np.float32], x: int, here: int, size: int) -> tuple[float, float]:
    """Place (x, y) of the maximum of a paraboloid through scores `s` (displacements, pixels) around displacement
    `here` of pixel x, within a step; zero where they have no maximum.

    Its mixed term matters: ridges that run across both axes draw two separate parabolas 0.1 px towards whole pixels.
    """
    middle, left, right = np.float64(s[here, x]), np.float64(s[here - 1, x]), np.float64(s[here + 1, x])
    above, below = np.float64(s[here - size, x]), np.float64(s[here + size, x])
    slope_x, slope_y = (right - left) / 2, (below - above) / 2
    xx, yy = right - 2 * middle + left, below - 2 * middle + above
    falling = np.float64(s[here + size + 1, x]) + np.float64(s[here - size - 1, x])
    rising = np.float64(s[here + size - 1, x]) + np.float64(s[here - size + 1, x])
    xy = (falling - rising) / 4
    determinant = xx * yy - xy**2
    if not (determinant > 1e-12 and xx < 0):
        return 0.0, 0.0
    dx, dy = (xy * slope_y - yy * slope_x) / determinant, (xy * slope_x - xx * slope_y) / determinant
    return min(max(dx, -1.0), 1.0), min(max(dy, -1.0), 1.0)


@compiled
def peaks_of_row(
    s: NDArray[np.float32],
    reach: int,
    displacement: NDArray[np.float32],
    correlation: NDArray[np.float32],
    inside: NDArray[np.bool_],
    best: NDArray[np.int64],
) -> None:
    """The best displacement of every pixel of a row with its sub-pixel part, its score, and whether it is off the
    search's edge. s: (displacements, nx); best: (nx,) to work in."""
    size, nx = 2 * reach + 1, s.shape[1]
    best[:] = 0
    correlation[:] = s[0]
    for d in range(1, s.shape[0]):
        for x in range(nx):
            better = s[d, x] > correlation[x]
            best[x] = d if better else best[x]
            correlation[x] = s[d, x] if better else correlation[x]
    for x in range(nx):
        row, column = best[x] // size, best[x] % size
        inside[x] = 0 < row < size - 1 and 0 < column < size - 1
        row, column = min(max(row, 1), size - 2), min(max(column, 1), size - 2)
        dx, dy = paraboloid_peak(s, x, row * size + column, size)
        displacement[x, 0] = column - reach + dx
        displacement[x, 1] = row - reach + dy


@compiled
def best_displacements(
    t: NDArray[np.float32],
    mean_t: NDArray[np.float32],
    inverse_t: NDArray[np.float32],
    f: NDArray[np.float32],
    mean_f: NDArray[np.float32],
    inverse_f: NDArray[np.float32],
    template_px: int,
    reach: int,
) -> Found:
    """Best displacement (ny, nx, 2), its normalised correlation (ny, nx), and whether it is off the search's edge.

    t: (ny, nx) simulation; f: (ny + 2 reach, nx + 2 reach) image with a rim; mean and inverse: of the template box
    around every pixel, its mean and one over its standard deviation. Boxes beyond the frame repeat its edge.
    A column of the box is kept for every displacement and pixel of the row, and moves down row by row.
    """
    ny, nx = t.shape
    size, half = 2 * reach + 1, template_px // 2
    share = 1.0 / template_px**2
    columns = np.zeros((size * size, nx), np.float64)
    scores = np.empty((size * size, nx), np.float32)
    padded = np.empty(nx + 2 * half + 1, np.float64)
    best = np.empty(nx, np.int64)
    displacement = np.empty((ny, nx, 2), np.float32)
    correlation = np.empty((ny, nx), np.float32)
    inside = np.empty((ny, nx), np.bool_)
    for y in range(-2 * half, ny):
        entering = min(max(y + half, 0), ny - 1)
        leaving = max(y - half - 1, 0)
        for d in range(size * size):
            i, j = d // size, d % size
            column = columns[d]
            t_in, f_in = t[entering], f[entering + i, j : j + nx]
            if y <= 0:
                for x in range(nx):
                    column[x] += t_in[x] * f_in[x]
            else:
                t_out, f_out = t[leaving], f[leaving + i, j : j + nx]
                for x in range(nx):
                    column[x] += np.float64(t_in[x] * f_in[x]) - np.float64(t_out[x] * f_out[x])
            if y < 0:
                continue
            padded[: half + 1] = column[0]
            padded[half + 1 : half + 1 + nx] = column
            padded[half + 1 + nx :] = column[nx - 1]
            box = padded[1 : 2 * half + 1].sum() + padded[0]
            score = scores[d]
            for x in range(nx):
                box += padded[x + 2 * half + 1] - padded[x]
                score[x] = box * share
            mean, inverse = mean_f[y + i, j : j + nx], inverse_f[y + i, j : j + nx]
            for x in range(nx):
                score[x] = (score[x] - mean_t[y, x] * mean[x]) * inverse_t[y, x] * inverse[x]
        if y >= 0:
            peaks_of_row(scores, reach, displacement[y], correlation[y], inside[y], best)
    return displacement, correlation, inside
