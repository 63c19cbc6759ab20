"""What one dialect's reader hands back, and the Protocol that all of them share."""

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.flips import Flip, flipped, geometry_as_flipped
from catalog.pose import PartialPose
from catalog.readers.exposure_time import UNKNOWN_TIME, ExposureTime
from catalog.readers.names import sole_target
from catalog.readers.stated_mode import UNSTATED, StatedMode
from catalog.reasons import Reason
from catalog.regular_file import open_regular

MAX_SIDE_PX = 20_000
MAX_PIXELS = 30_000_000
MAX_FILE_BYTES = 600_000_000  # the largest frame in doubles, with its noise
HEAD_BYTES = 4096


@dataclass(frozen=True)
class Reading:
    """Pixels and metadata as the file states them, before the camera is looked up.

    image: (ny, nx), any real dtype, line 0 first, y down. quality: uint16 (ny, nx) of `Quality` bits, None for no
    flags. noise: 1-sigma (ny, nx) when the file carries it. instrument_names: every "HOST/INSTRUMENT" spelling that the
    label gives, compared with `Camera.label_names`. raw_dn: values are the camera's own data numbers, so that the
    camera's noise model and saturation level apply. undistorted: None leaves it to the frame's size. targets: all that
    the label names. remarks: what the user ought to know of how the file was read, a sentence each. flags_from: whose
    `quality` is. stated: the mode that the label states, in the file's order; flip: how the picture was flipped since.
    sources: where each value came from, by its name here.
    """

    format: str
    image: NDArray[Any]
    quality: NDArray[np.uint16] | None = None
    noise: NDArray[np.float32] | None = None
    camera: str | None = None
    instrument_names: tuple[str, ...] = ()
    targets: tuple[str, ...] = ()
    time: ExposureTime = UNKNOWN_TIME
    exposure_s: float | None = None
    filter: str | None = None
    raw_dn: bool = False
    undistorted: bool | None = None
    label_pose: PartialPose = field(default_factory=PartialPose)
    label_geometry: dict[str, float] | None = None
    label: dict[str, Any] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()
    flags_from: str = "the flags of its format"
    gain: str | None = None
    stated: StatedMode = UNSTATED
    flip: Flip | None = None
    sources: dict[str, str] = field(default_factory=dict)

    @property
    def target(self) -> str | None:
        """The label's target: the only one that it names, or the only one of several that the catalog knows."""
        return sole_target(self.targets)

    def flipped(self, flip: Flip) -> "Reading":
        """Copy with the picture, its flags, its noise and what the label says of its places flipped."""
        quality, noise = (None if plane is None else flipped(plane, flip) for plane in (self.quality, self.noise))
        lines, samples = self.image.shape
        geometry = self.label_geometry and geometry_as_flipped(self.label_geometry, flip, (lines, samples))
        image = flipped(self.image, flip)
        return replace(self, image=image, quality=quality, noise=noise, label_geometry=geometry, flip=flip)


class Reader(Protocol):
    """One file format."""

    def recognises(self, head: bytes, path: Path) -> bool:
        """Whether the file's first bytes are of this format; its name does not count."""

    def read(self, path: Path, plane: str | None = None) -> Reading:
        """Read the whole file. plane: number (from 1) or name of the one that is meant, of several. Raises
        RefusedError naming the file, the fault and the remedy."""


def unreadable(path: Path, fault: str, remedy: str = "Fetch the file again from its archive.") -> RefusedError:
    """The refusal of a damaged or inconsistent file."""
    return RefusedError(Reason.IMAGE_UNREADABLE, f"image {path}: {fault}.", remedy)


def checked_shape(path: Path, lines: int, samples: int) -> tuple[int, int]:
    """(lines, samples) after checking that they make a picture of a sane size; nothing is allocated before."""
    if lines < 1 or samples < 1:
        raise unreadable(path, f"its label gives {samples} samples by {lines} lines")
    if max(lines, samples) > MAX_SIDE_PX or lines * samples > MAX_PIXELS:
        raise RefusedError(
            Reason.IMAGE_TOO_LARGE,
            f"image {path}: {samples} samples by {lines} lines is more than a camera frame has.",
            f"Frames up to {MAX_SIDE_PX} pixels a side and {MAX_PIXELS} pixels in all are read; cut the picture.",
        )
    return lines, samples


def bytes_at(path: Path, offset: int, count: int, what: str) -> bytes:
    """`count` bytes of the file from `offset`; refuses a file that ends before, without reading any of it."""
    size = path.stat().st_size
    if offset < 0 or count < 0 or offset + count > size:
        raise unreadable(path, f"truncated: {what} should reach byte {offset + count}, the file has {size}")
    with open_regular(path) as file:
        file.seek(offset)
        return file.read(count)
