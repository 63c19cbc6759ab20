"""Joint: pointing, range, roll, attitude, blur and brightness of one image in one least-squares problem."""

from tasks.joint.find_pose import find_pose_jointly
from tasks.joint.settings import JointSettings

__all__ = ["JointSettings", "find_pose_jointly"]
