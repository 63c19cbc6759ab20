"""Adjust: what images of one sequence and of one camera share, solved together from their joint results."""

from tasks.adjust.settings import AdjustSettings
from tasks.adjust.solve import Adjustment, adjust

__all__ = ["AdjustSettings", "Adjustment", "adjust"]
