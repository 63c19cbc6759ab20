"""Ways to measure the offset between an image and its simulation; one file each, one signature."""

from functools import cache
from typing import Annotated

import numpy as np

from catalog.choice import Choice
from catalog.plugins import REGISTRATIONS as GROUP
from catalog.plugins import Plugin, plugin_named
from tasks.compare.match import Match
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

RegistrationName = Annotated[str, Choice("registration", GROUP, tuple(REGISTRATIONS))]

__all__ = ["REGISTRATIONS", "Registration", "RegistrationName", "Shift", "find_registration"]


def find_registration(name: str) -> Registration:
    """The registration of this name, ours or a plugin's. Raises KeyError for an unknown one."""
    return REGISTRATIONS[name] if name in REGISTRATIONS else _plugged(name)


@cache
def _plugged(name: str) -> Registration:
    """A plugin's registration; what it gives is checked, and its faults name it."""
    plugin = plugin_named(GROUP, name)
    if plugin is None:
        raise KeyError(name)
    return _checked(plugin, plugin.load())


def _checked(plugin: Plugin, register: Registration) -> Registration:
    def checked(match: Match) -> Shift:
        with plugin.guarded("fails"):
            shift = register(match)
        if not isinstance(shift, Shift):
            raise plugin.fault(f"gives {type(shift).__name__} instead of a Shift")
        if np.shape(shift.offset_px) != (2,) or not np.isfinite(shift.offset_px).all():
            raise plugin.fault(f"gives the offset {shift.offset_px!r} instead of two finite pixels")
        return shift

    return checked
