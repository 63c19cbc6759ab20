"""The honesty benchmark: images rendered by something that is not the estimator, corrected as users would correct
them, and every verdict and stated error compared with the truth.

Nothing here uses the estimator's own rendering, geometry or photometry: laws, ray caster, optics and detector are
written a second time, and `tests/lab/test_honesty.py` tests them against SPICE and for bias.
"""
