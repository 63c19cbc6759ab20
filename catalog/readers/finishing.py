"""From a reader's result to the Frame: camera and target named, bad pixels flagged, noise known, size checked."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera, find_camera, known_cameras
from catalog.digest import sha256_of_file
from catalog.errors import RefusedError
from catalog.image_mode import ImageMode
from catalog.made_camera import camera_carried_by
from catalog.observation import UNUSABLE, Frame, Observation, Quality
from catalog.pose import PartialPose
from catalog.readers.filling import filled
from catalog.readers.modes import in_whole_frame, mode_of, remarks_of_mode
from catalog.readers.names import camera_of_names, target_of_label
from catalog.readers.noise import completed_noise, measured_noise, modelled_noise
from catalog.readers.overruled import overruled_label, reminder
from catalog.readers.reading import Reading
from catalog.reasons import Reason
from catalog.safe_name import safe_product_name
from catalog.target import find_target, is_target_file

MIN_USABLE_PX = 100  # no disk that can be corrected is smaller
NULL_MAGNITUDE = 1e30  # beyond are the special pixels of float formats (ISIS -3.4e38, PDS -1e32)
CONTRAST_PERCENTILES = (1.0, 99.9)
MIN_STEPS = 255  # that 8-bit pictures have
CUBE_FORMAT = "isis3"  # of `catalog.readers.isis`
BIAS_ALLOWANCE = 1.2  # saturation levels are given without the bias that some raw files still hold


def frame_of_reading(
    path: Path,
    reading: Reading,
    camera_name: str | None,
    target_name: str | None,
    given_mode: ImageMode | None = None,
) -> Frame:
    """The Frame of a reading; `camera_name`, `target_name` and `given_mode` override the label's."""
    name = camera_name or reading.camera or camera_of_names(reading.instrument_names, reading.image.shape[::-1])
    no_camera = None
    if name is None and reading.format == CUBE_FORMAT:
        name, no_camera = camera_carried_by(path)
        reading = replace(reading, sources={**reading.sources, "camera": "NaifKeywords"}) if name else reading
    camera = find_camera(name) if name else None
    if target_name and is_target_file(target_name):
        target_name = find_target(target_name).name
    target = target_of_label(target_name) if target_name else reading.target
    same_target = target_name is None or target == reading.target
    overruled = overruled_label(reading, camera if camera_name else None, target if target_name else None)
    reading = _without_lowest(reading)
    reading = _without_filling(reading if camera is None else _in_its_units(reading, camera))
    mode, undistorted = given_mode or _stated(reading), bool(reading.undistorted)
    if camera is not None:
        undistorted = _undistorted(reading, camera)
        mode = mode_of(path, reading, camera, given_mode, reminder(overruled))
        reading = in_whole_frame(reading, mode, camera)
        camera = camera.summed(mode.summing)
    return Frame(
        product=safe_product_name(path.stem),
        path=path,
        sha256=sha256_of_file(path),
        format=reading.format,
        observation=_observation(path, reading, camera),
        camera=_catalog_name(name),
        target=target,
        et=reading.time.et,
        exposure_s=reading.exposure_s,
        filter=reading.filter,
        undistorted=undistorted,
        mode=mode,
        sources=_sources(reading, camera_name, target_name),
        label_pose=reading.label_pose if same_target else _without_target(reading.label_pose),
        label_geometry=reading.label_geometry if same_target else None,
        label=reading.label,
        overruled=overruled,
        warnings=(*reading.time.contradictions, *reading.remarks, *remarks_of_mode(mode, reading)),
        unclear=_unclear(reading, target, no_camera),
    )


def _without_lowest(reading: Reading) -> Reading:
    """The reading with the lowest number of signed 16 and 32 bit samples MISSING: by custom it is no data (NULL of
    ISIS, and what VICAR programs write around a resampled picture)."""
    image = reading.image
    if image.dtype.kind != "i" or image.dtype.itemsize < 2:
        return reading
    lowest = image == np.iinfo(image.dtype).min
    if not lowest.any():
        return reading
    quality = np.zeros(image.shape, np.uint16) if reading.quality is None else reading.quality.astype(np.uint16)
    return replace(reading, quality=np.where(lowest, quality | np.uint16(Quality.MISSING), quality))


def _without_filling(reading: Reading) -> Reading:
    """The reading with filled pixels MISSING, and a remark. Formats whose readers know their filling keep theirs."""
    quality = np.zeros(reading.image.shape, np.uint16) if reading.quality is None else reading.quality.astype(np.uint16)
    filling = filled(reading.image, (quality & UNUSABLE) != 0)
    if not filling.sentences:
        return reading
    quality[filling.mask] |= np.uint16(Quality.MISSING)
    return replace(reading, quality=quality, remarks=(*reading.remarks, *filling.sentences))


def _unclear(reading: Reading, target: str | None, no_camera: str | None) -> dict[str, str]:
    """Why time, target or camera stay unknown although the label speaks of them."""
    found = {"time": reading.time.fault} if reading.time.fault else {}
    if target is None and reading.targets:
        found["target"] = f"the label names several targets: {', '.join(reading.targets)}"
    if no_camera is not None:
        found["camera"] = no_camera
    return found


def _catalog_name(name: str | None) -> str | None:
    """The catalog's spelling; a camera file's path stays as it was given, for `find_camera` to read again."""
    return name.lower() if name and name.lower() in known_cameras() else name


def _without_target(pose: PartialPose) -> PartialPose:
    return PartialPose(et=pose.et, camera_from_j2000=pose.camera_from_j2000)


def _stated(reading: Reading) -> ImageMode:
    """The mode that the label states, of a camera that is not known."""
    stated = reading.stated
    return ImageMode(stated.summing or 1, stated.window, stated.source)


def _sources(reading: Reading, camera_name: str | None, target_name: str | None) -> dict[str, str]:
    """Where each known value came from: keywords of the label, or options."""
    given = {"camera": "--camera" if camera_name else "", "target": "--target" if target_name else ""}
    time = {"time": reading.time.source} if reading.time.source else {}
    return {**time, **reading.sources, **{what: option for what, option in given.items() if option}}


def _in_its_units(reading: Reading, camera: Camera) -> Reading:
    """The reading; not taken for the camera's data numbers where whole numbers exceed what the camera can give, as in
    a 16-bit picture of an 8-bit camera."""
    whole_numbers = reading.image.dtype.kind in "iu"
    if not (reading.raw_dn and whole_numbers) or camera.saturation_dn is None or reading.image.size == 0:
        return reading
    beyond = float(reading.image.max()) > BIAS_ALLOWANCE * camera.saturation_dn
    return replace(reading, raw_dn=False) if beyond else reading


def _undistorted(reading: Reading, camera: Camera) -> bool:
    """As the file says; else by its size, where the camera's undistorted frame has another than its detector."""
    if reading.undistorted is not None:
        return reading.undistorted
    size = (reading.image.shape[1], reading.image.shape[0])
    return size == camera.size_px and size != camera.detector_size_px


def _observation(path: Path, reading: Reading, camera: Camera | None) -> Observation:
    with np.errstate(invalid="ignore"):
        sound = np.abs(reading.image) < NULL_MAGNITUDE  # false for NaN too
    missing = False if reading.quality is None else (reading.quality & np.uint16(Quality.MISSING)) > 0
    _check_steps(path, reading.image, sound & ~np.asarray(missing))
    image = np.where(sound, reading.image, 0).astype(np.float32)
    quality = np.zeros(image.shape, np.uint16) if reading.quality is None else reading.quality.astype(np.uint16)
    quality[~sound] |= np.uint16(Quality.MISSING)
    saturation = _saturation(reading, camera)
    if saturation is not None:
        quality[image >= saturation] |= np.uint16(Quality.SATURATED)
    usable = int(np.count_nonzero((quality & UNUSABLE) == 0))
    inside = image.size - int(np.count_nonzero(quality & np.uint16(Quality.OUTSIDE_WINDOW)))
    if usable < max(min(MIN_USABLE_PX, inside / 2), 1):
        flagged = reading.quality is not None and bool((reading.quality & np.uint16(UNUSABLE)).any())
        by = f"by {reading.flags_from}, not a number or filled" if flagged else "not a number or filled"
        raise RefusedError(
            Reason.NO_USABLE_PIXELS,
            f"image {path}: {usable} of its {image.size} pixels are usable; {by}: {_shares(quality)}.",
            "Check that the flags are this image's; give a file without them, and bad pixels with --mask."
            if flagged
            else "Give the file, or by --plane the plane, that holds the picture.",
        )
    return Observation(image, _noise(reading, camera, image, quality), quality)


def _check_steps(path: Path, image: NDArray, sound: NDArray[np.bool_]) -> None:
    """Raises RefusedError where the picture's contrast would be lost among numbers far from zero: they are worked with
    in single precision, whose steps are 256 at 4e9."""
    values = image[sound] if image.dtype.itemsize > 2 and image.dtype != np.float32 else image[:0]
    if not values.size:
        return
    lowest, highest = np.percentile(values, CONTRAST_PERCENTILES)
    step = float(np.spacing(np.float32(max(abs(float(values.min())), abs(float(values.max()))))))
    if 0 < highest - lowest < MIN_STEPS * step:
        fault = f"image {path}: its numbers, {lowest:g} to {highest:g}, are further from zero than apart: "
        remedy = "Subtract a constant from its pixels, so that the sky is near zero."
        raise RefusedError(Reason.IMAGE_PRECISION, f"{fault}in single precision they have steps of {step:g}.", remedy)


def _shares(quality: NDArray[np.uint16]) -> str:
    """How many pixels each flag marks."""
    counts = {flag.name or "": int(np.count_nonzero(quality & np.uint16(flag))) for flag in Quality}
    return ", ".join(f"{name.lower()} {count}" for name, count in counts.items() if count)


def _saturation(reading: Reading, camera: Camera | None) -> float | None:
    if not reading.raw_dn:
        return None
    if camera is not None and camera.saturation_dn is not None:
        return camera.saturation_dn
    return 255.0 if reading.image.dtype == np.uint8 else None


def _noise(
    reading: Reading, camera: Camera | None, image: NDArray[np.float32], quality: NDArray[np.uint16]
) -> NDArray[np.float32]:
    """The file's own noise; else the camera's model for its raw data numbers; else, and where pixels are summed,
    measured from the image."""
    modelled = camera is not None and camera.summing == 1 and "noise" in camera.model_fields_set
    if reading.noise is None and reading.raw_dn and camera is not None and modelled:
        return modelled_noise(image, camera.noise)
    measured = measured_noise(image, (quality & UNUSABLE) == 0, reading.image.dtype.kind in "iu")
    return measured if reading.noise is None else completed_noise(reading.noise, measured)
