"""A camera is one TOML file: the pinhole geometry of its undistorted frame, raw detector, noise, PSF and kernels."""

import math
import re
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from catalog.errors import RefusedError
from catalog.focal_plane import FocalPlane
from catalog.isd import content_from_isd
from catalog.isis_tables import content_from_cube
from catalog.kernel_camera import as_keyword, content_from_kernels
from catalog.made_camera import is_made, made_content
from catalog.optics import optics_of
from catalog.plain_files import read_toml_file
from catalog.plugins import CAMERAS, Plugin, contributed, refuse_unusable, toml_given
from catalog.reasons import Reason
from catalog.spacecraft_clock import SpacecraftClock

CAMERA_FOLDER = Path(__file__).parent / "cameras"
# An array that tomli-w spreads over lines, of numbers or of rows of numbers.
NUMBERS_IN_ROWS = re.compile(r"\[\n(?:\s+(?:[-+.\deEinfa]+|\[[^\[\]\n\"]*\]),\n)+\s*\]")
CAMERA_FILES = sorted(CAMERA_FOLDER.glob("*.toml"))


class Distortion(BaseModel):
    """Which distortion method the camera needs by default, and its parameters (see `tasks/undistort`)."""

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
    # 1-sigma, relative. Where a camera file says nothing: two published focal lengths of one camera differ by 6.8e-4
    # RMS, root of two times it (five cameras: docs/method/uncertainty.md).
    focal_length_sigma: float = Field(default=5e-4, ge=0, lt=0.1)
    focal_length_mm: float | None = Field(default=None, gt=0)
    pixel_pitch_mm: float | None = Field(default=None, gt=0)
    # Of a camera whose focal length changes: its polynomial in degrees Celsius of the focal plane, mm; and what a
    # filter changes of this file, by the filter's name in capitals with _ between the parts (CL1_GRN). See `Camera.at`.
    focal_length_mm_by_temperature: tuple[float, ...] = ()
    filters: dict[str, dict[str, Any]] = Field(default_factory=dict)
    raw_size_px: tuple[int, int] | None = None
    valid_window: tuple[int, int, int, int] | None = None  # x0, y0, width, height in the raw frame
    focal_plane: FocalPlane | None = None  # None: an upright detector of square pixels with the boresight at centre_px
    distortion: Distortion = Distortion()
    psf_sigma_px: float = Field(default=0.7, ge=0, le=20)
    noise: Noise = Noise()
    saturation_dn: float | None = None
    naif_spacecraft_id: int | None = None
    naif_instrument_id: int | None = None
    naif_ck_frame: str | None = None
    naif_ck_id: int | None = None
    ck_tolerance_s: float = Field(default=0.0, ge=0)  # a discrete C-kernel's nearest entry may be this far away
    clock: SpacecraftClock | None = None  # None: the label's times are as good as its clock count
    instrument_frame: str | None = None
    camera_from_instrument: tuple[tuple[float, float, float], ...] = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    label_dialect: str | None = None
    # "HOST/INSTRUMENT" as labels spell them: a host and an instrument keyword (readers/names.py).
    # A file that has one of them is this camera's: a new camera needs no code, only these names.
    label_names: tuple[str, ...] = ()
    kernels: tuple[str, ...] = ()  # names of the NAIF kernels a pose from SPICE needs
    sources: tuple[str, ...] = ()
    tried: str = ""  # how far the file was tried on images
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
        size, raw = (side and (side[0] // summing, side[1] // summing) for side in (self.size_px, self.raw_size_px))
        x, y = ((place + 0.5) / summing - 0.5 for place in self.centre_px)
        changes = {
            "size_px": size,
            "raw_size_px": raw,
            "centre_px": (x, y),
            "focal_length_px": self.focal_length_px / summing,
            "pixel_pitch_mm": self.pixel_pitch_mm and self.pixel_pitch_mm * summing,
            "psf_sigma_px": self.psf_sigma_px / summing,
            "valid_window": None,
            "summing": summing,
            "unsummed": self,
        }
        return self.model_copy(update=changes)

    @classmethod
    def from_kernels(
        cls,
        kernels: Iterable[Path | str],
        instrument: str | int,
        et: float | None = None,
        *,
        filter_name: str | None = None,
        temperature_c: float | None = None,
        size_px: tuple[int, int] | None = None,
    ) -> "Camera":
        """Camera of a NAIF instrument (name or id) from IK, FK and ISIS' instrument addenda among `kernels`.

        et: TDB seconds past J2000, where the optics changed in flight. filter_name, temperature_c (of the focal plane):
        choose the focal length at once; without them `at` does later. size_px: of the frame, where no kernel says it.
        Raises RefusedError for an unknown instrument, missing keywords (naming them) and line scanners.
        """
        paths = [Path(kernel) for kernel in kernels]
        content = content_from_kernels(paths, instrument, et, filter_name, temperature_c, size_px)
        return camera_from_dict(content, f"of kernels, instrument {instrument}")

    @classmethod
    def from_isd(cls, path: Path | str) -> "Camera":
        """Camera of an image support data file (ISD, JSON) of USGS' ALE for the Community Sensor Model.

        Raises RefusedError when the file is no ISD of a frame camera.
        """
        return camera_from_dict(content_from_isd(Path(path)), f"of ISD {path}")

    @classmethod
    def from_cube(cls, path: Path | str) -> "Camera":
        """Camera of an ISIS cube's NaifKeywords (after spiceinit). Raises RefusedError where it carries none."""
        return camera_from_dict(content_from_cube(Path(path)), f"of cube {path}")

    def at(self, filter_name: str | None = None, temperature_c: float | None = None) -> "Camera":
        """The camera with the focal length of a filter, or of its focal plane's temperature (degrees Celsius); itself
        where its file knows no difference."""
        changes: dict[str, Any] = {}
        if self.focal_length_mm_by_temperature and temperature_c is not None:
            powers = enumerate(self.focal_length_mm_by_temperature)
            changes["focal_length_mm"] = sum(value * temperature_c**power for power, value in powers)
        if filter_name:
            changes |= self.filters.get(as_keyword(filter_name), {})
        if not changes:
            return self
        content = self.model_dump(exclude_unset=True, exclude={"focal_length_px"}) | changes
        return camera_from_dict(content, f"{self.name}, filter {filter_name}, {temperature_c} degrees Celsius")

    def to_toml(self) -> str:
        """Content of a camera file (TOML) that `read_camera_file` reads to the same camera."""
        from tomli_w import dumps

        left_out = {"focal_length_px"} if self.focal_length_mm and self.pixel_pitch_mm else set()
        text = dumps(self.model_dump(mode="json", exclude_unset=True, exclude_none=True, exclude=left_out))
        return NUMBERS_IN_ROWS.sub(_in_one_line, NUMBERS_IN_ROWS.sub(_in_one_line, text))

    def detector_ray(self, xy_px: ArrayLike) -> NDArray[np.float64]:
        """Unit camera-frame vectors (..., 3) of raw detector pixels (..., 2), 0-based, distortion removed.

        NaN where the distortion model has no answer. Raises RefusedError where the camera's distortion is measured on
        the marks of each image.
        """
        if self.unsummed is not None:
            return self.unsummed.detector_ray((np.asarray(xy_px, np.float64) + 0.5) * self.summing - 0.5)
        return self.ray(optics_of(self).undistort_points(xy_px))

    def detector_pixel(self, direction: ArrayLike) -> NDArray[np.float64]:
        """Raw detector pixels (..., 2), 0-based, of camera-frame vectors (..., 3): the inverse of `detector_ray`.

        NaN behind the camera (Z <= 0) and where the distortion model has no answer.
        """
        if self.unsummed is not None:
            return np.asarray((self.unsummed.detector_pixel(direction) + 0.5) / self.summing - 0.5)
        return optics_of(self).distort_points(self.project(direction))

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


def _in_one_line(found: re.Match[str]) -> str:
    return re.sub(r"\s+", " ", found[0]).replace("[ ", "[").replace(", ]", "]")


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


def find_camera(name_or_file: str, kernels: Iterable[Path] | None = None) -> Camera:
    """Camera by catalog name, from a user's TOML file, or made from kernels or a file (`catalog.made_camera`; kernels:
    None takes the default ones). Raises RefusedError listing the known names."""
    if is_made(name_or_file):
        return camera_from_dict(made_content(name_or_file, kernels), f"of {name_or_file}")
    if name_or_file.lower() in known_cameras():
        return known_cameras()[name_or_file.lower()]
    if name_or_file.endswith(".toml"):
        return read_camera_file(Path(name_or_file))
    refuse_unusable(CAMERAS, name_or_file)
    raise RefusedError(
        Reason.CAMERA_UNKNOWN,
        f"camera {name_or_file!r} is not in the catalog.",
        f"Known are {', '.join(known_cameras())}; or give --camera FILE.toml, kernels:NAME, isd:FILE or isis:FILE.",
    )
