"""Ways to measure the offset between an image and its simulation; one file each, one signature."""

from tasks.point.registration.base import Registration, Shift
from tasks.point.registration.intensity import register_intensity
from tasks.point.registration.limb import register_limb

REGISTRATIONS: dict[str, Registration] = {"intensity": register_intensity, "limb": register_limb}

__all__ = ["REGISTRATIONS", "Registration", "Shift"]
