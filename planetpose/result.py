"""What a correction gives, as `planetpose correct --json` prints it."""

from typing import Any, Literal, TypedDict

Pair = list[float]


class Guidance(TypedDict):
    """How the user helped or overruled."""

    start_offset_px: Pair | None
    held: list[str]
    mask: str | None
    flip: str | None
    plane: str | None
    summing: int | None
    window: list[int] | None
    bodies: list[str]
    resumed_from: str | None
    overruled: list[str]


class Uncertainty(TypedDict):
    """1-sigma of the values of the same names; None where it is unknown."""

    centre_px: Pair | None
    offset_px: Pair | None
    range_factor: float | None
    attitude_deg: list[float] | None
    roll_deg: float | None
    range_factor_free: float | None
    psf_sigma_px: float | None


class Settled(TypedDict):
    """Whether the last pass changed nothing that matters."""

    passes: int | None
    pose: bool | None
    attitude: bool | None


class Similarity(TypedDict):
    """Structural similarity of image and simulation, before and after."""

    before: float | None
    after: float | None


class Result(TypedDict):
    """One corrected image: the keys of docs/reference/result.md, which are there whatever happened. Lengths in pixels,
    angles in degrees; what is not known is None. status: `ok`, `doubtful` (published, with the doubt in reason),
    `refused` or `failed`; of the last two, reason says why and what to do."""

    product: str
    image: str
    status: Literal["ok", "doubtful", "refused", "failed"]
    reason: str | None
    camera: str | None
    target: str | None
    utc: str | None
    pose_source: str | None
    profile: str
    warnings: list[str]
    profile_origin: dict[str, Any] | None
    guidance: Guidance
    centre_px: Pair | None
    offset_px: Pair | None
    range_factor: float | None
    attitude_deg: list[float] | None
    roll_deg: float | None
    roll_by: dict[str, Any] | None
    range_factor_free: float | None
    psf_sigma_px: float | None
    uncertainty: Uncertainty
    settled: Settled
    orientation: dict[str, Any] | None
    stars: dict[str, Any] | None
    bodies: list[dict[str, Any]]
    limb_rms_px: float | None
    limb_points: int | None
    limb_robust_px: float | None
    limb_disagreeing: float | None
    similarity: Similarity
    patches: dict[str, Any] | None
    pose: dict[str, Any] | None
    cube: str | None
    overlay: str | None
    tried: str | None
    seconds: dict[str, float]
    cached: list[str]
