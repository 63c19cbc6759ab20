"""Offset from the lit limb alone, image against simulation, segment by segment."""

from tasks.compare.brightness import correlation
from tasks.compare.limb_edges import LimbSettings, measure_limb
from tasks.compare.limb_fit import fit_limb
from tasks.compare.match import Match
from tasks.point.registration.base import Shift
from tasks.simulate.window import disk_radius_px

SETTINGS = LimbSettings()


def register_limb(match: Match) -> Shift:
    """Offset that puts the simulated limb on the image's (see `fit_limb`), the disk's size held.

    Neither markings nor the brightness of the disk enter, so that errors of the map, the photometric law and the
    attitude do not; it must start within the segments' reach. Raises FailedError when too little limb is measured.
    """
    edges = measure_limb(match, SETTINGS)
    needed = SETTINGS.points_needed(disk_radius_px(match.pose, match.scene.camera, match.scene.target))
    fit = fit_limb(edges, match.centre_px + match.origin, solve_growth=False, min_points=needed)
    return Shift(fit.offset_px, fit.covariance[:2, :2], 1, correlation(match.image, edges.model, match.usable))
