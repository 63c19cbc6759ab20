"""Which Prefect run did an image last, noted beside the store's products: who looks at the image can open that run."""

import json
from contextlib import suppress
from pathlib import Path
from typing import Any

from catalog.plain_files import own_json
from catalog.regular_file import read_regular_text
from catalog.safe_name import is_safe_product_name
from tasks.atomic import file_put_in_place
from tasks.diagnose.failed_folder import failed_folder

RUNS, RUN = ".requests/.runs", "run.json"
PAGES = ("http://", "https://")


def note_run(store: Path, product: str, run: dict[str, Any] | None) -> None:
    """Note a run, see `flows.flow_run`, beside the requests or, of a failed image, in its folder, where one of them is
    and can be written to. None takes away what was noted: no Prefect run did the image last."""
    path = _place(store, product)
    with suppress(OSError):
        if run is None:
            path.unlink(missing_ok=True)
        elif path.parent.parent.is_dir():
            path.parent.mkdir(exist_ok=True)
            with file_put_in_place(path) as temporary:
                temporary.write_text(json.dumps(run) + "\n", encoding="utf-8")


def noted_run(store: Path, product: str) -> dict[str, Any] | None:
    """The run that was noted; None where there is none, it cannot be read, or its page has no web address: the store
    may be a stranger's."""
    if not is_safe_product_name(product):
        return None
    try:
        content = own_json(read_regular_text(_place(store, product)))
    except (OSError, ValueError):
        return None
    is_one = isinstance(content, dict) and str(content.get("url") or "").startswith(PAGES)
    return content if is_one else None


def _place(store: Path, product: str) -> Path:
    failed = failed_folder(store, product)
    return failed / RUN if failed.is_dir() else Path(store) / RUNS / f"{product}.json"
