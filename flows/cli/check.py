"""planetpose check PATH..."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from tasks.publish.check import Fault


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(check)


def check(
    paths: Annotated[
        list[str],
        typer.Argument(help="Stores, or products' folders; stores may be s3://bucket/prefix.", show_default=False),
    ],
    json: Annotated[bool, typer.Option("--json", help="One JSON object per product on stdout.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Only products with faults.")] = False,
) -> None:
    """Check published products: checksums, schema, values, provenance, and geometry against their own pose."""
    import sys

    from catalog.plain_text import printable
    from flows.cli.output import clean_stdout, write_json

    sound, count = 0, 0
    with clean_stdout() as answer:
        for folder, faults in each_checked(paths):
            count, sound = count + 1, sound + (not faults)
            if json:
                named = [{"kind": fault.kind, "fault": fault.text} for fault in faults]
                write_json(
                    answer,
                    {
                        "product": printable(Path(folder).name),
                        "path": printable(folder),
                        "sound": not faults,
                        "faults": named,
                    },
                )
                continue
            for fault in faults:
                print(f"{folder}: {fault}", file=answer)
            if not faults and not quiet:
                print(f"{folder}: sound", file=answer, flush=True)
        if not json:
            print(f"{sound} of {count} products sound", file=answer)
    sys.exit(0 if sound == count else 1)


def each_checked(paths: list[str]) -> "Iterator[tuple[str, list[Fault]]]":
    """Every product's place and faults; one in an object store is copied here for as long as that takes."""
    from tasks.objectstore.location import is_url, open_object_store
    from tasks.objectstore.reading import local_copy, whole_products
    from tasks.publish.check import products_in

    for path in paths:
        if not is_url(path):
            yield from ((str(folder), faults_in(folder)) for folder in products_in(Path(path)))
            continue
        store = open_object_store(path)
        for product in whole_products(store):
            with local_copy(store, product) as folder:
                yield f"{store.url}/{product}", faults_in(folder)


def faults_in(folder: Path) -> "list[Fault]":
    """Faults of one product; one that cannot be looked at has that as its fault."""
    from flows.boundary import reason_of, trouble_of
    from tasks.publish.check import Fault, product_faults

    faults: list[Fault] = []
    error = trouble_of(lambda: faults.extend(product_faults(folder)), folder.name)
    return faults if error is None else [Fault("file", f"the product cannot be checked: {reason_of(error)}")]
