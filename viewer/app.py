"""The server of `planetpose view`: what the page asks for, as JSON and as tiles, and what it writes."""

import base64
import binascii
import io
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import numpy as np
from fastapi import FastAPI, HTTPException, Request, Response
from fastapi.responses import FileResponse, HTMLResponse, JSONResponse
from pydantic import BaseModel, Field

from catalog.errors import PlanetposeError, RefusedError, WrongOptionError
from catalog.plain_files import own_json
from catalog.pose import Pose
from catalog.reasons import Reason
from tasks.guidance.decisions import decide, decisions_of, review_of, undo, user_name
from tasks.guidance.helping import hold_options, mask_option, start_options
from tasks.position.model import position_model
from tasks.position.position import positions_of_pixels
from tasks.position.spelling import read_place
from tasks.profile import find_profile
from tasks.publish.cube_model import model_of
from tasks.publish.names import OVERLAY
from tasks.report.page import FILTER
from viewer.planes import Planes
from viewer.product import product_page
from viewer.redo import Job, Jobs
from viewer.security import Access, Guard
from viewer.table import Table, columns_of

STATIC = Path(__file__).parent / "static"
PAGE = STATIC / "index.html"
TYPES = {".js": "text/javascript; charset=utf-8", ".css": "text/css; charset=utf-8", ".svg": "image/svg+xml"}
THREADS = 4
FAULT = "x-planetpose-fault"
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


class Side:
    """One store with its table and planes."""

    def __init__(self, store: Path) -> None:
        self.store = Path(store)
        self.table, self.planes = Table(self.store), Planes(self.store)

    def known(self, product: str) -> str:
        """The product's name. Raises HTTPException for one that is not in the store's table: nothing else is served."""
        if product not in self.table.places:
            raise HTTPException(404, "The store has no such product.")
        return product


def build_app(store: Path, access: Access, other: Path | None = None) -> FastAPI:
    """The application. other: a second store that the first is compared with. Raises RefusedError when a store is
    missing."""
    sides = [Side(store)] + ([Side(other)] if other else [])
    app = FastAPI(title="planetpose view", docs_url=None, redoc_url=None, openapi_url=None, lifespan=few_threads)
    add_page(app, access, sides)
    add_table(app, sides)
    add_products(app, sides)
    if not access.read_only:
        add_decisions(app, sides[0])
    app.add_middleware(Guard, access=access)
    app.add_exception_handler(PlanetposeError, refused)
    return app


@asynccontextmanager
async def few_threads(_: FastAPI) -> AsyncIterator[None]:
    """Answer few requests at a time: each works for itself alone, and every thread keeps memory of its own."""
    import anyio.to_thread

    anyio.to_thread.current_default_thread_limiter().total_tokens = THREADS
    yield


def refused(_: Request, error: Exception) -> Response:
    """What is wrong, for the page to show. It is an answer: of a failure, browsers would write into their console."""
    return JSONResponse({"fault": str(error)}, headers={FAULT: "1"})


def add_page(app: FastAPI, access: Access, sides: list[Side]) -> None:
    """The page itself and its files."""
    files = {path.name: path for path in page_files()}

    @app.get("/", response_class=HTMLResponse)
    def page() -> HTMLResponse:
        token = "" if access.read_only else access.token
        text = PAGE.read_text(encoding="utf-8").replace("@TOKEN@", token).replace("@DATA@", "")
        return HTMLResponse(text, headers={"cache-control": "no-store"})

    @app.get("/static/{name}")
    def file(name: str) -> Response:
        if name not in files:
            raise HTTPException(404)
        return FileResponse(files[name], media_type=TYPES[files[name].suffix], headers={"cache-control": "no-cache"})

    @app.get("/api/store")
    def about() -> dict[str, Any]:
        return {
            "store": str(sides[0].store.resolve()),
            "other": str(sides[1].store.resolve()) if len(sides) > 1 else None,
            "images": len(sides[0].table.table),
            "columns": list(columns_of(sides[0].table.table)),
            "read_only": access.read_only,
            "who": user_name(),
        }


def page_files() -> list[Path]:
    """What the page loads: its own files, and the filters that it shares with the pages of `planetpose report`."""
    return [*sorted(path for path in STATIC.iterdir() if path.suffix in TYPES), FILTER]


def add_table(app: FastAPI, sides: list[Side]) -> None:
    """Pages of the table, and values for plots."""

    @app.get("/api/table")
    def rows(
        text: str = "", sort: str = "", down: bool = False, first: int = 0, count: int = 100, side: int = 0
    ) -> dict[str, Any]:
        return side_of(sides, side).table.page(text, sort, down, first, count).__dict__

    @app.get("/api/place")
    def place(product: str, text: str = "", sort: str = "", down: bool = False) -> dict[str, Any]:
        return {"place": sides[0].table.place_in(product, text, sort, down)}

    @app.get("/api/points")
    def points(x: str, y: str, text: str = "", side: int = 0) -> dict[str, Any]:
        return side_of(sides, side).table.points(x, y, text)

    @app.post("/api/refresh")
    def refresh() -> dict[str, Any]:
        for each in sides:
            each.table.refresh()
        return {"images": len(sides[0].table.table)}


def side_of(sides: list[Side], number: int) -> Side:
    """The store of that number. Raises RefusedError for another."""
    if not 0 <= number < len(sides):
        raise RefusedError(Reason.STORE_MISSING, "there is no second store.", "Give one with --compare.")
    return sides[number]


def add_products(app: FastAPI, sides: list[Side]) -> None:
    """What the page shows of single products."""

    @app.get("/api/products/{product}")
    def product_(product: str, side: int = 0) -> dict[str, Any]:
        here = side_of(sides, side)
        row = here.table.row(here.known(product)) or {}
        if row.get("status") in ("refused", "failed", "unreadable"):
            return {
                "product": product,
                "row": row,
                "decisions": [each.__dict__ for each in decisions_of(here.store, product)],
            }
        return {**product_page(here.planes, product), "row": row}

    @app.get("/api/products/{product}/tiles/{plane}/{level}/{column}/{row}")
    def tile(product: str, plane: str, level: int, column: int, row: int, side: int = 0) -> Response:
        here = side_of(sides, side)
        if not 0 <= level <= 16:
            raise HTTPException(404)
        content = here.planes.tile(here.known(product), plane, level, column, row)
        return Response(content, media_type="application/octet-stream", headers={"cache-control": "no-store"})

    @app.get("/api/products/{product}/at")
    def at(product: str, x: float, y: float, side: int = 0) -> dict[str, object]:
        here = side_of(sides, side)
        model = position_model(here.planes.cube(here.known(product)))
        return positions_of_pixels(model, [[x, y]])[0].to_dict()

    @app.get("/api/products/{product}/find")
    def find(product: str, place: str) -> dict[str, object]:
        from tasks.position.position import positions_of_places

        model = position_model(sides[0].planes.cube(sides[0].known(product)))
        latitude, longitude = read_place(place)
        return positions_of_places(model, [latitude], [longitude])[0].to_dict()

    @app.get("/api/products/{product}/overlay.png")
    def overlay(product: str, side: int = 0) -> Response:
        here = side_of(sides, side)
        path = here.store / here.known(product) / OVERLAY
        if not path.is_file() or here.store.resolve() not in path.resolve().parents:
            raise HTTPException(404)
        return FileResponse(path, media_type="image/png")

    @app.get("/api/products/{product}/small.png")
    def small(product: str, side: int = 0) -> Response:
        here = side_of(sides, side)
        return Response(thumbnail(here.planes, here.known(product)), media_type="image/png")


def thumbnail(planes: Planes, product: str) -> bytes:
    """A small picture as PNG. Raises RefusedError without a cube."""
    import tempfile

    from tasks.pictures.thumbnail import write_thumbnail

    with tempfile.TemporaryDirectory() as folder:
        return write_thumbnail(planes.store / product, Path(folder) / "small.png").read_bytes()


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
