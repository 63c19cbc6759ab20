"""Validate: compare image and simulation on the lit limb (paper, section 4.2)."""

from tasks.validate.limb import LimbReport, ValidateSettings, validate_limb

__all__ = ["LimbReport", "ValidateSettings", "validate_limb"]
