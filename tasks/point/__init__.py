"""Point: correct where the camera looks (paper, section 3.1)."""

from tasks.point.loop import PointSettings, find_pointing

__all__ = ["PointSettings", "find_pointing"]
