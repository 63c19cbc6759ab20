"""What the joint step decides by: every threshold with its unit, and where it is from.

`planetpose sensitivity` doubles and halves each of them and shows what that does to errors and their calibration
(docs/method/sensitivity.md).
"""

from typing import Any

from pydantic import BaseModel, ConfigDict, Field


def _threshold(default: Any, description: str) -> Any:
    return Field(default, gt=0, description=description)


class IterationThresholds(BaseModel):
    """When a step of the Gauss-Newton iteration is shortened, and when none is needed any more."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    largest_limb_px: float = _threshold(
        3.0,
        "Longest step of centre and limb, px; beyond it the linearisation does not hold. Choice: about two widths of "
        "the blurred limb.",
    )
    largest_turn_deg: float = _threshold(2.0, "The same of roll and orientation, degrees. Choice.")
    largest_psf: float = _threshold(0.4, "The same of the PSF's width, natural logarithm. Choice.")
    largest_trail_px: float = _threshold(1.5, "The same of a smeared exposure's trail, px. Choice.")
    still_px: float = _threshold(4e-3, "Step of the centre that need not be taken, px. Choice: well below any error.")
    still_range: float = _threshold(2e-5, "The same of the range, natural logarithm of the factor. Choice.")
    still_deg: float = _threshold(1e-2, "The same of roll and orientation, degrees. Choice.")
    still_psf: float = _threshold(5e-3, "The same of the PSF's width, natural logarithm. Choice.")
    still_trail_px: float = _threshold(0.03, "The same of the trail, px. Choice.")
    at_rest: float = _threshold(
        1.0,
        "A step of this share of its own error, 1-sigma, is the last: it is taken without looking, as the problem is "
        "linear over so little. The next one would be below 0.3 (measured on four images).",
    )
    on_the_way: float = _threshold(
        2.5,
        "Where another solution follows, the iteration ends with a step of fewer sigmas. Choice: the next one takes "
        "what is left.",
    )
    stale_px: float = _threshold(
        0.7,
        "Tiles lie still while the limb moves under them by no more, px: the cost jumps where pixels change tiles. "
        "Choice: less than the blurred limb is wide.",
    )
    learning: int = _threshold(
        4, "The variances are learned after so many steps, no more: they and the solution could alternate. Choice."
    )
    lessons: int = _threshold(
        2, "How often the variances are learned at least: where the first step is the last, at the same state. Choice."
    )
    least_parallel: float = _threshold(
        0.97, "Two steps are along one direction from this cosine on, the unknowns in units of their errors. Choice."
    )
    least_even: float = _threshold(
        0.6,
        "Along one direction, a step of this share of the one before and more is a part of a series that shrinks "
        "evenly, and its limit is tried at once. Choice: below it the next step is the last but one anyway.",
    )
    most_even: float = _threshold(0.95, "The same, at most: beyond it the limit is too uncertain. Choice.")
    huber_rounds: int = _threshold(2, "Rounds of down-weighting outliers within one linear problem. Choice.")


class PyramidThresholds(BaseModel):
    """How finely the surface is sampled, and where the second start begins."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    coarse_oversample: int = _threshold(2, "Sub-pixels per side while the solution is still on its way. Choice.")
    fine_across: float = _threshold(
        800.0,
        "Sub-pixels that the disk is across at the end: the sampling then moves the solution by less than 0.01 px "
        "(measured).",
    )
    finest_oversample: int = _threshold(8, "Sub-pixels per side, at most. Choice, for the time that it takes.")
    second_offset_px: tuple[float, float] = Field(
        (1.2, -0.9), description="Where the second start's centre lies, px (x, y) from the first. Choice."
    )
    second_limb_px: float = _threshold(0.8, "The same of its limb, px outward. Choice.")
    second_turn_deg: float = _threshold(0.3, "The same of its orientation, degrees about each axis. Choice.")
    second_diameter_px: float = _threshold(
        140.0, "The second start is solved at half of the pixels where the disk is then so many px across. Choice."
    )
    second_iterations: int = _threshold(6, "Steps of the second start, at most. Choice: it only shows where it leads.")
    disagreement_px: float = _threshold(
        0.3, "Distance of centre and limb, px, from which two starts ended in different places. Choice."
    )
    surely_worse: float = _threshold(
        16.0,
        "Difference of the cost, squares of sigmas, from which one of two ends is a false minimum: 4 sigma of one "
        "unknown.",
    )
    starts_conflict_sigmas: float = _threshold(
        5.0, "The same distance in sigmas of centre and limb, from which the result is doubtful. Choice."
    )
    range_conflict_sigmas: float = _threshold(
        4.0,
        "Difference of the free range from the metadata's, sigmas of both, from which the result is doubtful: 59 "
        "solvable scenes by another renderer were 3.5 off at most.",
    )


class VarianceThresholds(BaseModel):
    """The variance model: how far brightness and places are trusted, and which residuals are independent."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    relative: float = _threshold(0.02, "Error of the model's brightness before it is learned, relative. Choice.")
    dusk: float = _threshold(0.3, "The same at the terminator. Choice: laws differ by as much there.")
    dusk_gain: float = _threshold(
        0.05, "With tiles whose gains differ by so much, relative, 1-sigma, `dusk` holds; it falls below. Choice."
    )
    least_relative: float = _threshold(0.001, "Error of the brightness, relative, at least. Choice.")
    most_relative: float = _threshold(0.2, "The same, at most. Choice.")
    least_edge_px: float = _threshold(0.003, "Error of places in the image, px, at least. Choice: the sampling's own.")
    fewest_pixels: int = _threshold(50, "Pixels from which a variance is learned. Choice: 10 % of its root.")
    block_px: int = _threshold(8, "Side of the blocks, px, whose summed residuals show what errs together. Choice.")
    steep_share: float = _threshold(
        0.3, "Share of the pixels near the limb, the steepest, that show how well places are known. Choice."
    )
    sky_tile_px: int = _threshold(16, "Side of the squares of sky, px, whose residuals may all err together. Choice.")
    neighbours: int = _threshold(
        4, "Tiles per side whose residuals may all err together: what a map gets wrong reaches over so many. Choice."
    )
    most_lost: float = Field(
        0.5,
        gt=0,
        lt=1,
        description="Residuals are smaller than errors by what the unknowns took up of them, at most by this share. "
        "Choice: of a small disk's few groups of tiles they take all, and their number is no correction.",
    )
    limb_cover: float = _threshold(
        0.003, "Pixels that the blurred disk covers by more, and by less than one minus this, are its limb. Choice."
    )


class ContradictionThresholds(BaseModel):
    """What counts as more than chance, and what is done then."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    chance: float = _threshold(0.01, "Probability of a difference that is taken for a contradiction. Choice.")
    chance_range: float = _threshold(
        0.05,
        "The same of the free range and its prior, from which the free range's own errors are grown. The smaller, the "
        "more sigmas a wrong camera or radius may move a range that the metadata know: a focal length wrong by 1 % "
        "moved one with a prior of 0.3 % by 5.8 sigma at 0.01.",
    )
    chance_doubted: float = _threshold(
        1e-4,
        "The same of product and limb, after the errors of both were grown, that makes the result doubtful. Choice.",
    )
    limb_sky_px: float = _threshold(16.0, "Sky beside the limb that its edges are measured with, px. Choice.")
    limb_rounds: int = _threshold(4, "How often the limb is measured anew where it leads, at most. Choice.")
    limb_still_px: float = _threshold(0.03, "Step of the centre, px, after which it is not measured again. Choice.")
    led_wrong: float = _threshold(
        0.25,
        "Probability that the limb that leads is the one that is wrong, by relief or unknown optics: it led two of "
        "five simulated images of another renderer away from the truth.",
    )
    bending: float = _threshold(
        4.0,
        "Difference of disk and marks, common sigmas, from which the disk shows something else than bending: 3.3 "
        "at most among simulated images that showed one.",
    )
    bending_feigned_px: float = _threshold(
        0.05, "What map and laws may displace of a limb without a trace in the residuals, px, 1-sigma. Choice."
    )
    chance_size: float = _threshold(
        3.0,
        "A displacement whose terms exceed their noise by fewer sigmas is chance: 1 % of images without one exceed it, "
        "for eight terms of equal noise. Eight scenes with 0.3 px exceed it by 3.7 sigmas or more.",
    )
    chance_shape: float = _threshold(
        0.02,
        "Probability that a body without markings that show it is doubted by its shape alone: 23 scenes without a map "
        "have at most 0.58 of the squares that this needs, measured. Radii wrong by 1 % show 1.06 of them.",
    )
    relief_px: float = _threshold(
        0.3, "Arcs of the limb that lie off by less as a whole, px RMS, may be the optics'. Choice: as `displaced_px`."
    )
    relief_share: float = _threshold(
        0.006,
        "The same over the disk's radius: a surface as rough displaces markings, and orientations with them, by more "
        "than the eight terms of a smooth displacement say. Scenes of the honesty benchmark with a relief of 1 and 3 % "
        "that no file states show 0.004 and 0.009; their orientation is 1.4 deg off at a stated 0.9, and 6.4 at 1.2.",
    )
    relief_stated: float = _threshold(3.0, "The same over the relief that the target's file states. Choice.")
    displaced_share: float = _threshold(
        0.0025,
        "Terms of a smooth displacement, over the disk's radius, that may be a map's on a large disk (Pluto: 0.0007) "
        "and raise no doubt. Scenes whose radii are wrong by 2 % or that lost three lines show 0.0031 to 0.0052.",
    )
    linearity_laws: float = _threshold(
        0.03,
        "What laws that do not fit feign of the power of the detector's signal, 1-sigma: 0.054 at most on 18 simulated "
        "images of six laws whose own sigma was below 0.05.",
    )
    linearity_sigmas: float = _threshold(3.0, "Sigmas from which the disk shows that power. Choice.")


class OrientationThresholds(BaseModel):
    """Which orientation is the product's, and how well it is known."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    borne_out: float = _threshold(
        16.0, "Evidence (squares of sigmas) by which markings must prefer the turned body: 4 sigma. Choice."
    )
    neglected_px: float = _threshold(
        0.1, "Turns that move the middle of the disk by less, px, need no evidence. Choice."
    )
    same_share: float = _threshold(
        0.05,
        "Two orientations whose evidence differs by less than `borne_out` and this share of it are as good as each "
        "other: 0.03 at a turn of 0.3 deg on a disk of 60 px radius.",
    )
    most_stretch: float = _threshold(
        3.0, "What a small turn moves is extrapolated to the prior's sigma by no more than this. Choice."
    )
    across_px: float = _threshold(
        0.03,
        "What map and laws feign of a turn across the line of sight, px that it moves the disk's middle, 1-sigma, if "
        "the markings match perfectly: with it and `peak_px` 40 images of the honesty benchmark lie within 1 and 2 "
        "sigmas by 80 and 99 %.",
    )
    about_px: float = _threshold(
        0.02, "The same about the line of sight, px at the limb: 87 and 98 % of the same images."
    )
    peak_px: float = _threshold(
        2.5,
        "Width of the correlation's peak, px, by which its place is uncertain where markings and map correlate badly "
        "or over few measurements (see `peak_error`): of the same 40 images the worst is 3.0 sigmas off, 4.6 without.",
    )
    fewest_directions: int = _threshold(8, "Directions of a lit limb from which its outline is compared. Choice.")


class Thresholds(BaseModel):
    """All of them, by what they belong to."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    iteration: IterationThresholds = IterationThresholds()
    pyramid: PyramidThresholds = PyramidThresholds()
    variance: VarianceThresholds = VarianceThresholds()
    contradiction: ContradictionThresholds = ContradictionThresholds()
    orientation: OrientationThresholds = OrientationThresholds()
