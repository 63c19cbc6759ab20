"""The reference frames of an instrument: its own, and the platform whose orientation C-kernels give."""

from dataclasses import dataclass
from typing import Any

from catalog.instrument_kernel import Instrument

CK_CLASS = 3
USGS_FRAMES = 14000000  # ISIS' addenda number a detector frame of their own 14000000 + |instrument id|
DEFAULT_TOLERANCE_S = 1.0
LONGEST_CHAIN = 12


@dataclass(frozen=True)
class Frames:
    """frame: of the instrument. platform: the first frame above it that C-kernels orient (name and class id).
    handedness: +1 where the camera looks along the frame's +Z, -1 along its -Z."""

    frame: str | None
    platform: tuple[str, int] | None
    spacecraft: int | None
    tolerance_s: float
    handedness: int

    def content(self) -> dict[str, Any]:
        """Fields of a camera file."""
        named: dict[str, Any] = {"instrument_frame": self.frame, "naif_spacecraft_id": self.spacecraft}
        if self.platform:
            named |= {"naif_ck_frame": self.platform[0], "naif_ck_id": self.platform[1]}
        return {key: value for key, value in named.items() if value is not None} | {"ck_tolerance_s": self.tolerance_s}


def frames_of(kernel: Instrument) -> Frames:
    """Frames of an instrument, as far as the loaded kernels define them."""
    frame_id = _frame_id(kernel)
    if frame_id is None:
        return Frames(None, None, None, DEFAULT_TOLERANCE_S, handedness_of(kernel))
    chain = _chain(frame_id)
    platform = next(((name, class_id) for name, frame_class, class_id, _ in chain if frame_class == CK_CLASS), None)
    spacecraft = next((centre for *_, centre in chain if centre < 0), None)
    return Frames(chain[0][0], platform, spacecraft, _tolerance_s(kernel, platform), handedness_of(kernel))


def _frame_id(kernel: Instrument) -> int | None:
    import spiceypy

    usgs = USGS_FRAMES + abs(kernel.naif_id)
    if spiceypy.frmnam(usgs).strip():
        return usgs
    number = kernel.number("FRAME_ID")
    if number is not None and spiceypy.frmnam(int(number)).strip():
        return int(number)
    for name in (kernel.text("FRAME"), kernel.text("FOV_FRAME")):
        if name and spiceypy.namfrm(name):
            return int(spiceypy.namfrm(name))
    return next((each for each in kernel.family if spiceypy.frmnam(each).strip()), None)


def _chain(frame_id: int) -> list[tuple[str, int, int, int]]:
    """Name, class, class id and centre of a frame and of those that it is fixed to, up to the first that moves."""
    import spiceypy

    chain: list[tuple[str, int, int, int]] = []
    current: int | None = frame_id
    while current and len(chain) < LONGEST_CHAIN:
        try:
            centre, frame_class, class_id = spiceypy.frinfo(current)
        except spiceypy.NotFoundError:
            break
        chain.append((spiceypy.frmnam(current).strip(), frame_class, class_id, centre))
        if frame_class != 4:
            break
        current = _relative(current, class_id, chain[-1][0])
    return chain or [(spiceypy.frmnam(frame_id).strip(), 0, frame_id, 0)]


def _relative(frame_id: int, class_id: int, name: str) -> int | None:
    import spiceypy

    for key in (class_id, frame_id, name):
        try:
            relative = spiceypy.gcpool(f"TKFRAME_{key}_RELATIVE", 0, 1)[0].strip()
        except spiceypy.NotFoundError:
            continue
        return int(spiceypy.namfrm(relative)) or None
    return None


def _tolerance_s(kernel: Instrument, platform: tuple[str, int] | None) -> float:
    """CK_TIME_TOLERANCE in seconds of the platform's clock."""
    import spiceypy
    from spiceypy.utils.exceptions import SpiceyError

    ticks = kernel.number("CK_TIME_TOLERANCE")
    if not ticks or platform is None:
        return DEFAULT_TOLERANCE_S
    try:
        clock = int(spiceypy.ckmeta(platform[1], "SCLK"))
        middle = spiceypy.sce2c(clock, 0.0)
        return max(
            DEFAULT_TOLERANCE_S, float(spiceypy.sct2e(clock, middle + ticks)) - float(spiceypy.sct2e(clock, middle))
        )
    except SpiceyError:
        return DEFAULT_TOLERANCE_S


def handedness_of(kernel: Instrument) -> int:
    """+1 where the camera looks along +Z of its frame; -1 where the kernel's BORESIGHT is along -Z.

    ISIS' focal planes lie across Z, whatever an older IK's boresight says of other axes."""
    boresight = kernel.numbers("BORESIGHT")
    if len(boresight) < 3 or abs(boresight[2]) < max(abs(boresight[0]), abs(boresight[1])):
        return 1
    return -1 if boresight[2] < 0 else 1
