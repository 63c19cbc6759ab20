"""What people decided about single images, put into their requests; and the requests themselves, remembered beside the
products so that an image can be done again as it was."""

import json
from contextlib import suppress
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from catalog.errors import PlanetposeError, WrongOptionError
from catalog.plain_files import own_json
from catalog.regular_file import read_regular_text
from catalog.safe_name import is_safe_product_name
from flows.request import Request
from tasks.atomic import file_put_in_place
from tasks.diagnose.failed_folder import REQUEST, failed_folder
from tasks.guidance.decisions import help_in
from tasks.profile import find_profile

REQUESTS = ".requests"


def guided(request: Request) -> Request:
    """The request with the help that people gave for its product in its store (see `tasks.guidance`). Raises
    RefusedError where the help is damaged or does not fit."""
    options = help_in(request.store, request.product)
    if not options:
        return request
    profile = find_profile(options["profile"]) if options.get("profile") else request.profile
    try:
        held = options.get("hold") or []
        changes: dict[str, Any] = {"profile": profile.holding(held) if held else profile}
    except ValidationError as error:
        faults = "; ".join(fault["msg"] for fault in error.errors())
        raise WrongOptionError("hold", f"guidance of {request.product}: {faults}.", "Take it back.") from error
    changes |= {name: Path(options[name]) for name in ("mask", "resume") if options.get(name)}
    if options.get("start_offset_px"):
        x, y = options["start_offset_px"]
        changes["start_offset_px"] = (float(x), float(y))
    return request.model_copy(update=changes)


def remember(request: Request) -> None:
    """Note the request beside the store's products, where that can be written; with absolute paths. One that people
    helped is not noted, for its help would stay when it is taken back; where the image failed before, the request of
    that time is."""
    text = unhelped(request)
    path = request.store / REQUESTS / f"{request.product}.json"
    with suppress(OSError):
        if text is None or (path.is_file() and path.read_text(encoding="utf-8") == text):
            return
        path.parent.mkdir(exist_ok=True)
        with file_put_in_place(path) as temporary:
            temporary.write_text(text, encoding="utf-8")


def unhelped(request: Request) -> str | None:
    """The request as a failed image's folder keeps it: this one, or, where people helped it, the one that was kept
    before; None where none was."""
    if not is_helped(request):
        return text_of(request)
    with suppress(OSError, ValueError):
        return read_regular_text(failed_folder(request.store, request.product) / REQUEST)
    return None


def is_helped(request: Request) -> bool:
    """Whether the store has help for the request's product."""
    with suppress(PlanetposeError):
        return bool(help_in(request.store, request.product))
    return False


def text_of(request: Request) -> str:
    """A request as JSON, with absolute paths."""
    names = ("image", "store", "cache", "pose_file", "basemap", "shape", "mask", "resume")
    places = {name: Path(path).absolute() for name in names if (path := getattr(request, name)) and Path(path).exists()}
    kernels = {"kernels": tuple(path.absolute() for path in request.kernel_paths)}
    content = request.model_copy(update=places | kernels).model_dump(mode="json", by_alias=True)
    return json.dumps(content) + "\n"


def remembered(store: Path, product: str) -> Request | None:
    """The request that a product was made by, or that failed to make it, for the store as it lies now; None where none
    was noted or it cannot be read any more."""
    if not is_safe_product_name(product):
        return None
    for path in (store / REQUESTS / f"{product}.json", failed_folder(store, product) / REQUEST):
        with suppress(OSError, ValueError, TypeError):
            content = own_json(read_regular_text(path))
            return Request.model_validate(content).model_copy(update={"store": store, "product": product})
    return None
