"""Render and correct the scenes, as many processes at a time as wanted; what is done is not done again."""

import json
import os
import shutil
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from catalog.digest import sha256_of_file, sha256_of_json
from lab.honesty.scene import Scene
from lab.honesty.table import all_scenes
from lab.rows import read_rows
from tasks.profile import Profile

if TYPE_CHECKING:
    from flows.chain import Chain

Row = dict[str, Any]
ROOT = Path(__file__).resolve().parents[2]
ROWS = "scenes.jsonl"
# What a row depends on, beside its scene and profile.
SOURCES = (
    "catalog/**/*.py",
    "catalog/**/*.toml",
    "tasks/**/*.py",
    "flows/*.py",
    *(f"lab/honesty/{name}.py" for name in ("laws", "solids", "caster", "optics", "geometry", "picture", "recording")),
)
KEPT = (
    "status",
    "reason",
    "centre_px",
    "range_factor",
    "range_factor_free",
    "attitude_deg",
    "roll_deg",
    "psf_sigma_px",
    "uncertainty",
    "limb_rms_px",
    "limb_points",
    "pose",
    "seconds",
)
# What the joint step found of the image that its pose does not tell.
SHOWN = ("displacement", "step", "led_by_limb", "detector", "smear", "second_start_px")
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class Job:
    """One scene to be corrected with one profile. folder: where its files may be while it is."""

    scene: Scene
    profile: Profile
    folder: Path
    keep: bool = False

    @property
    def key(self) -> str:
        """Digest of all that the row depends on."""
        held = self.profile.resolved()
        return sha256_of_json({"scene": self.scene.to_dict(), "profile": held, "code": code_digest()})


@cache
def code_digest() -> str:
    """Digest of the code that renders and corrects."""
    paths = sorted({path for pattern in SOURCES for path in ROOT.glob(pattern)})
    return sha256_of_json({path.relative_to(ROOT).as_posix(): sha256_of_file(path) for path in paths})


def chosen_scenes(
    count: int | None, groups: Sequence[str] = (), only: Sequence[str] = (), draw: int = 0
) -> list[Scene]:
    """Scenes of the table of a draw: those of `groups` and `only`, all without; of them `count`, spread over groups,
    sizes and laws. Groups take turns, so that the first part of the list is like the whole."""
    table = all_scenes(draw)
    wanted = [scene for scene in table if (scene.group in groups or scene.id in only) or not (groups or only)]
    by_group: dict[str, list[Scene]] = {}
    for scene in wanted:
        by_group.setdefault(scene.group, []).append(scene)
    share = 1.0 if count is None else min(count / max(len(wanted), 1), 1.0)
    turns: list[tuple[float, Scene]] = []
    for place, scenes in enumerate(by_group.values()):
        number = max(1, round(share * len(scenes)))
        # Each group begins elsewhere: at the same place of every group, laws and lenses are the same.
        begin = (0.618 * (place + 1)) % 1
        places = [int((k + begin) * len(scenes) / number) for k in range(number)]
        turns += [(rank / number, scenes[places[mixed(rank, number)]]) for rank in range(number)]
    return [scene for _, scene in sorted(turns, key=lambda turn: turn[0])]


def mixed(rank: int, number: int) -> int:
    """A permutation of range(number) in which neighbours are far apart."""
    from math import gcd

    step = next(s for s in range(max(1, round(0.382 * number)), number + 2) if gcd(s, number) == 1)
    return rank * step % number


def run_scenes(
    scenes: Sequence[Scene],
    profile: Profile,
    out: Path,
    workers: int = 1,
    minutes: float | None = None,
    keep: bool = False,
    tell: Callable[[Row], None] = lambda _: None,
) -> list[Row]:
    """Rows of `scenes`, in their order; each is added to `out`/scenes.jsonl as soon as it is done, and one that is
    there for the same scene, profile and code is taken from there. minutes: no scene is begun later; those left out
    have no row. keep: the scene's files and product stay in `out`/work."""
    out.mkdir(parents=True, exist_ok=True)
    jobs = [Job(scene, profile, (out / "work" / scene.id).absolute(), keep) for scene in scenes]
    done = {row["key"]: row for row in read_rows(out / ROWS)}
    waiting = [job for job in jobs if job.key not in done]
    with (out / ROWS).open("a", encoding="utf-8") as file:
        for row in in_processes(waiting, workers, minutes):
            file.write(json.dumps(row, allow_nan=False) + "\n")
            file.flush()
            done[row["key"]] = row
            tell(row)
    return [done[job.key] for job in jobs if job.key in done]


def in_processes(jobs: Sequence[Job], workers: int, minutes: float | None) -> Iterator[Row]:
    """Rows as they are done. One worker: this process."""
    end = None if minutes is None else time.monotonic() + 60 * minutes
    if workers == 1:
        for job in jobs:
            if end is not None and time.monotonic() > end:
                return
            yield run_scene(job)
        return
    from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
    from multiprocessing import get_context

    for name in ONE_THREAD:
        os.environ.setdefault(name, "1")
    left = iter(jobs)
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        running: set[Future[Row]] = set()
        while True:
            while len(running) < workers and (end is None or time.monotonic() < end):
                following = next(left, None)
                if following is None:
                    break
                running.add(pool.submit(run_scene, following))
            if not running:
                return
            finished, running = wait(running, return_when=FIRST_COMPLETED)
            for future in finished:
                yield future.result()


def run_scene(job: Job) -> Row:
    """Render one scene and correct it as `planetpose correct` would, without Prefect. The row, plain JSON: id, key,
    scene, truth, result (`KEPT` keys), covariance (8, 8) of the joint step or None, shown (`SHOWN` keys of its
    evidence), cpu_s of rendering and correcting."""
    from lab.honesty.picture import write_scene

    shutil.rmtree(job.folder, ignore_errors=True)
    started = time.process_time()
    files, truth = write_scene(job.scene, job.folder)
    rendered = time.process_time()
    from flows.one_image import one_result
    from flows.progress import Silent
    from flows.request import Request
    from lab.evaluate.archive import replayed
    from tasks.step import run

    loaded = time.process_time()
    profile = job.profile.holding(job.scene.hold) if job.scene.hold else job.profile
    request = Request(
        image=files.image,
        store=job.folder / "out",
        cache=job.folder / "cache",
        camera=str(files.camera),
        target=job.scene.stated_target,
        pose_file=files.pose,
        basemap=files.map,
        kernels=(),
        profile=profile,
    )
    result = one_result(request, Silent(), run_step=run)
    corrected = time.process_time()
    chain = replayed(request)
    row = {
        "id": job.scene.id,
        "key": job.key,
        "profile": job.profile.name,
        "scene": job.scene.to_dict(),
        "truth": truth,
        "result": {name: result[name] for name in KEPT},
        "covariance": covariance_of(chain),
        "shown": shown_of(chain),
        "cpu_s": {"render": rendered - started, "correct": corrected - loaded},
    }
    if not job.keep:
        shutil.rmtree(job.folder, ignore_errors=True)
    return json.loads(json.dumps(row))


def covariance_of(chain: "Chain") -> Any:
    """The covariance that the last step which tells one has in its evidence."""
    reported = [done.record.result.get("evidence", {}).get("covariance") for done in chain.done.values()]
    return next((matrix for matrix in reversed(reported) if matrix is not None), None)


def shown_of(chain: "Chain") -> Any:
    """What the last joint step has in its evidence of `SHOWN`; None without one."""
    for done in reversed(chain.done.values()):
        evidence = done.record.result.get("evidence", {})
        if "displacement" in evidence:
            return {name: evidence[name] for name in SHOWN}
    return None
