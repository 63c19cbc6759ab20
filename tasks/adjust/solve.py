"""A linear-Gaussian solve over many images: constants of cameras, attitude and range bias of sequences, and how far
single images scatter about them.

What image i says of (range, roll, attitude, blur) is z_i = H_i theta + e_i + noise_i. theta: per camera the logarithm
of the focal scale, roll, and logarithm of the blur; per sequence the logarithm of the range bias and a body's turn.
e_i: scatter of the image about what is shared, of unknown variance per kind, zero if the tie holds; found by restricted
maximum likelihood (Patterson and Thompson 1971, Biometrika 58, 545). Images far off weigh less (Student's t).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tasks.adjust.likelihood import KINDS, Problem
from tasks.adjust.measurement import SHARED, Measurement
from tasks.adjust.settings import AdjustSettings
from tasks.joint.parameters import ATTITUDE, OFFSET, PSF, RANGE, ROLL

Array = NDArray[np.float64]
START = OFFSET.stop
AT_RANGE, AT_ROLL, AT_PSF = RANGE - START, ROLL - START, PSF - START
AT_ATTITUDE = slice(ATTITUDE.start - START, ATTITUDE.stop - START)
FIRST_ROUNDS, ROUNDS = 6, 3


@dataclass(frozen=True)
class Adjustment:
    """cameras: names; sequences: positions of their images. theta (3 cameras + 4 sequences,): per camera logarithm of
    the focal scale, roll_deg, logarithm of the blur's factor; then per sequence logarithm of the range bias and a turn
    (3,), degrees. covariance: of theta. scatter (4,): 1-sigma of KINDS. weights (n,) of the images. chi_square,
    degrees: of the images about what they share, without scatter and at full weight; own: the same per image;
    by_kind, counts (4,): chi-square and number of measurements of each of KINDS alone, the others being left free.
    shared, shared_covariance (n, 6), (n, 6, 6): each image's unknowns after the adjustment."""

    cameras: list[str]
    sequences: list[list[int]]
    theta: Array
    covariance: Array
    scatter: Array
    weights: Array
    chi_square: float
    degrees: int
    by_kind: Array
    counts: NDArray[np.int64]
    own: Array
    ranks: NDArray[np.int64]
    shared: Array
    shared_covariance: Array

    def of_camera(self, number: int) -> slice:
        """Places of a camera's constants in theta."""
        return slice(3 * number, 3 * number + 3)

    def of_sequence(self, number: int) -> slice:
        """Places of a sequence's constants in theta."""
        start = 3 * len(self.cameras) + 4 * number
        return slice(start, start + 4)


def adjust(images: Sequence[Measurement], settings: AdjustSettings) -> Adjustment:
    """Solve for everything that `images` share. Raises ValueError without images."""
    if not images:
        raise ValueError("no images to adjust")
    cameras = sorted({image.camera.name for image in images})
    sequences = sequences_of(images, settings.gap_s)
    information = [image.information for image in images]
    problem = Problem(
        np.array([matrix for matrix, _ in information]),
        np.array([vector for _, vector in information]),
        _designs(images, cameras, sequences),
        _priors(images, cameras, sequences, settings),
    )
    weights, scatter = np.ones(len(images)), np.zeros(len(KINDS))
    # First what is far off, by the median's measure, lest it pass for scatter of all.
    for number in range(FIRST_ROUNDS + ROUNDS):
        if number >= FIRST_ROUNDS:
            scatter = problem.likeliest_scatter(weights, scatter, settings, last=number == FIRST_ROUNDS + ROUNDS - 1)
        weights = problem.weights(problem.solved(scatter, weights).theta, scatter, settings.robust_sigmas)
    solved = problem.solved(scatter, weights)
    rigid = problem.solved(np.zeros(len(KINDS)), np.ones(len(images)))
    own = problem.distances(rigid.theta, np.zeros(len(KINDS)))
    free = np.count_nonzero(problem.prior == 0)
    shared, spread = problem.images(solved, scatter, weights)
    return Adjustment(
        cameras=cameras,
        sequences=sequences,
        theta=solved.theta,
        covariance=solved.covariance,
        scatter=scatter,
        weights=weights,
        chi_square=float(own.sum() + problem.prior @ rigid.theta**2),
        degrees=int(problem.ranks.sum()) - int(free),
        by_kind=np.array([problem.chi_square_of(kind, settings) for kind in range(len(KINDS))]),
        counts=problem.counts,
        own=own,
        ranks=problem.ranks,
        shared=shared,
        shared_covariance=spread,
    )


def _designs(images: Sequence[Measurement], cameras: list[str], sequences: list[list[int]]) -> Array:
    """(n, 6, p): a longer focal length makes the disk larger, as a smaller range does."""
    design = np.zeros((len(images), len(SHARED), 3 * len(cameras) + 4 * len(sequences)))
    for number, positions in enumerate(sequences):
        place = 3 * len(cameras) + 4 * number
        design[positions, AT_RANGE, place] = 1
        for axis in range(3):
            design[positions, AT_ATTITUDE.start + axis, place + 1 + axis] = 1
    for i, image in enumerate(images):
        place = 3 * cameras.index(image.camera.name)
        design[i, AT_RANGE, place] = -1
        design[i, AT_ROLL, place + 1] = 1
        design[i, AT_PSF, place + 2] = 1
    return design


def _priors(
    images: Sequence[Measurement], cameras: list[str], sequences: list[list[int]], settings: AdjustSettings
) -> Array:
    """Inverse variances (p,) about zero: every prior counts once, for what is shared, and not once per image."""
    sigmas = [
        sigma
        for name in cameras
        for sigma in (
            settings.focal_relative,
            max(image.sigmas[ROLL] for image in images if image.camera.name == name),
            settings.psf_relative,
        )
    ]
    for positions in sequences:
        turn = max(float(images[i].sigmas[ATTITUDE].max()) for i in positions)
        sigmas += [max(images[i].range_sigma for i in positions), turn, turn, turn]
    return np.asarray(1 / np.array(sigmas) ** 2)


def sequences_of(images: Sequence[Measurement], gap_s: float) -> list[list[int]]:
    """Positions of the images of each sequence: one camera, one target, neighbours in time at most `gap_s` apart."""
    order = sorted(
        range(len(images)), key=lambda i: (images[i].camera.name, images[i].target.name, images[i].predicted.et)
    )
    found: list[list[int]] = []
    for position in order:
        if found and _follows(images[found[-1][-1]], images[position], gap_s):
            found[-1].append(position)
        else:
            found.append([position])
    return found


def _follows(earlier: Measurement, later: Measurement, gap_s: float) -> bool:
    same = (earlier.camera.name, earlier.target.name) == (later.camera.name, later.target.name)
    return same and later.predicted.et - earlier.predicted.et <= gap_s
