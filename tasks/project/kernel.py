"""The projection's inner loop, compiled by numba: short loops over one row of pixels that the compiler can vectorise.

It holds no lock of the interpreter (nogil), so `planes` runs blocks of rows in plain threads: no OpenMP, which would
make forks and concurrent callers unsafe and the compilation several times longer.
"""

import math

import numpy as np

from tasks.compiled import compiled
from tasks.geometry.arctangent import atan2_deg
from tasks.geometry.unit_sphere import first_hit


@compiled
def _angle_deg(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> float:
    """Angle between two vectors of any length, exact also near 0 and 180."""
    cx, cy, cz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    return atan2_deg(math.sqrt(cx * cx + cy * cy + cz * cz), ax * bx + ay * by + az * bz)


@compiled
def _intersect_row(anchor, backward, spacecraft, radii, dx, dy, px, py, pz):  # type: ignore[no-untyped-def]
    """Points (3, n) km of one row's pixels; NaN off the body. See `unit_sphere.first_hit`."""
    gx0 = anchor[0, 0] + anchor[0, 2] * dy
    gy0 = anchor[1, 0] + anchor[1, 2] * dy
    gz0 = anchor[2, 0] + anchor[2, 2] * dy
    qx0 = backward[0, 0] + backward[0, 2] * dy
    qy0 = backward[1, 0] + backward[1, 2] * dy
    qz0 = backward[2, 0] + backward[2, 2] * dy
    gx1, gy1, gz1 = anchor[0, 1], anchor[1, 1], anchor[2, 1]
    qx1, qy1, qz1 = backward[0, 1], backward[1, 1], backward[2, 1]
    sx, sy, sz = spacecraft[0], spacecraft[1], spacecraft[2]
    rx, ry, rz = radii[0], radii[1], radii[2]
    for i in range(px.size):
        x = dx + i
        gx, gy, gz = gx0 + gx1 * x, gy0 + gy1 * x, gz0 + gz1 * x
        qx, qy, qz = qx0 + qx1 * x, qy0 + qy1 * x, qz0 + qz1 * x
        cx, cy, cz = first_hit(gx, gy, gz, qx, qy, qz, sx, sy, sz)
        px[i], py[i], pz[i] = rx * cx, ry * cy, rz * cz


@compiled
def _latitude_row(px, py, pz, out):  # type: ignore[no-untyped-def]
    for i in range(out.size):
        out[i] = atan2_deg(pz[i], math.sqrt(px[i] * px[i] + py[i] * py[i]))


@compiled
def _longitude_row(px, py, out):  # type: ignore[no-untyped-def]
    for i in range(out.size):
        longitude = atan2_deg(py[i], px[i])
        longitude = (longitude + 360.0) if longitude < 0.0 else longitude
        out[i] = 0.0 if longitude >= 360.0 else longitude


@compiled
def _zenith_angle_row(px, py, pz, inverse_radii2, toward, out):  # type: ignore[no-untyped-def]
    """Angle between the ellipsoid's outward normal and the direction to `toward` (3,) km."""
    ux, uy, uz = inverse_radii2[0], inverse_radii2[1], inverse_radii2[2]
    tx, ty, tz = toward[0], toward[1], toward[2]
    for i in range(out.size):
        x, y, z = px[i], py[i], pz[i]
        out[i] = _angle_deg(x * ux, y * uy, z * uz, tx - x, ty - y, tz - z)


@compiled
def _emission_row(px, py, pz, inverse_radii2, apparent, dx, dy, out):  # type: ignore[no-untyped-def]
    """Angle between the ellipsoid's outward normal and the direction from which the camera sees the point."""
    ux, uy, uz = inverse_radii2[0], inverse_radii2[1], inverse_radii2[2]
    vx0, vx1 = apparent[0, 0] + apparent[0, 2] * dy, apparent[0, 1]
    vy0, vy1 = apparent[1, 0] + apparent[1, 2] * dy, apparent[1, 1]
    vz0, vz1 = apparent[2, 0] + apparent[2, 2] * dy, apparent[2, 1]
    for i in range(out.size):
        x = dx + i
        vx, vy, vz = -vx0 - vx1 * x, -vy0 - vy1 * x, -vz0 - vz1 * x
        out[i] = _angle_deg(px[i] * ux, py[i] * uy, pz[i] * uz, vx, vy, vz)


@compiled
def _phase_row(px, py, pz, apparent, dx, dy, sun, out):  # type: ignore[no-untyped-def]
    bx, by, bz = sun[0], sun[1], sun[2]
    vx0, vx1 = apparent[0, 0] + apparent[0, 2] * dy, apparent[0, 1]
    vy0, vy1 = apparent[1, 0] + apparent[1, 2] * dy, apparent[1, 1]
    vz0, vz1 = apparent[2, 0] + apparent[2, 2] * dy, apparent[2, 1]
    for i in range(out.size):
        x = dx + i
        vx, vy, vz = -vx0 - vx1 * x, -vy0 - vy1 * x, -vz0 - vz1 * x
        out[i] = _angle_deg(vx, vy, vz, bx - px[i], by - py[i], bz - pz[i])


@compiled
def _range_row(px, py, pz, spacecraft, scale, out):  # type: ignore[no-untyped-def]
    ax, ay, az = spacecraft[0], spacecraft[1], spacecraft[2]
    for i in range(out.size):
        x, y, z = ax - px[i], ay - py[i], az - pz[i]
        out[i] = scale * math.sqrt(x * x + y * y + z * z)


@compiled
def _turned_by_light_time_row(px, py, pz, spacecraft, sight, out):  # type: ignore[no-untyped-def]
    """Longitudes turned by what the body turned while light passed from each point to the centre's distance."""
    ax, ay, az = spacecraft[0], spacecraft[1], spacecraft[2]
    scale, range_km, turn_deg_per_km = sight[0], sight[1], sight[2]
    for i in range(out.size):
        x, y, z = ax - px[i], ay - py[i], az - pz[i]
        longitude = out[i] + turn_deg_per_km * (scale * math.sqrt(x * x + y * y + z * z) - range_km)
        longitude = (longitude + 360.0) if longitude < 0.0 else longitude
        out[i] = (longitude - 360.0) if longitude >= 360.0 else longitude


@compiled
def _resolution_row(px, py, pz, spacecraft, scale, inverse_radii2, focal_length_px, out):  # type: ignore[no-untyped-def]
    """Range / focal length / cosine between normal and line of sight, the cosine as (n . v) / (|n| |v|)."""
    ux, uy, uz = inverse_radii2[0], inverse_radii2[1], inverse_radii2[2]
    ax, ay, az = spacecraft[0], spacecraft[1], spacecraft[2]
    for i in range(out.size):
        nx, ny, nz = px[i] * ux, py[i] * uy, pz[i] * uz
        vx, vy, vz = ax - px[i], ay - py[i], az - pz[i]
        normal = scale * math.sqrt(nx * nx + ny * ny + nz * nz)
        out[i] = (vx * vx + vy * vy + vz * vz) * normal / (focal_length_px * (nx * vx + ny * vy + nz * vz))


@compiled
def _columns_on_body(conic, dx, dy, n):  # type: ignore[no-untyped-def]
    """First and past-last column of a row that may hit the body, from the limb's conic; all when it is no ellipse."""
    a, b = conic[1, 1], 2.0 * (conic[0, 1] + conic[1, 2] * dy)
    c = conic[0, 0] + (2.0 * conic[0, 2] + conic[2, 2] * dy) * dy
    if not a < 0.0:
        return 0, n
    root = b * b - 4.0 * a * c
    if root < 0.0:
        return 0, 0
    middle, half = -b / (2.0 * a) - dx, math.sqrt(root) / (-2.0 * a)
    first = min(max(math.floor(middle - half) - 1.0, 0.0), n)
    last = min(max(math.ceil(middle + half) + 2.0, first), n)
    return int(first), int(last)


@compiled
def fill_rows(  # type: ignore[no-untyped-def]
    anchor, backward, apparent, conic, radii, spacecraft, sun, sight, focal_length_px, dx, dy, slots, rows, out
):
    """Fill rows[0] to rows[1] of `out` (planes, ny, nx) for pixels at (dx + column, dy + row) from the rays' reference.

    anchor, backward, apparent, conic: as in `rays.Rays`. radii, spacecraft, sun: (3,) km, body-fixed. sight: (3,)
    range_scale, range_km and turn_deg_per_km of `sight.Sight`. slots: (10,), the index in
    `out` of each of `planes.KNOWN_PLANES`; -1 for those not requested.
    """
    columns = out.shape[2]
    spacecraft_radii = spacecraft / radii
    inverse_radii2 = 1.0 / (radii * radii)
    x_km, y_km, z_km = np.empty(columns), np.empty(columns), np.empty(columns)
    for row in range(rows[0], rows[1]):
        first, last = _columns_on_body(conic, dx, dy + row, columns)
        out[:, row, :first] = np.nan
        out[:, row, last:] = np.nan
        if last <= first:
            continue
        n = last - first
        px, py, pz = x_km[:n], y_km[:n], z_km[:n]
        _intersect_row(anchor, backward, spacecraft_radii, radii, dx + first, dy + row, px, py, pz)
        if slots[0] >= 0:
            _latitude_row(px, py, pz, out[slots[0], row, first:last])
        if slots[1] >= 0:
            _longitude_row(px, py, out[slots[1], row, first:last])
            if sight[2] != 0.0:
                _turned_by_light_time_row(px, py, pz, spacecraft, sight, out[slots[1], row, first:last])
        if slots[2] >= 0:
            _zenith_angle_row(px, py, pz, inverse_radii2, sun, out[slots[2], row, first:last])
        if slots[3] >= 0:
            _emission_row(px, py, pz, inverse_radii2, apparent, dx + first, dy + row, out[slots[3], row, first:last])
        if slots[4] >= 0:
            _phase_row(px, py, pz, apparent, dx + first, dy + row, sun, out[slots[4], row, first:last])
        if slots[5] >= 0:
            _range_row(px, py, pz, spacecraft, sight[0], out[slots[5], row, first:last])
        if slots[6] >= 0:
            to = out[slots[6], row, first:last]
            _resolution_row(px, py, pz, spacecraft, sight[0], inverse_radii2, focal_length_px, to)
        if slots[7] >= 0:
            out[slots[7], row, first:last] = px
        if slots[8] >= 0:
            out[slots[8], row, first:last] = py
        if slots[9] >= 0:
            out[slots[9], row, first:last] = pz
