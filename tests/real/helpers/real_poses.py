"""Pose files for real images that lack one: those that the report uses too."""

from lab.paper.real_images import orientation_of_f1636832, rough_pose_of_enceladus

__all__ = ["orientation_of_f1636832", "rough_pose_of_enceladus"]
