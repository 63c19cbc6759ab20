"""How an image changes with the trail of a boresight that drifted during the exposure (see `tasks.simulate.trail`)."""

import numpy as np

from tasks.simulate.trail import Image, Trail, smeared

# Half of the difference, px, from which the image's change with the trail is taken.
STEP_PX = 0.25


def trail_columns(sharp: Image, trail_px: Trail) -> Image:
    """Change per pixel of the trail's x and y (2, ny, nx) of the image that is `sharp` (ny, nx) without it."""
    changes = []
    for x, y in ((STEP_PX, 0.0), (0.0, STEP_PX)):
        more, less = (smeared(sharp, (trail_px[0] + sign * x, trail_px[1] + sign * y)) for sign in (1, -1))
        changes.append((more - less) / np.float32(2 * STEP_PX))
    return np.stack(changes)
