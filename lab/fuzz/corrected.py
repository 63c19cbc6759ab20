"""Correct damaged files that can still be read: is a result that calls itself ok still right?"""

import tempfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from catalog.errors import FailedError, RefusedError
from catalog.readers import read_frame
from catalog.reasons import Reason
from flows.one_image import one_result
from flows.progress import Silent
from flows.request import Request
from lab.fuzz.bench import Damaged, Original, damaged_files
from tasks.profile import find_profile
from tasks.step import run

RIGHT_PX = 1.0
TRIES_PER_RESULT = 5


@dataclass
class Verdicts:
    """Results of damaged files by status; `wrong ok` are those whose centre is more than a pixel from the undamaged
    file's although nothing was said. furthest_px: of those that are ok."""

    counts: Counter[str] = field(default_factory=Counter)
    wrong: list[dict[str, Any]] = field(default_factory=list)
    furthest_px: float = 0.0

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {"counts": dict(self.counts), "furthest_ok_px": self.furthest_px, "wrong": self.wrong}


def correct_damaged(
    original: Original, count: int, seed: int, passes: int = 1, tell: Callable[[str], None] = lambda _: None
) -> Verdicts:
    """Correct `count` damaged files that are still read, one at a time, with the standard profile of `passes` passes,
    and compare the disk's centre with that of the undamaged file. Raises FailedError when that one is not ok."""
    verdicts = Verdicts()
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        sound = corrected(original.path, place, passes)
        if sound["status"] != "ok":
            raise FailedError(
                Reason.FUZZ_ORIGINAL, f"the undamaged {original.path} is {sound['status']}: {sound['reason']}."
            )
        for damaged in damaged_files([original], TRIES_PER_RESULT * count, seed, place):
            if is_read(damaged.path):
                classify(verdicts, damaged, corrected(damaged.path, place, passes), sound, tell)
            if verdicts.counts.total() == count:
                break
    return verdicts


def is_read(path: Path) -> bool:
    """Whether a reader takes the file."""
    try:
        read_frame(path)
    except RefusedError:
        return False
    return True


def corrected(image: Path, folder: Path, passes: int) -> dict[str, Any]:
    """The result of one image, made in this process without Prefect, by what its label says alone."""
    profile = find_profile("standard").model_copy(update={"passes": passes})
    request = Request(image=image, store=folder / "store", cache=folder / "cache", kernels=(), profile=profile)
    return one_result(request, Silent(), run_step=run)


def classify(
    verdicts: Verdicts, damaged: Damaged, result: dict[str, Any], sound: dict[str, Any], tell: Callable[[str], None]
) -> None:
    """Count one result."""
    status, reported = result["status"], ""
    if status == "ok":
        x, y = (a - b for a, b in zip(result["centre_px"], sound["centre_px"], strict=True))
        distance_px = float((x * x + y * y) ** 0.5)
        verdicts.furthest_px = max(verdicts.furthest_px, distance_px)
        reported = f"{distance_px:.2f} px away"
        if distance_px > RIGHT_PX:
            status = "wrong ok"
            verdicts.wrong.append({"damage": damaged.damage, "file": damaged.path.name, "distance_px": distance_px})
    verdicts.counts[status] += 1
    tell(f"{damaged.path.name} ({damaged.damage}): {status} {reported or result['reason']}")
