"""The process that reads damaged files: bounded memory, one path a line on stdin, one JSON answer a line on stdout.

What is no refusal ends the process with a traceback: a crash, as it would be in the program.
"""

import hashlib
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from catalog.errors import RefusedError
from catalog.observation import Frame
from catalog.readers import read_frame


def main(memory_bytes: int) -> None:
    """Answer until stdin ends."""
    import resource

    resource.setrlimit(resource.RLIMIT_AS, (memory_bytes, memory_bytes))
    print(json.dumps({"ready": True}), flush=True)
    for line in sys.stdin:
        answer = answered(Path(json.loads(line)))
        answer["peak_mb"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024
        print(json.dumps(answer), flush=True)


def answered(path: Path) -> dict[str, Any]:
    """What became of one file: `refused` with its reason, or `read` with what was read."""
    try:
        frame = read_frame(path)
    except RefusedError as refusal:
        named = path.name in refusal.fault
        return {"outcome": "refused" if named else "refused without naming the file", "reason": refusal.reason[:300]}
    return {"outcome": "read" if is_sound(frame) else "read unsound", **digests(frame)}


def is_sound(frame: Frame) -> bool:
    """Whether a frame is what every later step relies on: finite pixels, positive noise, plain label."""
    observation = frame.observation
    json.dumps(frame.label, allow_nan=False)
    finite = bool(np.isfinite(observation.image).all() and np.isfinite(observation.noise).all())
    times = [value for value in (frame.et, frame.exposure_s) if value is not None]
    return finite and bool((observation.noise > 0).all()) and all(np.isfinite(times))


def digests(frame: Frame) -> dict[str, str]:
    """Fingerprints of pixels and of the metadata that corrections use, to compare with the undamaged file's."""
    observation, pose = frame.observation, frame.label_pose
    pixels = b"".join(np.ascontiguousarray(a).tobytes() for a in (observation.image, observation.quality))
    known = [frame.camera, frame.target, frame.et, frame.undistorted, frame.label_geometry, repr(pose)]
    return {
        "pixels": hashlib.sha256(pixels).hexdigest(),
        "metadata": hashlib.sha256(json.dumps(known, default=str).encode()).hexdigest(),
    }


if __name__ == "__main__":
    main(int(sys.argv[1]))
