"""What the plan of a list of unchanged images costs, by links of one image and of its product."""

import time
from dataclasses import replace
from pathlib import Path
from typing import Any

from catalog.digest import SETTLED_NS
from flows.options import ReprocessOptions
from lab.benchmark.spent import Links, in_a_process, remembered
from tasks.outcomes import IMAGES

PLANNED = 100_000


def plan_of_many(folder: Path, products: int) -> dict[str, Any]:
    """The plan of a list of unchanged images by two processes: links of one image and its product, remembered under
    many names. per_100000_s: what so many would take at the same cost each, clock seconds of two processes."""
    code = "import sys; from lab.benchmark.growth_plan import prepare_plans as f; f(sys.argv[1], int(sys.argv[2]))"
    in_a_process(code, folder, products)
    code = "import sys; from lab.benchmark.growth_plan import plan_all as f; f(sys.argv[1], int(sys.argv[2]))"
    found = in_a_process(code, folder, products)
    start = in_a_process(code, folder, 1)["seconds"]
    per_100000_s = round((found["seconds"] - start) / products * PLANNED / 2, 1)
    return {"products": products, **found, "per_100000_s": per_100000_s, "bar": {"per_100000_s": 60.0, "mb": 300.0}}


def plan_options(folder: Path) -> ReprocessOptions:
    """Of the list and store in `folder`."""
    archive = folder / "archive"
    return ReprocessOptions(
        images=str(archive / "many.csv"),
        store=str(folder / "store"),
        profile=str(archive / "small.toml"),
        kernels=(),
        cache=folder / "cache",
    )


def prepare_plans(place: str, products: int) -> None:
    """Correct one image, and link image and product under many names, each remembered as unchanged."""
    from catalog.spice import KernelLists
    from flows.reprocessing.fingerprint import Fingerprints
    from flows.reprocessing.image_task import job_of
    from flows.reprocessing.image_task import outcome_of as outcome_of_job
    from flows.reprocessing.planning import plan_of
    from flows.reprocessing.worker import do
    from flows.requests import requests_of_list
    from lab.simulate.small_archive import write_small_archive

    options = plan_options(Path(place))
    listed = write_small_archive(Path(options.images).parent, 1)
    head, row = listed.read_text().splitlines()
    names = [f"P{number:07d}" for number in range(products)]
    Path(options.images).write_text("\n".join([head, *(row.replace("small-00000", name) for name in names)]) + "\n")
    said: list[dict[str, Any]] = []
    request = requests_of_list(options.model_copy(update={"images": str(listed)}))[0]
    plan = plan_of(request, options)
    do(request, lambda kind, **content: said.append({"kind": kind, **content}))
    outcome = outcome_of_job(job_of(plan, options, "growth"), said[-1])
    images, made = Links(request.image), Links(request.product_folder)
    for name in names:
        images.put(listed.parent / f"{name}.png")
        made.put(options.folder / name)
    time.sleep(SETTLED_NS / 1e9 + 0.1)  # links change the time of what they lead to
    fingerprints = Fingerprints(KernelLists())
    (options.books / IMAGES).mkdir(parents=True, exist_ok=True)
    for each in requests_of_list(options):
        fingerprint = fingerprints.of(each)
        known = replace(outcome, product=each.product, image=str(each.image), fingerprint=fingerprint)
        remembered(options.folder, known)


def plan_all(place: str, products: int) -> None:
    """Plan the first of them by two processes. Raises RuntimeError when one is not unchanged."""
    from flows.reprocessing.run import planned

    options = plan_options(Path(place))
    if products == 1:
        options = options.model_copy(update={"only": ("P0000000",)})
    wanted = [plan.why for plan in planned(options)[1] if plan.do]
    if wanted:
        raise RuntimeError(f"{len(wanted)} images would be done: {wanted[0]}")
