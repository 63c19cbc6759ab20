"""Answer what can be answered without work: the results of images whose every step is cached and published."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from catalog.errors import PlanetposeError, RefusedError
from flows.boundary import trouble_of
from flows.chain import Chain, only_cached
from flows.image import correct_image
from flows.request import Request
from flows.result import result_of


def answer_from_cache(request: Request) -> dict[str, Any] | None:
    """The result of `request` if no step has to be done for it, else None.

    An image that is refused before its first missing step (no such file, unknown camera) is answered too: the steps
    would not change that. Trouble of another kind is left to the flow, which tells it.
    """
    chain = Chain(request, only_cached)
    error = trouble_of(lambda: correct_image(chain), request.product, log=False)
    if error is None or isinstance(error, PlanetposeError):
        return result_of(chain, error)
    return None


def product_twice(fault: str) -> RefusedError:
    """The refusal of an image that would overwrite another one of the same command."""
    return RefusedError("product-twice", f"{fault}.", "Give each a name by --product, or another --store.")


def twins(requests: Sequence[Request]) -> dict[int, str]:
    """Positions of requests whose product folder an earlier request for another image already claims, and the fault."""
    first: dict[Path, Request] = {}
    faults: dict[int, str] = {}
    for position, request in enumerate(requests):
        claimed_by = first.setdefault(request.product_folder.absolute(), request)
        if claimed_by is not request:
            faults[position] = f"{claimed_by.image} and {request.image} would both become {request.product_folder}"
    return faults
