"""planetpose index STORE"""

from pathlib import Path
from typing import Annotated

import typer

SHOWN = (
    "product", "status", "utc", "camera", "target", "sub_observer_latitude_deg", "sub_observer_longitude_deg",
    "phase_deg", "range_km", "resolution_km", "limb_rms_px",
)  # fmt: skip


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(index)


def index(
    store: Annotated[str, typer.Argument(help="Folder of products, or s3://bucket/prefix.")] = "out",
    json: Annotated[bool, typer.Option("--json", help="One JSON object per product on stdout.")] = False,
    rebuild: Annotated[bool, typer.Option("--rebuild", help="Read every product again.")] = False,
) -> None:
    """Update STORE/index.parquet and print it: one row per image."""
    import json as json_module

    from flows.cli.output import clean_stdout
    from tasks.objectstore.location import is_url
    from tasks.objectstore.places import index_object_store
    from tasks.publish.index import INDEX, open_index, rebuild_index

    with clean_stdout() as answer:
        if is_url(store):
            table = index_object_store(store)
        else:
            table = rebuild_index(Path(store)) if rebuild else open_index(Path(store))
        if json:
            for row in json_module.loads(table.to_json(orient="records", date_format="iso", date_unit="us")):
                print(json_module.dumps(row), file=answer)
            return
        shown = table[list(SHOWN)].copy()
        shown["utc"] = shown["utc"].dt.strftime("%Y-%m-%dT%H:%M:%SZ")
        columns = [name.removesuffix("_deg").replace("sub_observer_", "observer_") for name in SHOWN]
        text = shown.to_string(index=False, header=columns, float_format=lambda value: f"{value:.6g}", na_rep="-")
        print(text if len(table) else "no products", file=answer)
        print(f"{len(table)} products in {store.rstrip('/')}/{INDEX}", file=answer)
