"""Range: correct the distance to the target (paper, section 3.2)."""

from tasks.range.solve import RangeSettings, find_range

__all__ = ["RangeSettings", "find_range"]
