"""planetpose benchmark page"""

from pathlib import Path
from typing import Annotated

import typer


def page(
    store: Annotated[Path, typer.Argument(help="Store whose products are linked, such as that of `planetpose demo`.")],
    products: Annotated[int, typer.Option(min=1, help="Products of the store that is opened.")] = 2000,
    json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Open the page of a store in a headless Chromium, look through it as a person would, and compare its times and its
    server's memory with their bars. Exit status 1 when one is not kept."""
    from flows.cli.output import clean_stdout, write_json
    from lab.page.bench import BARS, benchmark_page

    with clean_stdout() as answer:
        found = benchmark_page(store, products)
        if json:
            write_json(answer, found | {"bars": BARS})
        else:
            for name, value in found.items():
                bar = f"  (bar {BARS[name]:g})" if name in BARS else ""
                print(f"{name:24s} {value:8.3g}{bar}", file=answer)
    raise typer.Exit(0 if all(found[name] <= bar for name, bar in BARS.items()) else 1)
