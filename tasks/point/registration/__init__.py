"""Ways to measure the offset between an image and its simulation; one file each, one signature."""

from tasks.point.registration.base import Match, Registration, Shift
from tasks.point.registration.intensity import register_intensity

REGISTRATIONS: dict[str, Registration] = {"intensity": register_intensity}

__all__ = ["REGISTRATIONS", "Match", "Registration", "Shift"]
