"""Write the report: pictures, one page per image, the index page; nothing is linked but what is in the folder.

Images are worked on by several processes, and only those whose page would be another one; memory does not grow with
what the pages say."""

import json
import multiprocessing
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

from catalog.times import now_utc
from tasks.code_version import code_version
from tasks.publish.index import open_index
from tasks.publish.index_rows import UNREADABLE
from tasks.report.image import PAGES, PICTURES, Job, Made, digest_of_all, made_of, make_image, neighbours_of, unchanged
from tasks.report.page import PAGE_ROWS, index_page, row_of_table
from tasks.report.pictures import FIGURES, USUAL, distributions
from tasks.report.rows import write_rows

if TYPE_CHECKING:
    import pandas as pd

INDEX_PAGE, TABLE = "index.html", "images.csv"
AT_ONCE = 256  # images that are planned together
FEW = 8  # images that one process has done before others have started
DRAWING = ("tasks.pictures.residual_figure", "tasks.pictures.planes_figure", "tasks.pictures.thumbnail")
LOST = "a process ended while it drew this image"


@dataclass(frozen=True)
class Report:
    """page: the index. images: how many have a page; missing: pictures that could not be drawn, and why; broken:
    products that could not be read, and why; drawn: how many images were not as an earlier report has them."""

    page: Path
    images: int
    missing: dict[str, str]
    broken: dict[str, str]
    drawn: int = 0


def write_report(
    store: Path,
    out: Path,
    kinds: Sequence[str] = USUAL,
    tell: Callable[[str], None] = lambda _: None,
    workers: int = 1,
) -> Report:
    """Write the report of `store` into the folder `out`. kinds: which pictures each image gets (`KINDS`). workers:
    processes that draw. A picture that cannot be drawn is explained on the image's page. Raises RefusedError when there
    is no store."""
    index = open_index(store)
    for name in (PAGES, PICTURES, FIGURES):
        (out / name).mkdir(parents=True, exist_ok=True)
    head = {"written": now_utc(), "store": Path(store).resolve().name}
    tables = _Tables(tell)
    jobs = _jobs(index, Path(store), out, tuple(kinds), head)
    write_rows(out, (tables.row(job, made, new) for job, made, new in done_images(jobs, workers)))
    text = index.drop(columns=["stamp"]).to_csv(index=False)
    (out / TABLE).write_text(text, encoding="utf-8")
    key = digest_of_all(text, code_version("tasks.report.pictures"))
    figures = distributions(index, out / FIGURES, same=made_of(out / INDEX_PAGE).get("figures") == key)
    text = index_page(tables.first, tables.verdicts, figures, head | {"made": json.dumps({"figures": key})})
    (out / INDEX_PAGE).write_text(text, encoding="utf-8")
    return Report(out / INDEX_PAGE, len(index), tables.missing, tables.broken, tables.drawn)


class _Tables:
    """What is kept of the images: counts, the rows that the page shows at first, and faults."""

    def __init__(self, tell: Callable[[str], None]) -> None:
        self.tell, self.drawn = tell, 0
        self.verdicts: Counter[str] = Counter()
        self.first: list[list[object]] = []
        self.missing: dict[str, str] = {}
        self.broken: dict[str, str] = {}

    def row(self, job: Job, made: Made, new: bool) -> list[object]:
        """Note an image and return its row of the table."""
        if new:
            self.tell(made.product)
        self.drawn += new
        self.verdicts[made.status] += 1
        self.missing |= {f"{made.product} {kind}": why for kind, why in made.missing.items()}
        if made.status == UNREADABLE:
            self.broken[made.product] = made.reason
        row = row_of_table(job.row | {"status": made.status}, made.thumbnail, made.reason)
        if len(self.first) < PAGE_ROWS:
            self.first.append(row)
        return row


def _jobs(index: "pd.DataFrame", store: Path, out: Path, kinds: tuple[str, ...], head: dict[str, str]) -> Iterator[Job]:
    products = list(index["product"])
    for first in range(0, len(index), AT_ONCE):
        for place, row in enumerate(index.iloc[first : first + AT_ONCE].to_dict("records"), first):
            named = {str(name): value for name, value in row.items()}
            yield Job(store, out, named, kinds, neighbours_of(products, place), head)


def done_images(jobs: Iterator[Job], workers: int) -> Iterator[tuple[Job, Made, bool]]:
    """Every image in order, and whether it was made anew; by `workers` processes where there is much to do."""
    pool: ProcessPoolExecutor | None = None
    try:
        while batch := list(islice(jobs, AT_ONCE)):
            known = [unchanged(job) for job in batch]
            wanted = [job for job, made in zip(batch, known, strict=True) if made is None]
            if workers > 1 and len(wanted) > FEW:
                pool = pool or _new_pool(workers)
                done = iter(_by_processes(pool, wanted))
            else:
                done = map(make_image, wanted)
            for job, made in zip(batch, known, strict=True):
                yield job, made or next(done), made is None
    finally:
        if pool is not None:
            pool.shutdown(cancel_futures=True)


def _by_processes(pool: ProcessPoolExecutor, jobs: list[Job]) -> Iterator[Made]:
    """Images in order. One whose process dies is tried once more in a process of its own, and then left."""
    futures = [_submitted(pool, job) for job in jobs]
    for job, future in zip(jobs, futures, strict=True):
        try:
            if future is not None:
                yield future.result()
                continue
        except BrokenProcessPool:
            pass
        with _new_pool(1) as alone:
            try:
                yield alone.submit(make_image, job).result()
            except BrokenProcessPool:
                yield Made(job.product, str(job.row["status"]), "", None, dict.fromkeys(job.kinds, LOST))


def _submitted(pool: ProcessPoolExecutor, job: Job) -> "Future[Made] | None":
    try:
        return pool.submit(make_image, job)
    except BrokenProcessPool:
        return None


def _new_pool(workers: int) -> ProcessPoolExecutor:
    """Processes that a server forks which has imported what they need; where the system cannot, new ones."""
    method = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
    context = multiprocessing.get_context(method)
    if method == "forkserver":
        context.set_forkserver_preload(["tasks.report.image", *DRAWING])
    return ProcessPoolExecutor(workers, mp_context=context)
