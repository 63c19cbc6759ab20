"""Roll: how far the camera is turned about its line of sight (the paper leaves it to the target's attitude)."""

from tasks.roll.solve import RollSettings, find_roll

__all__ = ["RollSettings", "find_roll"]
