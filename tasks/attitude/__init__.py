"""Attitude: correct how the target is turned (paper, section 5)."""

from tasks.attitude.solve import AttitudeSettings, find_attitude

__all__ = ["AttitudeSettings", "find_attitude"]
