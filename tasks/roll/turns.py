"""The two turns about the line of sight: of the camera, which carries everything along, and of the target alone."""

from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg


def camera_rolled(pose: Pose, angle_deg: float) -> Pose:
    """Pose whose camera sees target, Sun and sky turned by `angle_deg` about the line of sight to the target, from +x
    towards +y of the picture; the target's centre stays."""
    sight = pose.target_in_camera_km / pose.range_km
    return pose.replaced(camera_from_j2000=rotation_from_vector_deg(angle_deg * sight) @ pose.camera_from_j2000)


def target_turned(pose: Pose, angle_deg: float) -> Pose:
    """Pose whose target is turned by `angle_deg` about the line of sight, from +x towards +y of the picture, under the
    same Sun."""
    sight = pose.target_from_spacecraft_km / pose.range_km
    return pose.replaced(body_from_j2000=pose.body_from_j2000 @ rotation_from_vector_deg(-angle_deg * sight))
