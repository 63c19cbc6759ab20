"""The table of faults: every scenario, and what is there after the same command was run once more."""

import random
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lab.faults.ground import Ground, look_at
from lab.faults.scenarios import KILLS, SINGLE, Disturb, disks_taken_down, ended, enlarge
from local_server.server import ServerFiles, end

Row = dict[str, Any]


def benchmark_faults(
    folder: Path, images: int, kills: int, seed: int, only: tuple[str, ...] = (), tell: Callable[[Row], None] = print
) -> list[Row]:
    """Rows of all scenarios: scenario, what happened, what the rerun said, ok (images that are right after it), wrong,
    lost, left (temporaries), seconds, good. The folder is used for everything and emptied of what is good."""
    ground = Ground(folder, images)
    chance = random.Random(seed)
    names = list(KILLS)
    scenarios = [(names[number % len(names)], KILLS[names[number % len(names)]]) for number in range(kills)]
    rows: list[Row] = []
    try:
        ground.prepare()
        for name, disturb in [*scenarios, *SINGLE.items()]:
            if only and name not in only:
                continue
            rows.append(row_of(ground, name, disturb, chance, len(rows)))
            tell(rows[-1])
    finally:
        end(ServerFiles(folder / "state" / "server"))
    return rows


def row_of(ground: Ground, name: str, disturb: Disturb, chance: random.Random, number: int) -> Row:
    """One scenario and the run after it."""
    place = ground.place(f"{number:02d}-{name.replace(' ', '-')}")
    started = time.monotonic()
    with disks_taken_down(place.folder):
        happened = disturb(ground, place, chance)
        enlarge(place.folder)
        command = ground.start(place)
        rerun = ended(command)
        look = look_at(place, ground)
    good = look.is_good and look.ok == ground.images
    if good:
        shutil.rmtree(place.folder, ignore_errors=True)
    return {
        "scenario": name,
        "happened": happened,
        "rerun": rerun,
        "ok": look.ok,
        "images": ground.images,
        "wrong": list(look.wrong),
        "lost": list(look.lost),
        "left": list(look.left),
        "seconds": round(time.monotonic() - started, 1),
        "good": good,
    }


def line_of(row: Row) -> str:
    """One row for people."""
    trouble = ", ".join(f"{kind} {row[kind]}" for kind in ("wrong", "lost", "left") if row[kind])
    verdict = f"{row['ok']}/{row['images']} right" + (f"; {trouble}" if trouble else "")
    return f"{row['scenario']:18s} {row['seconds']:6.1f} s  {verdict}  | {row['happened']} | rerun: {row['rerun']}"
