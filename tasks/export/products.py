"""Export products into other tools' forms: one image after the other, then the catalog of them all."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from catalog.errors import RefusedError
from catalog.plain_text import printable
from tasks.boundary import reason_of, status_of, trouble_of
from tasks.export.settings import ExportSettings

if TYPE_CHECKING:
    import pystac

STAC_FOLDER = "stac"


@dataclass
class Exported:
    """What became of one product: the files by format, and the reason where some or all could not be written."""

    product: str
    files: dict[str, Path] = field(default_factory=dict)
    reason: str | None = None
    status: str = "ok"

    def to_dict(self) -> dict[str, Any]:
        """As `--json` prints it."""
        files = {kind: str(path) for kind, path in self.files.items()}
        return {
            "product": self.product,
            "status": self.status,
            "reason": self.reason,
            "files": files,
        }


def export_products(
    folders: Iterable[Path], settings: ExportSettings, out: Path, tell: Callable[[Exported], None] = lambda _: None
) -> list[Exported]:
    """Export every product; one that cannot be does not stop the others."""
    items: list[pystac.Item] = []
    results: list[Exported] = []
    for folder in folders:
        result = Exported(printable(folder.name))
        if result.product in {done.product for done in results}:
            fault = f"{folder} has the name of another product of this command; its files would replace those."
            error: Exception | None = RefusedError("product-twice", fault, "Use another --out for one of them.")
        else:
            error = trouble_of(partial(_export, folder, settings, out, result, items), result.product)
        if error is not None:
            result.status, result.reason = status_of(error), reason_of(error)
        results.append(result)
        tell(result)
    if items:
        from tasks.export.stac import write_stac

        write_stac(items, out / STAC_FOLDER, "planetpose")
    return results


def _export(folder: Path, settings: ExportSettings, out: Path, result: Exported, items: "list[pystac.Item]") -> None:
    from tasks.export.source import read_source
    from tasks.export.write import mapped, write_one

    source = read_source(folder)
    map_image = mapped(source, settings)
    for kind in settings.formats:
        if kind != "stac":
            result.files[kind] = write_one(kind, source, map_image, settings, out)
    if "stac" in settings.formats:
        from tasks.export.stac import stac_item

        items.append(stac_item(source, result.files, map_image.grid if map_image else None))
        result.files["stac"] = out / STAC_FOLDER / source.product / f"{source.product}.json"
