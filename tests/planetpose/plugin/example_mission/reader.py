"""The mission's format: a line of text, a line of JSON, and the pixels as little-endian float32."""

import json
from pathlib import Path

import numpy as np

from planetpose import ExposureTime, PartialPose, Reading

MAGIC = b"EXAMPLE IMAGE 1\n"


class ExampleReader:
    """Recognises and reads files of the mission."""

    def recognises(self, head: bytes, path: Path) -> bool:
        """By the first line; `head` has the file's first 4096 bytes."""
        return head.startswith(MAGIC)

    def read(self, path: Path) -> Reading:
        """Pixels, and what the label says of them."""
        with path.open("rb") as file:
            file.readline()
            label = json.loads(file.readline())
            pixels = np.frombuffer(file.read(), "<f4").reshape(label["lines"], label["samples"])
        pose = PartialPose.from_dict(label["pose"])
        return Reading(
            format="example",
            image=pixels,
            instrument_names=("EXAMPLE ORBITER/NAC",),
            targets=(label["target"],),
            time=ExposureTime(pose.et),
            label_pose=pose,
            label={"TARGET": label["target"]},
        )
