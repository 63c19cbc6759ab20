"""A plugin's reader, with what it gives checked: faults of its own are refusals that name it."""

import logging
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from catalog.errors import RefusedError
from catalog.plugins import Plugin
from catalog.readers.names import targets_of_label
from catalog.readers.reading import Reader, Reading, checked_shape

logger = logging.getLogger("planetpose")


@dataclass(frozen=True)
class PluggedReader:
    """reader: the plugin's own."""

    plugin: Plugin
    reader: Reader

    def recognises(self, head: bytes, path: Path) -> bool:
        """As the plugin says; no where it fails over a file that may be none of its own."""
        try:
            with self.plugin.guarded(f"cannot say whether it reads image {path}"):
                return bool(self.reader.recognises(head, path))
        except RefusedError as error:
            logger.warning("planetpose: %s", error.reason)
            return False

    def read(self, path: Path, plane: str | None = None) -> Reading:
        """The file as the plugin reads it, which chooses the plane. Raises RefusedError when the plugin fails,
        or gives no picture."""
        with self.plugin.guarded(f"cannot read image {path}"):
            reading = self.reader.read(path)
            if not isinstance(reading, Reading):
                raise self.plugin.fault(f"gives {type(reading).__name__} for image {path} instead of a Reading")
            image = np.asarray(reading.image)
            if image.ndim != 2 or image.dtype.kind not in "buif":
                raise self.plugin.fault(f"gives {image.dtype} {image.shape} for image {path} instead of a grey picture")
            checked_shape(path, *image.shape)
            for name in ("quality", "noise"):
                plane = getattr(reading, name)
                if plane is not None and np.shape(plane) != image.shape:
                    raise self.plugin.fault(f"gives {name} {np.shape(plane)} for image {path} of {image.shape}")
            image = image.astype(np.uint8) if image.dtype.kind == "b" else image
            return replace(reading, image=image, targets=targets_of_label(list(reading.targets)))


def readers_of(plugin: Plugin) -> list[tuple[str, PluggedReader]]:
    """The reader of a plugin: an object with `recognises` and `read`, or a class of such. Raises RefusedError for
    anything else."""
    given = plugin.load()
    reader = given() if isinstance(given, type) else given
    if not (callable(getattr(reader, "recognises", None)) and callable(getattr(reader, "read", None))):
        raise plugin.fault("has no functions `recognises` and `read`")
    return [(plugin.name, PluggedReader(plugin, reader))]
