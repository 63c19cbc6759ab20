"""What the page writes: decisions, and images done again."""

import base64
import binascii
import io
from typing import Any

import numpy as np
from fastapi import FastAPI, HTTPException
from pydantic import BaseModel, Field

from catalog.errors import WrongOptionError
from catalog.plain_files import own_json
from catalog.pose import Pose
from tasks.guidance.decisions import decide, decisions_of, review_of, undo
from tasks.guidance.helping import hold_options, mask_option, start_options
from tasks.profile import find_profile
from tasks.publish.cube_model import model_of
from viewer.redo import Job, Jobs
from viewer.side import Side

MOST_MASK_PIXELS = 100_000_000


class Help(BaseModel):
    """How a correction is to be helped. centre_px: of the target, in pixels of the image. mask: PNG, base64."""

    centre_px: tuple[float, float] | None = None
    range_factor: float = 1.0
    roll_deg: float = 0.0
    hold: list[str] = Field(default_factory=list)
    profile: str | None = None
    mask: str | None = None


class Made(BaseModel):
    """A decision that is made on the page."""

    action: str
    why: str = ""
    help: Help | None = None


def add_decisions(app: FastAPI, side: Side) -> None:
    """What the page writes: decisions, and images done again."""

    def ended(job: Job) -> None:
        side.planes.forget(job.product)
        side.table.refresh()

    jobs = Jobs(side.store, ended)

    def now_known(product: str) -> dict[str, Any]:
        found = decisions_of(side.store, product)
        side.table.note_review(product, *review_of(found))
        return {"decisions": [each.__dict__ for each in found], "row": side.table.row(product)}

    @app.post("/api/products/{product}/decisions")
    def add(product: str, made: Made) -> dict[str, Any]:
        options = options_of(side, side.known(product), made.help) if made.action == "help" and made.help else {}
        try:
            decide(side.store, product, made.action, made.why, options)
        except (ValueError, OSError) as error:
            raise WrongOptionError("decision", f"it was not written: {error}.", "") from error
        return now_known(product)

    @app.post("/api/products/{product}/undo")
    def take_back(product: str) -> dict[str, Any]:
        undo(side.store, side.known(product))
        return now_known(product)

    @app.post("/api/products/{product}/redo")
    def redo(product: str) -> dict[str, Any]:
        return jobs.start(side.known(product)).__dict__

    @app.get("/api/jobs/{number}")
    def job(number: int) -> dict[str, Any]:
        found = jobs.of(number)
        if found is None:
            raise HTTPException(404)
        return found.__dict__


def options_of(side: Side, product: str, given: Help) -> dict[str, Any]:
    """The options of a `help`. Raises WrongOptionError for what makes none."""
    cube = side.planes.cube(product)
    model, predicted = model_of(cube), Pose.from_dict(own_json(cube.attrs["pose_before"]))
    options = start_options(side.store, product, model, predicted, given.centre_px, given.range_factor, given.roll_deg)
    options |= hold_options(given.hold)
    if given.profile:
        options["profile"] = find_profile(given.profile).name
    if given.mask:
        options |= mask_option(side.store, product, model, painted_mask(given.mask, cube["image"].shape))
    return options


def painted_mask(text: str, shape: tuple[int, ...]) -> Any:
    """Mask (ny, nx) of a PNG in base64. Raises WrongOptionError for anything else."""
    from PIL import Image

    try:
        with Image.open(io.BytesIO(base64.b64decode(text, validate=True)), formats=["PNG"]) as picture:
            if picture.size != (shape[1], shape[0]) or picture.width * picture.height > MOST_MASK_PIXELS:
                raise ValueError(f"it has {picture.size} pixels")
            return np.asarray(picture.convert("RGBA"))[..., 3] > 0
    except (OSError, ValueError, SyntaxError, binascii.Error) as error:
        raise WrongOptionError("mask", f"the mask cannot be read ({error}).", "Paint it again.") from error
