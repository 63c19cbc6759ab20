"""Simulate: what the camera would have seen if the pose were true (section 3.1 of the paper)."""

from tasks.simulate.scene import Scene, SceneSettings, Simulation

__all__ = ["Scene", "SceneSettings", "Simulation"]
