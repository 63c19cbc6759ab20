"""A camera is one TOML file: the pinhole geometry of its undistorted frame, raw detector, noise, PSF and kernels."""

import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from catalog.errors import RefusedError
from catalog.plain_files import read_toml_file
from catalog.plugins import CAMERAS, Plugin, contributed, refuse_unusable, toml_given
from catalog.reasons import Reason

CAMERA_FOLDER = Path(__file__).parent / "cameras"
CAMERA_FILES = sorted(CAMERA_FOLDER.glob("*.toml"))


class Distortion(BaseModel):
    """Which distortion brick the camera needs by default, and its parameters (see `tasks/undistort`)."""

    model_config = ConfigDict(frozen=True, extra="allow")
    model: str = "none"

    @property
    def parameters(self) -> dict[str, Any]:
        """Everything beside the model's name."""
        return dict(self.__pydantic_extra__ or {})


class Noise(BaseModel):
    """Noise of one pixel in the file's units: variance = read_dn^2 + value / gain_e_per_dn + (relative * value)^2."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    read_dn: float = Field(default=1.0, ge=0)
    gain_e_per_dn: float = Field(default=100.0, gt=0)
    relative: float = Field(default=0.0, ge=0)


class Camera(BaseModel):
    """One camera. Pixels are (x, y) = (sample, line), 0-based, integer at the pixel's centre.

    size_px, centre_px (where the boresight falls) and focal_length_px belong to the undistorted frame; raw_size_px is
    the detector's. camera_from_instrument maps the NAIF instrument frame to +X sample, +Y line, +Z boresight.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    name: str = Field(min_length=1, pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$")
    title: str = ""
    mission: str = ""
    size_px: tuple[int, int]
    centre_px: tuple[float, float]
    focal_length_px: float = Field(gt=0)
    # 1-sigma, relative. Where a camera file says nothing: by so much do published focal lengths of one camera differ
    # (Cassini NAC 3.7e-4, Galileo SSI 3.8e-4, LORRI 2.0e-4; see the camera files).
    focal_length_sigma: float = Field(default=3e-4, ge=0, lt=0.1)
    focal_length_mm: float | None = Field(default=None, gt=0)
    pixel_pitch_mm: float | None = Field(default=None, gt=0)
    raw_size_px: tuple[int, int] | None = None
    valid_window: tuple[int, int, int, int] | None = None  # x0, y0, width, height in the raw frame
    distortion: Distortion = Distortion()
    psf_sigma_px: float = Field(default=0.7, ge=0)
    noise: Noise = Noise()
    saturation_dn: float | None = None
    naif_spacecraft_id: int | None = None
    naif_instrument_id: int | None = None
    naif_ck_frame: str | None = None
    naif_ck_id: int | None = None
    ck_tolerance_s: float = Field(default=0.0, ge=0)  # a discrete C-kernel's nearest entry may be this far away
    instrument_frame: str | None = None
    camera_from_instrument: tuple[tuple[float, float, float], ...] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    label_dialect: str | None = None
    # "HOST/INSTRUMENT" spellings found in labels: any host keyword (INSTRUMENT_HOST_NAME, SPACECRAFT_NAME, MISSION ...)
    # and any instrument keyword (INSTRUMENT_ID, SENSOR ...) joined by "/", see catalog/readers/names.py.
    # A VICAR or FITS file that has one of them is this camera's: a new camera needs no code, only these names.
    label_names: tuple[str, ...] = ()
    kernels: tuple[str, ...] = ()  # names of the NAIF kernels a pose from SPICE needs
    sources: tuple[str, ...] = ()
    # Of a camera whose pixels are summed: how many make one along each side, and the camera as it is without.
    summing: int = Field(default=1, ge=1)
    unsummed: "Camera | None" = None

    @model_validator(mode="before")
    @classmethod
    def _focal_length_in_pixels(cls, content: Any) -> Any:
        if isinstance(content, dict) and "focal_length_px" not in content:
            if "focal_length_mm" not in content or "pixel_pitch_mm" not in content:
                raise ValueError("give focal_length_px, or focal_length_mm and pixel_pitch_mm")
            try:
                focal_px = float(content["focal_length_mm"]) / float(content["pixel_pitch_mm"])
            except (TypeError, ValueError, ZeroDivisionError) as error:
                raise ValueError("focal_length_mm and pixel_pitch_mm must be positive numbers") from error
            return {**content, "focal_length_px": focal_px}
        return content

    @model_validator(mode="after")
    def _sane(self) -> "Camera":
        if min(self.size_px) < 1 or max(self.size_px) > 20000:
            raise ValueError(f"size_px {self.size_px} is not a frame size")
        if not all(map(math.isfinite, (*self.centre_px, self.focal_length_px))):
            raise ValueError("centre_px and focal_length_px must be finite")
        return self

    @property
    def detector_size_px(self) -> tuple[int, int]:
        """Size (nx, ny) of the raw frame; the undistorted one's unless the camera says otherwise."""
        return self.raw_size_px or self.size_px

    def summed(self, summing: int) -> "Camera":
        """The camera whose pixels are `summing` by `summing` of this one's; itself for 1.

        Pixel x of the sum is centred on (x + 0.5) summing - 0.5 of the detector. Distortion stays `unsummed`'s."""
        if summing == 1:
            return self

        def smaller(size: tuple[int, int] | None) -> tuple[int, int] | None:
            return None if size is None else (size[0] // summing, size[1] // summing)

        x, y = ((place + 0.5) / summing - 0.5 for place in self.centre_px)
        changes = {
            "size_px": smaller(self.size_px),
            "raw_size_px": smaller(self.raw_size_px),
            "centre_px": (x, y),
            "focal_length_px": self.focal_length_px / summing,
            "pixel_pitch_mm": None if self.pixel_pitch_mm is None else self.pixel_pitch_mm * summing,
            "psf_sigma_px": self.psf_sigma_px / summing,
            "valid_window": None,
            "summing": summing,
            "unsummed": self,
        }
        return self.model_copy(update=changes)

    def project(self, direction: ArrayLike) -> NDArray[np.float64]:
        """Pixels (..., 2) of camera-frame vectors (..., 3). A vector behind the camera (Z <= 0) gives NaN."""
        v = np.asarray(direction, dtype=np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            xy = v[..., :2] / v[..., 2:] * self.focal_length_px + np.asarray(self.centre_px)
        return np.where(v[..., 2:] > 0, xy, np.nan)

    def ray(self, xy_px: ArrayLike) -> NDArray[np.float64]:
        """Unit camera-frame vectors (..., 3) of undistorted pixels (..., 2)."""
        xy = (np.asarray(xy_px, dtype=np.float64) - np.asarray(self.centre_px)) / self.focal_length_px
        v = np.concatenate([xy, np.ones_like(xy[..., :1])], axis=-1)
        return v / np.linalg.norm(v, axis=-1, keepdims=True)


def camera_from_dict(content: dict[str, Any], origin: str) -> Camera:
    """Camera from a TOML file's content. Raises RefusedError naming `origin` and each bad field."""
    try:
        return Camera.model_validate(content)
    except ValidationError as error:
        faults = "; ".join(f"{'.'.join(map(str, e['loc'])) or 'camera'}: {e['msg']}" for e in error.errors())
        raise RefusedError(
            Reason.CAMERA_FILE_INVALID,
            f"camera file {origin}: {faults}.",
            "It needs at least name, size_px, centre_px and focal_length_px (or focal_length_mm and pixel_pitch_mm).",
        ) from error


def read_camera_file(path: Path) -> Camera:
    """Camera of a TOML file. Raises RefusedError when the file cannot be read or lacks something."""
    try:
        content = read_toml_file(Path(path))
    except (OSError, ValueError) as error:
        raise RefusedError(
            Reason.CAMERA_FILE_UNREADABLE,
            f"camera file {path} cannot be read: {error}.",
            f"Give a TOML file, or one of the catalog's names: {', '.join(path.stem for path in CAMERA_FILES)}.",
        ) from error
    return camera_from_dict(content, str(path))


@cache
def known_cameras() -> dict[str, Camera]:
    """All cameras of the catalog by name, then those that plugins add."""
    cameras = (read_camera_file(path) for path in CAMERA_FILES)
    own = {camera.name: camera for camera in cameras}
    return own | contributed(CAMERAS, _cameras_of, own)


def _cameras_of(plugin: Plugin) -> list[tuple[str, Camera]]:
    """Cameras of a plugin by their names in lower case."""
    given = [
        camera_from_dict(each, f"of {plugin.distribution}") if isinstance(each, dict) else read_camera_file(each)
        for each in toml_given(plugin)
    ]
    return [(camera.name.lower(), camera) for camera in given]


def find_camera(name_or_file: str) -> Camera:
    """Camera by catalog name, or from a user's TOML file. Raises RefusedError listing the known names."""
    if name_or_file.lower() in known_cameras():
        return known_cameras()[name_or_file.lower()]
    if name_or_file.endswith(".toml"):
        return read_camera_file(Path(name_or_file))
    refuse_unusable(CAMERAS, name_or_file)
    raise RefusedError(
        Reason.CAMERA_UNKNOWN,
        f"camera {name_or_file!r} is not in the catalog.",
        f"Known are {', '.join(known_cameras())}; or give --camera FILE.toml.",
    )
