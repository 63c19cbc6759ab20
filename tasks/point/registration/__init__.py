"""Ways to measure the offset between an image and its simulation; one file each, one signature."""

from tasks.point.registration.base import Registration, Shift
from tasks.point.registration.ecc import register_ecc
from tasks.point.registration.features import register_features
from tasks.point.registration.intensity import register_intensity
from tasks.point.registration.least_squares import register_least_squares
from tasks.point.registration.limb import register_limb
from tasks.point.registration.ncc import register_ncc
from tasks.point.registration.phase import register_phase

REGISTRATIONS: dict[str, Registration] = {
    "ncc": register_ncc,
    "phase": register_phase,
    "intensity": register_intensity,
    "ecc": register_ecc,
    "least-squares": register_least_squares,
    "limb": register_limb,
    "features": register_features,
}

__all__ = ["REGISTRATIONS", "Registration", "Shift"]
