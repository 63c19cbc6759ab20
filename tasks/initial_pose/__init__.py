"""The pose found in the image itself, for known camera and target: see `find_pose`."""

from tasks.initial_pose.find import ImagePose, find_pose
from tasks.initial_pose.settings import ImagePoseSettings

__all__ = ["ImagePose", "ImagePoseSettings", "find_pose"]
