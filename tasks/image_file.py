"""The image's file as steps are given it: by content, and where it is."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Annotated

from catalog.choice import Choice
from catalog.digest import input_changed
from catalog.flips import Flip
from catalog.image_mode import ImageMode, Window
from catalog.observation import Frame
from catalog.plugins import READERS
from catalog.readers import read_frame
from catalog.target import Target
from tasks.fields import Content

IMAGES_IN_MEMORY = 4
ReaderName = Annotated[str, Choice("reader of a plugin", READERS)]


class ImageInputs(Content):
    """What of an image's file a result depends on. sha256: of the file, label: of its detached label. target: the
    user's own, a name or what a target file says. flip: how the picture is flipped before anything else. reader: of a
    plugin that reads the file, whose code is part of keys; None where it is read by one of ours. plane, summing,
    window: the user's, see `catalog.readers.read_frame` and `catalog.image_mode`."""

    sha256: str
    label: str | None = None
    target: Target | str | None = None
    flip: Flip | None = None
    reader: ReaderName | None = None
    plane: str | None = None
    summing: int | None = None
    window: Window | None = None

    @property
    def given_target(self) -> Target | None:
        """The target of the user's own file; None where the user gave a name or nothing."""
        return self.target if isinstance(self.target, Target) else None

    @property
    def given_mode(self) -> ImageMode | None:
        """The user's summing and window; None where the user gave neither."""
        if self.summing is None and self.window is None:
            return None
        return ImageMode(self.summing or 1, self.window, "--summing and --window")


@dataclass(frozen=True)
class ImageFiles:
    """image: the file. camera: the user's camera, a name or a file; None leaves it to the label."""

    image: Path
    camera: str | None


def frame_of(image: ImageInputs, files: ImageFiles) -> Frame:
    """The image file, read with the user's camera and target. Raises RefusedError when it cannot be read, or is not the
    one of `image` any more."""
    target = image.target.name if isinstance(image.target, Target) else image.target
    return _frame(files.image, image.sha256, files.camera, target, image.flip, image.plane, image.given_mode)


@lru_cache(maxsize=IMAGES_IN_MEMORY)
def _frame(
    path: Path,
    sha256: str,
    camera: str | None,
    target: str | None,
    flip: Flip | None,
    plane: str | None,
    mode: ImageMode | None,
) -> Frame:
    frame = read_frame(path, camera, target, flip, plane, mode)
    if frame.sha256 != sha256:
        raise input_changed(f"image {path}")
    return frame
