"""How quick the page is for a person: first picture, next image, hovering, filtering; and what its server holds."""

import json
import os
import shutil
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from catalog.errors import WrongOptionError
from lab.page.browser import browser_page, find_browser
from lab.page.drive import View, served
from lab.page.many_rows import ROWS, write_many_rows

OPENED, HOVERED = "planetposeTimes.opened", "planetposeTimes.hovered"
PAUSE_S = 1.0  # a person looks at a picture before the next
NEXT, HOVERS = 12, 40
BARS = {"first_picture_s": 2.0, "next_image_s": 0.3, "hover_ms": 50.0, "filter_s": 0.3, "server_mb": 500.0}
FILTER = """(async () => {
    const { backend } = await import("./static/api.js"), begun = performance.now();
    await backend.rows({ text: "sigma > TEXT and limb > 0.5", sort: "limb", down: true }, 0, 100);
    return performance.now() - begun;
})()"""


def benchmark_page(source: Path, products: int) -> dict[str, Any]:
    """Figures of a store of `products` links of the source's products, beside their bars.

    first_picture_s: from the address typed to the picture; next_image_s: medians and largest, after a pause of 1 s and
    leafing without one; hover_ms; filter_s: of 100 000 rows; server_mb: resident memory of the server of these rows.

    Raises WrongOptionError without a browser or without products in the source.
    """
    from tasks.publish.index import open_index

    program = find_browser()
    if program is None:
        raise WrongOptionError(
            "STORE", "Neither Chromium nor Chrome is installed.", "Install one, for example Debian's package chromium."
        )
    with TemporaryDirectory() as place:
        scratch = Path(place)
        store = linked_store(source, scratch / "store", products)
        open_index(store)
        with browser_page(program, scratch / "browser") as page:
            view = View(page)
            found = looked_through(view, store)
            found |= filtered_rows(view, source, scratch / "many.parquet")
    return found


def linked_store(source: Path, folder: Path, products: int) -> Path:
    """A store of hard links of the source's products, each under its own name. Raises WrongOptionError without any."""
    models = sorted(path.parent for path in source.glob("*/cube.zarr"))
    if not models:
        raise WrongOptionError(
            "STORE", f"{source} holds no product.", "Give a store, such as that of `planetpose demo`."
        )
    for number in range(products):
        model = models[number % len(models)]
        name = f"{model.name}-{number:05d}"
        shutil.copytree(model, folder / name, copy_function=os.link)
        for file, keys in (("cube.zarr/zarr.json", ("attributes",)), ("result.json", ())):
            renamed(folder / name / file, name, keys)
    return folder


def renamed(file: Path, name: str, keys: tuple[str, ...]) -> None:
    """Write the product's name into a JSON file that was a link."""
    content = json.loads(file.read_text())
    part = content
    for key in keys:
        part = part[key]
    part["product"] = name
    file.unlink()
    file.write_text(json.dumps(content))


def looked_through(view: View, store: Path) -> dict[str, Any]:
    """First picture, next images with and without a pause, hovering."""
    with served(store) as url:
        found: dict[str, Any] = {"first_picture_s": view.open(url)}
        for name, pause in (("next_image_s", PAUSE_S), ("leafing_s", 0.0)):
            seconds = []
            for _ in range(NEXT):
                time.sleep(pause)
                count = view.page.ask(f"{OPENED}.length")
                view.press("j")
                view.wait(f"{OPENED}.length > {count}")
                seconds.append(view.page.ask(f"{OPENED}.at(-1).ms") / 1000)
            found[name] = float(np.median(seconds))
            found[f"{name}_largest"] = max(seconds)
        x, y = view.middle("#picture")
        for step in range(HOVERS):
            view.mouse("mouseMoved", x + step, y)
        found["hover_ms"] = float(np.median(view.page.ask(HOVERED)))
    return found


def filtered_rows(view: View, store: Path, index: Path) -> dict[str, Any]:
    """A filter with a sorting of 100 000 rows, and the server's memory after it."""
    from lab.page import many_rows

    write_many_rows(store, index, ROWS)
    with served(store, program=many_rows.__file__, index=str(index)) as url:
        view.open(url)
        seconds = [view.page.ask(FILTER.replace("TEXT", str(0.1 + 0.1 * step))) / 1000 for step in range(5)]
        memory = view.page.ask("fetch('api/memory').then((answer) => answer.json())")["mb"]
    return {"filter_s": float(np.median(seconds)), "server_mb": memory}
