"""A registration and a photometric law."""

import numpy as np

from planetpose import Match, Shift


def register_centroid(match: Match) -> Shift:
    """How far the centroid of the image's brightness lies from that of the simulation's."""
    simulated = match.simulation.image()
    dark = match.simulation.coverage == 0
    image = np.where(match.usable, match.image - np.median(match.image[dark & match.usable]), 0.0)
    ys, xs = np.mgrid[: image.shape[0], : image.shape[1]]

    def centroid(picture):
        return np.array([(picture * xs).sum(), (picture * ys).sum()]) / picture.sum()

    return Shift(centroid(image) - centroid(simulated), None, 1, 1.0)


def flat(mu0, mu, phase_deg):
    """A surface whose brightness does not depend on how it is seen: sqrt(mu0)."""
    return np.sqrt(np.maximum(mu0, 0.0))
