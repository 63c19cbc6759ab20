"""How the user helped or overruled the corrections of one image: where they start, what they hold, what they mask."""

from typing import Any

from catalog.plain_text import shown_path
from flows.request import Request


def guidance_of(request: Request) -> dict[str, Any]:
    """What the result says of the request's: plain JSON, None or empty for what was not used."""
    return {
        "start_offset_px": list(request.start_offset_px) if request.start_offset_px else None,
        "held": list(request.profile.hold),
        "mask": shown_path(request.mask) if request.mask else None,
        "flip": request.flip,
        "plane": request.plane,
        "summing": request.summing,
        "window": list(request.window) if request.window else None,
        "resumed_from": shown_path(request.resume) if request.resume else None,
    }


def is_started_elsewhere(request: Request) -> bool:
    """Whether the corrections start from another pose than the predicted one."""
    return request.start_offset_px is not None or request.resume is not None
