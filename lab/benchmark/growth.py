"""How the cost of a store grows with its products: links of one small product, rows of one index, plans of one image.

Processor seconds (user and system) of this process and its children; each part whose memory is measured runs in a
process of its own. What an image's own correction costs is left out (`planetpose benchmark steps`): it does not grow.
"""

import math
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from flows.options import BOOKS
from lab.benchmark.growth_plan import plan_of_many
from lab.benchmark.spent import Links, in_a_process, processor_seconds, remembered
from tasks.atomic import folder_put_in_place
from tasks.outcomes import IMAGES, Outcome, write_outcome
from tasks.publish import publish
from tasks.publish.index_rows import GROUP
from tasks.publish.names import RESULT
from tasks.report.page import COLUMNS

if TYPE_CHECKING:
    import pandas as pd

COUNTS = (100, 300, 1000, 3000, 10_000)
EXPONENT = 1.05
Figures = dict[str, Any]
Show = Callable[[str, Figures], None]


def benchmark_growth(products: int, rows: int, show: Show) -> None:
    """Show the figures of each part beside its bars. products: in the stores that are listed, planned and reported;
    rows: of the index that is opened."""
    from lab.benchmark.index import small_publication

    with TemporaryDirectory() as scratch:
        folder = Path(scratch)
        first = small_part(publish(small_publication(), folder / "whole"), folder / "one")
        for name, part in (
            ("batch", lambda: batch(first, folder / "batch", products)),
            ("index", lambda: index_of_many(first, folder / "index", products, rows)),
            ("status", lambda: status_of_many(folder / "status", products)),
            ("plan", lambda: plan_of_many(folder / "plan", max(products // 20, 1))),
            ("report", lambda: report_of_many(folder / "report", products)),
        ):
            show(name, part())


def small_part(product: Path, store: Path) -> Path:
    """What the index reads of a product, as a product of its own."""
    for name in (GROUP, RESULT):
        (store / product.name / name).parent.mkdir(parents=True, exist_ok=True)
        (store / product.name / name).write_bytes((product / name).read_bytes())
    return store / product.name


def batch(first: Path, folder: Path, products: int) -> Figures:
    """What publishing and remembering N images costs beside their correction, as `correct` and `reprocess` do it, and
    the exponent of its growth with N."""
    from tasks.objectstore.places import Indexing

    seconds = {}
    for count in [each for each in COUNTS if each <= products]:
        store = folder / str(count)
        store.mkdir(parents=True)
        links = Links(first)
        with processor_seconds() as spent, Indexing() as indexing:
            for number in range(count):
                name = f"P{number:07d}"
                with folder_put_in_place(store / name) as temporary:
                    temporary.rmdir()
                    links.put(temporary)
                write_outcome(store / BOOKS, outcome_of(name), {"steps": []})
                indexing.note(store, {"status": "ok", "cached": [], "product": name})
        seconds[count] = round(spent[0], 3)
    return {"seconds": seconds, "exponent": exponent_of(seconds), "bar": {"exponent": EXPONENT}}


def index_of_many(first: Path, folder: Path, products: int, rows: int) -> Figures:
    """The index after one new product among `products`, and one of `rows` rows opened: the rows' count and the hundred
    latest images."""
    import pyarrow.dataset as dataset

    from catalog.safe_name import INDEX
    from tasks.publish.index import open_index, update_index
    from tasks.publish.index_parts import write_whole

    one = open_index(first.parent)
    store = folder / "grown"
    store.mkdir(parents=True)
    write_whole(store, repeated(one, products))
    Links(first).put(store / "new")
    with processor_seconds() as updated:
        update_index(store, ["new"])
    large = folder / "large"
    large.mkdir()
    write_whole(large, repeated(one, rows))
    with processor_seconds() as opened:
        index = dataset.dataset(large / INDEX)
        count = index.count_rows()
        times = index.to_table(columns=["et"])["et"].to_numpy()
        latest = index.take(times.argsort()[-100:]).to_pandas()
    with processor_seconds() as read:
        open_as_pandas(large)
    return {
        "products": products,
        "update_s": updated[0],
        "rows": count,
        "open_s": opened[0],
        "page": len(latest),
        "read_all_s": read[0],
        "bar": {"update_s": 0.3, "open_s": 1.0},
    }


def open_as_pandas(store: Path) -> None:
    """All rows and columns."""
    import pandas as pd

    from catalog.safe_name import INDEX

    pd.read_parquet(store / INDEX)


def status_of_many(store: Path, products: int) -> Figures:
    """`status` of a store in which every image is remembered."""
    (store / BOOKS / IMAGES).mkdir(parents=True)
    for number in range(products):
        name = f"P{number:07d}"
        (store / name).mkdir()
        remembered(store, outcome_of(name))
    code = (
        "import sys; from pathlib import Path; from flows.status import status_of; "
        "assert status_of(Path(sys.argv[1]), None)['images'] == int(sys.argv[2])"
    )
    return {"products": products, **in_a_process(code, store, products), "bar": {"seconds": 5.0, "mb": 300.0}}


def report_of_many(out: Path, products: int) -> Figures:
    """The report's table: bytes that a browser reads at first."""
    from tasks.report.page import PAGE_ROWS, index_page
    from tasks.report.rows import write_rows

    row: list[Any] = ["P0000000", "P0000000-small.png", None, "ok", "voyager1-issna", "europa"]
    row += ["1979-03-04T05:06:07.123456+00:00"]
    row += [12.345678 + number for number in range(len(COLUMNS) + 3 - len(row))]
    out.mkdir()
    with processor_seconds() as spent:
        files = write_rows(out, ([f"P{number:07d}", *row[1:]] for number in range(products)))
        head = {"written": "", "store": "growth", "made": ""}
        text = index_page([row] * min(products, PAGE_ROWS), Counter(ok=products), [], head)
    at_first = len(text) + (out / "rows" / "rows-0000.js").stat().st_size
    figures = {"products": products, "first_page_mb": at_first / 1e6, "files": files, "seconds": spent[0]}
    return figures | {"bar": {"first_page_mb": 2.0}}


def outcome_of(product: str) -> Outcome:
    """An outcome with the steps of an image."""
    steps = {
        name: {"seconds": 0.5, "peak_mb": 300.0, "cached": False} for name in ("ingest", "pose", "point", "publish")
    }
    return Outcome(product, f"{product}.png", "ok", None, "run", "2026-01-01T00:00:00Z", seconds=2.0, steps=steps)


def repeated(one: "pd.DataFrame", rows: int) -> "pd.DataFrame":
    """An index of so many rows like that of one product, each with a time and numbers of its own."""
    random = np.random.default_rng(0)
    table = one.loc[one.index.repeat(rows)].reset_index(drop=True)
    table["product"] = [f"P{number:07d}" for number in range(rows)]
    table["cube"] = table["product"] + "/cube.zarr"
    table["et"] = np.arange(rows, dtype=np.float64)
    for name in ("phase_deg", "range_km", "limb_rms_px", "centre_x_px", "centre_y_px", "resolution_km"):
        table[name] = random.normal(size=rows)
    return table


def exponent_of(seconds: dict[int, float]) -> float:
    """Slope of log seconds over log count, by least squares."""
    if len(seconds) < 2:
        return math.nan
    return round(float(np.polyfit(np.log(list(seconds)), np.log(list(seconds.values())), 1)[0]), 3)


def kept(figures: Figures) -> bool:
    """Whether every figure that has a bar keeps it."""
    return all(figures[name] <= bar for name, bar in figures["bar"].items())
