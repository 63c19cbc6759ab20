"""The page of `planetpose view` as files for any web server: it shows, and changes nothing."""

import gzip
import json
import shutil
from pathlib import Path
from typing import Any

from tasks.atomic import folder_put_in_place
from tasks.boundary import reason_of, trouble_of
from tasks.pictures.thumbnail import thumbnail_of
from viewer.app import PAGE, page_files
from viewer.filters import filtered
from viewer.planes import Planes, tile_places
from viewer.product import advice_of, product_page
from viewer.side import Side
from viewer.table import columns_of, plain_value

DATA, SMALL = "data", "small.png"
# What hovering needs, the image and what is looked at most; distances and simulations are left to the server.
PLANES = (
    "image", "latitude", "longitude", "incidence", "emission", "phase", "quality",
    "latitude_uncertainty", "longitude_uncertainty", "resolution_km",
)  # fmt: skip
GZIP_LEVEL = 5


def export_store(store: Path, folder: Path, only: str = "") -> int:
    """Write the page of the images that fit the filter `only` into the new folder `folder`; returns how many there are.
    An image whose product cannot be read is in the table, with the reason. Raises RefusedError when there is no store,
    WrongOptionError for a wrong filter, FileExistsError when the folder holds something else."""
    side = Side(store)
    table = side.table.table[filtered(side.table.table, only)]
    if folder.is_dir() and any(folder.iterdir()) and not (folder / DATA / "table.json").is_file():
        raise FileExistsError(f"{folder} holds something else: give a new folder")
    columns = list(columns_of(table))
    rows = [[plain_value(value) for value in row] for row in table.itertuples(index=False)]
    with folder_put_in_place(folder) as temporary:
        (temporary / "static").mkdir()
        for path in page_files():
            shutil.copyfile(path, temporary / "static" / path.name)
        page = PAGE.read_text(encoding="utf-8").replace("@TOKEN@", "").replace("@DATA@", DATA).replace("@FIRST@", "")
        (temporary / "index.html").write_text(page, encoding="utf-8")
        products, names = temporary / DATA / "products", [column["name"] for column in columns]
        pictured: list[str] = []
        for row in rows:
            values = dict(zip(names, row, strict=True))
            name = str(values["product"])
            write_product_page(side.planes, values, products / name, side.table.worst(name))
            pictured += [name] if (products / name / SMALL).is_file() else []
        about = {"store": side.store.resolve().name, "other": None, "who": ""}
        table_json = {**about, "columns": columns, "rows": rows, "pictured": pictured}
        write_json(temporary / DATA / "table.json", table_json)
    return len(rows)


def write_product_page(planes: Planes, row: dict[str, Any], folder: Path, worst: str = "") -> None:
    """Page, tiles and small picture of a product; without its picture where it has none, or cannot be read."""
    product = str(row["product"])
    folder.mkdir(parents=True)
    shown: dict[str, Any] = {"product": product, "row": row, "decisions": [], "advice": advice_of(row.get("reason"))}
    shown["worst"] = worst

    def write_pictures() -> None:
        page = product_page(planes, product)
        page["planes"] = [plane for plane in page["planes"] if plane["name"] in PLANES]
        page.get("result", {}).pop("image", None)  # a path of this machine, as the Prefect run is one's own
        page.pop("run", None)
        for plane in page["planes"]:
            write_tiles(planes, product, plane["name"], page["levels"], folder / plane["name"])
        (folder / SMALL).write_bytes(thumbnail_of(planes.cube(product)))
        shown.update(page)

    if row["status"] != "unreadable" and planes.place(product) is not None:
        trouble = trouble_of(write_pictures, product)
        planes.forget(product)
        if trouble is not None:
            shown["row"] = row | {"reason": reason_of(trouble)}
    write_json(folder / "page.json", shown)


def write_tiles(planes: Planes, product: str, plane: str, levels: int, folder: Path) -> None:
    """All tiles of a plane, each compressed."""
    folder.mkdir()
    for level in range(levels):
        for column, row in tile_places(planes.plane(product, plane, level).shape):
            content = gzip.compress(planes.tile(product, plane, level, column, row), GZIP_LEVEL, mtime=0)
            (folder / f"{level}-{column}-{row}.bin.gz").write_bytes(content)


def write_json(path: Path, content: Any) -> None:
    """One JSON file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content, allow_nan=False), encoding="utf-8")
