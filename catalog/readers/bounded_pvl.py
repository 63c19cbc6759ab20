"""The bounded PVL parser under its earlier name; it is `catalog.bounded_pvl`."""

from catalog.bounded_pvl import MAX_LABEL_BYTES, PARSER_FAULTS, check_size, load_pvl

__all__ = ["MAX_LABEL_BYTES", "PARSER_FAULTS", "check_size", "load_pvl"]
