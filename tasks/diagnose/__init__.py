"""Diagnose: why an image has no corrected pose, by trying what else would explain it."""

from tasks.diagnose.settings import DiagnoseSettings
from tasks.diagnose.trials import Explanation, Tried, tried

__all__ = ["DiagnoseSettings", "Explanation", "Tried", "tried"]
