"""Geometry that several steps share, each piece once: a line of sight and the ellipsoid, a value between pixels."""
