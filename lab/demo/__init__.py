"""A small archive with planted errors, simulated and corrected: `planetpose demo`."""
