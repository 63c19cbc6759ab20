"""Settings of the search for stars."""

from pydantic import BaseModel, ConfigDict, Field


class DetectionSettings(BaseModel):
    """Which peaks of a frame are taken for stars."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    least_signal_to_noise: float = Field(
        4.5, gt=0, description="Of a peak in the matched-filtered image; in 10^6 pixels of noise about 3 are higher."
    )
    above_structure: float = Field(
        3.0, gt=0, description="Of a peak, in root mean squares of what surrounds it: a ridge's are about 1 to 2."
    )
    faintest_signal_to_noise: float = Field(
        3.5, gt=0, description="Of a peak that counts once it lies where a known orientation has a star."
    )
    tile_px: int = Field(32, ge=8, description="Side of the tiles in which sky noise is measured.")
    most: int = Field(1500, ge=10, description="Brightest peaks that are kept.")
    widest: float = Field(1.7, gt=1, description="Largest width of a peak, in those of the frame's star images.")
    longest: float = Field(1.6, gt=1, description="Largest ratio of a peak's two widths.")
    model_error: float = Field(
        0.05, ge=0, description="Share of its height by which a star image departs from the model."
    )


class IdentificationSettings(BaseModel):
    """How detections are given to catalog stars."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    tolerance_px: float = Field(2.0, gt=0, description="Largest distance of a star from its place in the first search.")
    brightest: int = Field(24, ge=4, description="Detections that take part in the first search.")
    stars_in_frame: float = Field(
        20.0, gt=3, description="Brightest catalog stars of each patch of the frame's size in the first search."
    )
    most_orientations: int = Field(
        1_000_000, gt=0, description="Orientations that are tried (about 10 s for a million) before giving up."
    )
    least_stars: int = Field(3, ge=3, description="Fewest identified stars that make an orientation.")
    largest_false_alarm: float = Field(
        1e-6, gt=0, le=1, description="Largest probability that so many stars agree by chance."
    )
    predicted_deg: float = Field(2.0, gt=0, description="Largest error of a predicted orientation that is searched.")


class StarSettings(BaseModel):
    """All of them."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    detection: DetectionSettings = DetectionSettings()
    identification: IdentificationSettings = IdentificationSettings()
