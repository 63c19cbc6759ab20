"""Cosines of incidence and emission along a row of points on an ellipsoid, compiled by numba."""

import math

from tasks.compiled import compiled_reordered


@compiled_reordered
def emission_cosines(px, py, pz, u0, step, sight0, sight_u, radii, out):  # type: ignore[no-untyped-def]
    """Fill `out` (n,) with the cosine of emission, 0 where the surface looks away, at body-fixed points px, py, pz (n
    or more,). Column j is seen along sight0 + (u0 + j step) sight_u, (3,) each, in the frame whose axes are scaled by
    `radii` (3,) km so that the target is the unit sphere."""
    rx, ry, rz = radii[0], radii[1], radii[2]
    inverse2_x, inverse2_y, inverse2_z = 1 / (rx * rx), 1 / (ry * ry), 1 / (rz * rz)
    vx, vy, vz = sight0
    ux, uy, uz = sight_u
    for j in range(len(out)):
        u = u0 + j * step
        ex, ey, ez = (vx + ux * u) * rx, (vy + uy * u) * ry, (vz + uz * u) * rz
        nx, ny, nz = px[j] * inverse2_x, py[j] * inverse2_y, pz[j] * inverse2_z
        length2 = (nx * nx + ny * ny + nz * nz) * (ex * ex + ey * ey + ez * ez)
        out[j] = max(-(nx * ex + ny * ey + nz * ez) / math.sqrt(length2), 0.0)


@compiled_reordered
def incidence_cosines(px, py, pz, sun, radii, out):  # type: ignore[no-untyped-def]
    """The same with the cosine of incidence, 0 at night. sun (3,): unit vector towards the Sun, body-fixed."""
    rx, ry, rz = radii[0], radii[1], radii[2]
    inverse2_x, inverse2_y, inverse2_z = 1 / (rx * rx), 1 / (ry * ry), 1 / (rz * rz)
    for j in range(len(out)):
        nx, ny, nz = px[j] * inverse2_x, py[j] * inverse2_y, pz[j] * inverse2_z
        incidence = (nx * sun[0] + ny * sun[1] + nz * sun[2]) / math.sqrt(nx * nx + ny * ny + nz * nz)
        out[j] = max(incidence, 0.0)
