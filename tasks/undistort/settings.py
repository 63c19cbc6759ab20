"""Settings of the undistortion."""

from typing import Literal

from pydantic import BaseModel, ConfigDict

OpticsMethod = Literal["none", "ssi-cubic", "ssi-quadratic", "radial-k1", "lorri-em"]
MarksMethod = Literal["delaunay"]
Kernel = Literal["bilinear", "bicubic", "lanczos"]


class UndistortSettings(BaseModel):
    """method: `camera` is what the camera file says (for reseau cameras: delaunay); the others by name.

    marks: places of the reseau marks: `nominal` from the camera's table, or a table file like those in
    catalog/reseau. kernel: resampling; bilinear is exact in position, the others place a pixel to 1/64 px. space:
    `resampled` makes the undistorted image (the paper); `sensor` leaves the pixels alone, for photometry, and geometry
    goes through the model.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    method: Literal["camera"] | OpticsMethod | MarksMethod = "camera"
    marks: str = "nominal"
    kernel: Kernel = "bilinear"
    space: Literal["resampled", "sensor"] = "resampled"
