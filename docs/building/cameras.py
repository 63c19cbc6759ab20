"""What the camera files say, as tables."""

import tomllib
from pathlib import Path
from typing import Any

from building.markdown import code
from building.markdown import table as table_of
from catalog.camera import CAMERA_FILES, Camera, known_cameras

HEAD = ("quantity", "value")


def table(_: str = "") -> str:
    """All cameras side by side."""
    rows = [
        (
            f"[{camera.title or name}](/cameras/{name}.md)",
            code(name),
            f"{camera.size_px[0]} x {camera.size_px[1]}",
            f"{camera.focal_length_px:.1f}",
            f"{pixel_urad(camera):.3f}",
            camera.distortion.model,
            f"{camera.psf_sigma_px:g}",
        )
        for name, camera in known_cameras().items()
    ]
    return table_of(
        ("camera", "name", "frame, px", "focal length, px", "pixel, µrad", "distortion", "PSF sigma, px"), rows
    )


def section_of(name: str) -> str:
    """One camera's figures, kernels, spellings and sources. Raises KeyError for an unknown camera."""
    camera = known_cameras()[name]
    parts = [
        table_of(HEAD, figures(camera)),
        "## Distortion parameters\n",
        table_of(("parameter", "value"), parameters(camera.distortion.parameters)),
        "## Noise of a pixel\n",
        noise(camera),
        "## Kernels for a pose from SPICE\n",
        listed(camera.kernels),
        "## Names that labels use\n",
        listed(code(name) for name in camera.label_names),
        "## Sources\n",
        listed(camera.sources),
        f"All of this is in `catalog/cameras/{file_of(name).name}`.\n",
    ]
    return "\n".join(parts)


def figures(camera: Camera) -> list[tuple[str, str]]:
    """The pinhole and its frame."""
    raw, window = camera.detector_size_px, camera.valid_window
    mm = (
        f"{camera.focal_length_mm:g} mm at {camera.pixel_pitch_mm * 1000:.5g} µm pitch" if camera.pixel_pitch_mm else ""
    )
    return [
        ("name", code(camera.name)),
        ("undistorted frame", f"{camera.size_px[0]} x {camera.size_px[1]} px"),
        ("raw frame", f"{raw[0]} x {raw[1]} px" + (f", valid window {window}" if window else "")),
        ("boresight falls on", "({:g}, {:g}), 0-based".format(*camera.centre_px)),
        ("focal length", f"{camera.focal_length_px:.3f} px" + (f" ({mm})" if mm else "")),
        ("focal length, 1-sigma", f"{100 * camera.focal_length_sigma:.2g} %"),
        ("pixel", f"{pixel_urad(camera):.4f} µrad"),
        ("distortion model", code(camera.distortion.model)),
        *plane(camera),
        ("PSF", f"Gaussian, sigma {camera.psf_sigma_px:g} px of the undistorted frame"),
        ("saturation", f"{camera.saturation_dn:g} DN" if camera.saturation_dn else "unknown"),
        ("NAIF", f"spacecraft {camera.naif_spacecraft_id}, instrument {camera.naif_instrument_id}"),
        ("C-kernel", f"{camera.naif_ck_frame} ({camera.naif_ck_id}), tolerance {camera.ck_tolerance_s:g} s"),
        ("instrument frame", code(camera.instrument_frame or "none")),
        ("+X sample, +Y line, +Z boresight are", axes(camera)),
    ]


def plane(camera: Camera) -> list[tuple[str, str]]:
    """The detector in the focal plane, and what changes the focal length, where the file has them."""
    rows: list[tuple[str, str]] = []
    if camera.focal_plane is not None:
        place, (across, down) = camera.focal_plane, camera.focal_plane.mm_from_px
        rows.append(("boresight on the detector", "({:g}, {:g}), 0-based".format(*place.origin_px)))
        rows.append(("focal plane, mm per px", f"x = ({across[0]:g}, {across[1]:g}), y = ({down[0]:g}, {down[1]:g})"))
    if camera.focal_length_mm_by_temperature:
        powers = " + ".join(f"{value:g} T^{power}" for power, value in enumerate(camera.focal_length_mm_by_temperature))
        rows.append(("focal length by temperature (degrees Celsius), mm", code(powers)))
    lengths = {name: changed.get("focal_length_mm") for name, changed in camera.filters.items()}
    if any(lengths.values()):
        rows.append(("focal length by filter, mm", ", ".join(f"{name} {value:g}" for name, value in lengths.items())))
    return rows


def axes(camera: Camera) -> str:
    """Our axes by those of the instrument."""
    rows = [[abs(part) for part in row] for row in camera.camera_from_instrument]
    places = [row.index(max(row)) for row in rows]
    signs = ["+" if row[place] > 0 else "-" for row, place in zip(camera.camera_from_instrument, places, strict=True)]
    described = ", ".join(sign + "XYZ"[place] for sign, place in zip(signs, places, strict=True))
    return f"{described} of the instrument frame"


def pixel_urad(camera: Camera) -> float:
    """Angle of a pixel at the boresight."""
    return 1e6 / camera.focal_length_px


def parameters(given: dict[str, Any]) -> list[tuple[str, str]]:
    """What `[distortion]` gives, and its tables for other models."""
    rows = [(code(key), code(value)) for key, value in given.items() if not isinstance(value, dict)]
    for model, inner in given.items():
        if isinstance(inner, dict):
            rows += [(f"`{key}` of model `{model}`", code(value)) for key, value in inner.items()]
    return rows or [("none", "")]


def noise(camera: Camera) -> str:
    """The noise model with its numbers."""
    n = camera.noise
    return (
        f"$\\sigma^2 = ({n.read_dn:g}\\,\\mathrm{{DN}})^2 + \\frac{{\\mathrm{{DN}}}}{{{n.gain_e_per_dn:g}}}"
        f" + ({n.relative:g}\\,\\mathrm{{DN}})^2$: read noise, photons ({n.gain_e_per_dn:g} electrons per DN), "
        "and what calibration leaves in proportion to the signal.\n"
    )


def listed(lines: Any) -> str:
    """A list, or that there is nothing."""
    return "\n".join(f"- {line}" for line in lines) + "\n" if lines else "None.\n"


def file_of(name: str) -> Path:
    """The camera's file in the catalog."""
    return next(path for path in CAMERA_FILES if tomllib.loads(path.read_text(encoding="utf-8"))["name"] == name)
