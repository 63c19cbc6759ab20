"""Frames with several bodies: an independent ray caster, scenes of occultations, transits, shadows and rings, and how
well the corrections do on them.
"""
