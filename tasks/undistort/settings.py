"""Settings of the undistortion."""

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field

OpticsMethod = Literal[
    "none", "ssi-cubic", "ssi-quadratic", "radial-k1", "lorri-em", "radial-series", "radial-outward",
    "radial-decentered", "radial-all-powers", "transverse", "rational", "radial-tangential", "legendre",
]  # fmt: skip
MarksMethod = Literal["radial", "polynomial", "delaunay", "thin-plate", "beam-bending"]
Kernel = Literal["bilinear", "bicubic", "lanczos"]


class UndistortSettings(BaseModel):
    """method: `camera` is what the camera file says (for reseau cameras the one that predicts marks best: beam-bending
    where marks were found, thin-plate on a table); the others by name. with_marks: what `camera` means instead where
    the frame shows its marks and they are used (the paper's choice for Voyager is delaunay).
    degree: of the radial or general polynomial, or of the thin plate's trend; None is the method's default.

    marks: `auto` measures the reseau marks in the frame and falls back on the camera's nominal table when too few are
    found, `found` refuses instead, `nominal` trusts the table; anything else is the path of a table: tab-separated as
    in catalog/reseau, or a GEOMA or RESLOC file of the PDS Ring Node. fill_marks: inpaint the found marks.

    left_out: models of camera files that are taken for none (the paper's choice for LORRI).

    roll: `published` turns the undistorted frame by the camera file's published_roll_deg. kernel: resampling; bilinear
    is exact in position, the others place a pixel to 1/64 px. space: `resampled` makes the undistorted image (the
    paper); `sensor` leaves the pixels alone, for photometry, and geometry goes through the model.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    method: Literal["camera"] | OpticsMethod | MarksMethod = "camera"
    with_marks: MarksMethod | None = None
    degree: int | None = Field(None, ge=1, le=20)
    marks: str = "auto"
    fill_marks: bool = True
    left_out: tuple[OpticsMethod, ...] = ()
    roll: Literal["none", "published"] = "none"
    kernel: Kernel = "bilinear"
    space: Literal["resampled", "sensor"] = "resampled"
