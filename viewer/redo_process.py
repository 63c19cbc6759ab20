"""The process in which an image is done again: `-m viewer.redo_process STORE PRODUCT`, messages as lines of JSON."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from catalog.errors import PlanetposeError, RefusedError
from catalog.plain_files import own_json
from catalog.reasons import Reason
from flows.cli.output import clean_stdout, write_json
from flows.guided import guided, remembered
from flows.one_image import one_result
from flows.options import ReprocessOptions
from flows.request import Request
from flows.requests import requests_of_list
from flows.status import BOOKS, latest_runs
from tasks.guidance.prefect_run import note_run
from tasks.publish.index import open_index
from tasks.publish.names import RESULT, SETTINGS


@dataclass
class Messages:
    """A reporter that writes lines of JSON."""

    stream: TextIO

    def message(self, product: str, step: str, iteration: int, text: str) -> None:
        """An iteration inside a step."""
        self.say(kind="step", product=product, step=step, iteration=iteration, text=text)

    def finished(self, product: str, status: str, reason: str | None) -> None:
        """Nothing: the end says it."""

    def say(self, **message: Any) -> None:
        """One line."""
        write_json(self.stream, message)


def request_for(store: Path, product: str) -> Request:
    """The request that the product was made by: as it was noted, or as the list of the store's latest run has it, or by
    what the product says of itself. Raises RefusedError where none of these is known."""
    found = remembered(store, product) or of_latest_run(store, product) or of_product(store, product)
    if found is None:
        fault = f"nothing says by which image and options {product} was made."
        raise RefusedError(Reason.PRODUCT_MISSING, fault, "Run `planetpose correct` or `reprocess` on it once more.")
    if not found.image.is_file():
        fault = f"the image of {product}, {found.image}, is gone."
        raise RefusedError(Reason.IMAGE_MISSING, fault, "Put it back, or correct it anew.")
    return found


def of_latest_run(store: Path, product: str) -> Request | None:
    """From the list of one of the latest runs of `reprocess`."""
    for run in latest_runs(store / BOOKS):
        try:
            options = ReprocessOptions(**{**run.get("parameters", {}), "only": (product,)})
            for request in requests_of_list(options):
                if request.product == product:
                    return request.model_copy(update={"store": store})
        except (PlanetposeError, ValueError):
            continue
    return None


def of_product(store: Path, product: str) -> Request | None:
    """From image and settings that the product states; options that were files are not in there."""
    try:
        result = own_json((store / product / RESULT).read_text(encoding="utf-8"))
        settings = own_json((store / product / SETTINGS).read_text(encoding="utf-8"))
        names = {"camera": result["camera"], "target": result["target"]}
        return Request(image=Path(result["image"]), product=product, store=store, profile=settings, **names)
    except (OSError, ValueError, KeyError, TypeError, PlanetposeError):
        return None


def main() -> None:
    """Do the image again and say how it went; nothing else is written to stdout."""
    store, product = Path(sys.argv[1]), sys.argv[2]
    with clean_stdout() as answer:
        messages = Messages(answer)
        try:
            request = guided(request_for(store, product))
        except PlanetposeError as error:
            messages.say(kind="end", result={"status": error.status, "reason": error.reason})
            return
        result = one_result(request, messages)
        note_run(store, product, None)
        open_index(store)
        messages.say(kind="end", result=result)


if __name__ == "__main__":
    main()
