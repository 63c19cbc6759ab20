"""Writes a raw image in the format of its camera."""

from collections.abc import Callable
from pathlib import Path

from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.reasons import Reason
from lab.simulate.writers.galileo import write_galileo
from lab.simulate.writers.lorri import write_lorri
from lab.simulate.writers.raw_image import RawImage
from lab.simulate.writers.voyager import write_voyager


def raw_suffix(camera: Camera) -> str:
    """Suffix of the camera's raw files. Raises RefusedError for a camera whose format is not written."""
    return _format(camera)[0]


def write_raw_image(raw: RawImage, path: Path) -> None:
    """Write `raw` in its camera's own format. Raises RefusedError for a camera whose format is not written."""
    _format(raw.camera)[1](raw, path)


def _format(camera: Camera) -> tuple[str, Callable[[RawImage, Path], None]]:
    formats = {
        "voyager-vicar": (".IMG", write_voyager),
        "galileo-redr": (".IMG", write_galileo),
        "lorri-fits": (".fit", write_lorri),
    }
    found = formats.get(camera.label_dialect or "")
    if found is None:
        raise RefusedError(
            Reason.FORMAT_NOT_WRITTEN,
            f"files of camera {camera.name} ({camera.label_dialect or 'no label dialect'}) cannot be written.",
            f"Formats that can: {', '.join(formats)}.",
        )
    return found
