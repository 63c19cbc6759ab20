"""The inner loop of the projection onto a shape model, compiled by numba: pixels that know their triangle meet it."""

import numpy as np

from tasks.compiled import compiled


@compiled
def meet_faces(xy_px, faces, vertices, corners, spacecraft, body, apparent, centre_px, focal_length_px, out):  # type: ignore[no-untyped-def]
    """Fill out (9, n) with the point, the outward normal and the direction to the camera of each pixel.

    xy_px: (n, 2). faces: (n,), index into corners (f, 3), which are indices into vertices (v, 3) km. spacecraft: (3,)
    km. body, apparent: (3, 3), `sight.Sight`'s maps from (x, y, 1). The outside is the side that is seen.
    """
    for i in range(faces.size):
        x = (xy_px[i, 0] - centre_px[0]) / focal_length_px
        y = (xy_px[i, 1] - centre_px[1]) / focal_length_px
        p, q, r = corners[faces[i], 0], corners[faces[i], 1], corners[faces[i], 2]
        ax, ay, az = vertices[p, 0], vertices[p, 1], vertices[p, 2]
        bx, by, bz = vertices[q, 0] - ax, vertices[q, 1] - ay, vertices[q, 2] - az
        cx, cy, cz = vertices[r, 0] - ax, vertices[r, 1] - ay, vertices[r, 2] - az
        nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        dx = body[0, 0] * x + body[0, 1] * y + body[0, 2]
        dy = body[1, 0] * x + body[1, 1] * y + body[1, 2]
        dz = body[2, 0] * x + body[2, 1] * y + body[2, 2]
        towards = nx * dx + ny * dy + nz * dz
        to_plane = nx * (ax - spacecraft[0]) + ny * (ay - spacecraft[1]) + nz * (az - spacecraft[2])
        along = to_plane / towards if towards != 0.0 else np.nan
        outward = -1.0 if towards > 0.0 else 1.0
        out[0, i] = spacecraft[0] + along * dx
        out[1, i] = spacecraft[1] + along * dy
        out[2, i] = spacecraft[2] + along * dz
        out[3, i], out[4, i], out[5, i] = outward * nx, outward * ny, outward * nz
        out[6, i] = -(apparent[0, 0] * x + apparent[0, 1] * y + apparent[0, 2])
        out[7, i] = -(apparent[1, 0] * x + apparent[1, 1] * y + apparent[1, 2])
        out[8, i] = -(apparent[2, 0] * x + apparent[2, 1] * y + apparent[2, 2])
