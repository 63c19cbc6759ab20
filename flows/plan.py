"""Answer what can be answered without work: the results of images whose every step is cached and published."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from catalog.errors import PlanetposeError
from flows.chain import Chain, NotCachedError, only_cached
from flows.image import correct_image
from flows.request import Request
from flows.result import result_of


def answer_from_cache(request: Request) -> dict[str, Any] | None:
    """The result of `request` if no step has to be done for it, else None.

    An image that is refused before its first missing step (no such file, unknown camera) is answered too: the steps
    would not change that.
    """
    chain = Chain(request, only_cached)
    try:
        correct_image(chain)
    except NotCachedError:
        return None
    except PlanetposeError as error:
        return result_of(chain, error)
    return result_of(chain)


def twins(requests: Sequence[Request]) -> dict[int, str]:
    """Positions of requests whose product folder an earlier request for another image already claims, and the fault."""
    first: dict[Path, Request] = {}
    faults: dict[int, str] = {}
    for position, request in enumerate(requests):
        claimed_by = first.setdefault(request.product_folder.absolute(), request)
        if claimed_by is not request:
            faults[position] = f"{claimed_by.image} and {request.image} would both become {request.product_folder}"
    return faults
