"""The mode of an image: what the user says, what the label says, what the frame's size says, in this order.

The picture is put into the camera's whole frame, at its window's place, with the rest OUTSIDE_WINDOW: then every later
step sees one frame size, the camera's, or that of the camera summed (`Camera.summed`).
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.image_mode import FULL_FRAME, ImageMode, Window
from catalog.observation import Quality
from catalog.readers.label_values import number
from catalog.readers.reading import Reading
from catalog.readers.stated_mode import MAX_SUMMING, StatedMode, placed_as_flipped
from catalog.reasons import Reason

SAY_WHICH = "Say which part of the detector it shows: --window X0,Y0,WIDTH,HEIGHT in detector pixels from 0"
OBLONG = 0.02  # relative: scales in labels are rounded
BY_SIZE = "the frame's size"


def mode_of(path: Path, reading: Reading, camera: Camera, given: ImageMode | None, reminder: str) -> ImageMode:
    """The mode of a picture of `camera`. given: the user's. Raises RefusedError where it is unknown or impossible."""
    lines, samples = reading.image.shape
    size, full, stated = (samples, lines), camera.detector_size_px, reading.stated
    if reading.flip is not None:
        stated = placed_as_flipped(stated, reading.flip, size, full)
    if given is not None:
        return _checked(path, given, size, full)
    stated = _without_contradiction(path, stated, size, full)
    if stated.summing is None and size in (full, camera.size_px):
        return FULL_FRAME
    if stated.window is not None and stated.summing is not None:
        return _checked(path, ImageMode(stated.summing, stated.window, stated.source), size, full)
    is_cut = stated.first is not None and any(stated.first)  # a window, whatever its size happens to be half of
    for summing in (stated.summing,) if stated.summing else () if is_cut else range(1, MAX_SUMMING):
        if size == (full[0] // summing, full[1] // summing):
            source = stated.source if stated.summing else BY_SIZE
            return ImageMode(summing, None, source if summing > 1 else "")
    if size == camera.size_px or size == full:
        return FULL_FRAME
    summing = stated.summing or 1
    if stated.first is not None:
        window = (*stated.first, samples * summing, lines * summing)
        return _checked(path, ImageMode(summing, window, stated.source), size, full)
    tall = pixel_height(reading.label)
    oblong = tall is not None and abs(tall - 1) > OBLONG
    for summing in () if oblong else (stated.summing,) if stated.summing else (1, 2, 4):
        if samples == full[0] // summing and lines < full[1] // summing:
            return ImageMode(summing, (0, 0, samples * summing, lines * summing), BY_SIZE)
    allowed = " or ".join(f"{nx}x{ny}" for nx, ny in dict.fromkeys((full, camera.size_px)))
    fault = f"image {path}: it has {samples}x{lines} pixels, camera {camera.name} has {allowed}"
    if oblong:
        fault += f", and by its label a pixel is {tall:.2f} times as high as wide"
        remedy = (
            f"Resample it to {allowed} pixels of the camera's shape, or give a --camera FILE.toml that has such pixels"
        )
        raise RefusedError(Reason.FRAME_SIZE, f"{fault}.", f"{reminder}{remedy} (section [focal_plane]).")
    raise RefusedError(
        Reason.FRAME_SIZE,
        f"{fault}.",
        f"{reminder}{SAY_WHICH} (and --summing 2 where its pixels are summed), or give the --camera that took it.",
    )


def _without_contradiction(path: Path, stated: StatedMode, size: tuple[int, int], full: tuple[int, int]) -> StatedMode:
    """What the label states; where its keywords contradict each other, what the frame's size decides. Raises
    RefusedError where it does not."""
    decided = stated.decided(size, full) if stated.contradicted_by else stated
    if not stated.contradicted_by or size == tuple(side // (decided.summing or 1) for side in full):
        return decided
    said = ", ".join(
        f"{n}x{n} summing by {source}" for n, source in ((stated.summing, stated.source), *stated.contradicted_by)
    )
    fault = f"image {path}: its label contradicts itself ({said}), and its {size[0]}x{size[1]} pixels do not decide"
    raise RefusedError(Reason.FRAME_MODE, f"{fault}.", "Say which it is: --summing N, and --window for a part.")


def pixel_height(label: Mapping[str, Any]) -> float | None:
    """How high the label's pixels are, of their width; None where it does not say. They are not square in frames whose
    lines were not stretched yet (NEAR MSI): fewer lines than the camera's are then not missing."""
    for what in ("SCALE", "FOV"):
        wide, high = (number(label, f"{side}_PIXEL_{what}") for side in ("HORIZONTAL", "VERTICAL"))
        if wide and high:
            return abs(high / wide)
    return None


def remarks_of_mode(mode: ImageMode, reading: Reading) -> tuple[str, ...]:
    """What the user ought to know: of a mode that only the frame's size says, or one that the label contradicts."""
    stated, remarks = reading.stated, []
    if mode.source == BY_SIZE:
        guess = " (lines are missing at the end)" if mode.window is not None else ""
        remarks.append(f"by the frame's size it is {mode}{guess}; give --summing and --window where that is wrong")
    remarks += [
        f"the label says {summing}x{summing} summing ({source}), it is taken as {mode}"
        for summing, source in ((stated.summing, stated.source), *stated.contradicted_by)
        if summing not in (None, mode.summing)
    ]
    return tuple(remarks)


def in_whole_frame(reading: Reading, mode: ImageMode, camera: Camera) -> Reading:
    """The reading with its window placed in the whole frame of the camera in this mode."""
    if mode.window is None:
        return reading
    nx, ny = (side // mode.summing for side in camera.detector_size_px)
    shape = reading.image.shape
    quality = np.zeros(shape, np.uint16) if reading.quality is None else reading.quality.astype(np.uint16)
    geometry = reading.label_geometry
    if geometry is not None:
        x0, y0 = mode.first_px
        geometry = {
            **geometry,
            "centre_x_px": geometry["centre_x_px"] + x0,
            "centre_y_px": geometry["centre_y_px"] + y0,
        }
    return replace(
        reading,
        image=mode.placed(np.asarray(reading.image), (nx, ny), 0),
        quality=mode.placed(quality, (nx, ny), np.uint16(Quality.OUTSIDE_WINDOW)),
        noise=None if reading.noise is None else mode.placed(reading.noise, (nx, ny), np.float32(np.nan)),
        label_geometry=geometry,
    )


def _checked(path: Path, mode: ImageMode, size: tuple[int, int], full: tuple[int, int]) -> ImageMode:
    """The mode, its window complete. Raises RefusedError where it does not fit the picture or the detector."""
    summing, whole = mode.summing, (full[0] // mode.summing, full[1] // mode.summing)
    if mode.window is None:
        if size == whole:
            return mode
        fault = f"{full[0]}x{full[1]} detector pixels summed {summing}x{summing} are {whole[0]}x{whole[1]}"
        raise _impossible(path, size, fault)
    x0, y0, width, height = mode.window
    if (width // summing, height // summing) != size:
        fault = f"a window of {width}x{height} detector pixels summed {summing}x{summing} is"
        raise _impossible(path, size, f"{fault} {width // summing}x{height // summing}")
    if min(x0, y0) < 0 or x0 // summing + size[0] > whole[0] or y0 // summing + size[1] > whole[1]:
        raise _impossible(
            path, size, f"a window of {width}x{height} from ({x0}, {y0}) leaves {full[0]}x{full[1]} pixels"
        )
    if x0 % summing or y0 % summing:
        raise _impossible(path, size, f"a window from ({x0}, {y0}) begins inside a pixel of {summing}x{summing}")
    window: Window = (x0, y0, size[0] * summing, size[1] * summing)
    return ImageMode(summing, None if window == (0, 0, *(side * summing for side in whole)) else window, mode.source)


def _impossible(path: Path, size: tuple[int, int], fault: str) -> RefusedError:
    return RefusedError(Reason.FRAME_MODE, f"image {path} of {size[0]}x{size[1]} pixels: {fault}.", f"{SAY_WHICH}.")
