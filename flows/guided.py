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
    helped is not noted: it would stay when the help is taken back."""
    with suppress(PlanetposeError):
        if help_in(request.store, request.product):
            return
    names = ("image", "store", "cache", "pose_file", "basemap", "shape", "mask", "resume")
    places = {name: Path(path).absolute() for name in names if (path := getattr(request, name)) and Path(path).exists()}
    kernels = {"kernels": tuple(path.absolute() for path in request.kernel_paths)}
    content = request.model_copy(update=places | kernels).model_dump(mode="json", by_alias=True)
    path = request.store / REQUESTS / f"{request.product}.json"
    text = json.dumps(content) + "\n"
    with suppress(OSError):
        if path.is_file() and path.read_text(encoding="utf-8") == text:
            return
        path.parent.mkdir(exist_ok=True)
        with file_put_in_place(path) as temporary:
            temporary.write_text(text, encoding="utf-8")


def remembered(store: Path, product: str) -> Request | None:
    """The request that a product was made by, for the store as it lies now; None where none was noted or it cannot be
    read any more."""
    if not is_safe_product_name(product):
        return None
    try:
        content = own_json(read_regular_text(store / REQUESTS / f"{product}.json"))
        return Request.model_validate(content).model_copy(update={"store": store, "product": product})
    except (OSError, ValueError, TypeError):
        return None
