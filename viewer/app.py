"""The server of `planetpose view`: what the page asks for, as JSON and as tiles, and what it writes."""

import html
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

from fastapi import FastAPI, HTTPException, Request, Response
from fastapi.responses import FileResponse, HTMLResponse, JSONResponse

from catalog.errors import PlanetposeError
from tasks.guidance.decisions import user_name
from tasks.position.model import position_model
from tasks.position.position import positions_of_pixels
from tasks.position.spelling import read_place
from tasks.publish.names import OVERLAY
from tasks.report.page import FILTER
from viewer.deciding import add_decisions
from viewer.layers import flow_of
from viewer.opening import opening_of, page_of
from viewer.security import Access, Guard
from viewer.side import Side, side_of
from viewer.table import columns_of

STATIC = Path(__file__).parent / "static"
PAGE = STATIC / "index.html"
TYPES = {".js": "text/javascript; charset=utf-8", ".css": "text/css; charset=utf-8", ".svg": "image/svg+xml"}
THREADS = 4
MOST_PLANES = 32  # in one answer
FAULT = "x-planetpose-fault"


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
        first = html.escape(sides[0].table.first(), quote=True)
        text = (
            PAGE.read_text(encoding="utf-8").replace("@TOKEN@", token).replace("@DATA@", "").replace("@FIRST@", first)
        )
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
    own = (path for path in STATIC.iterdir() if path.suffix in TYPES and path.stem != "widget")  # that is a notebook's
    return [*sorted(own), FILTER]


def add_table(app: FastAPI, sides: list[Side]) -> None:
    """Pages of the table, and values for plots."""

    @app.get("/api/table")
    def rows(
        text: str = "", sort: str = "", down: bool = False, first: int = 0, count: int = 100, side: int = 0
    ) -> Response:
        return JSONResponse(side_of(sides, side).table.page(text, sort, down, first, count).__dict__)

    @app.get("/api/place")
    def place(product: str, text: str = "", sort: str = "", down: bool = False) -> dict[str, Any]:
        return {"place": sides[0].table.place_in(product, text, sort, down)}

    @app.get("/api/points")
    def points(x: str, y: str, text: str = "", side: int = 0) -> Response:
        return JSONResponse(side_of(sides, side).table.points(x, y, text))

    @app.post("/api/refresh")
    def refresh() -> dict[str, Any]:
        for each in sides:
            each.table.refresh()
        return {"images": len(sides[0].table.table)}


def add_products(app: FastAPI, sides: list[Side]) -> None:
    """What the page shows of single products."""

    @app.get("/api/products/{product}")
    def product_(product: str, side: int = 0) -> Response:
        return JSONResponse(page_of(side_of(sides, side), product))

    @app.get("/api/products/{product}/opening")
    def opening(product: str, plane: str = "image", side: int = 0) -> Response:
        content = opening_of(side_of(sides, side), product, plane)
        return Response(content, media_type="application/octet-stream", headers={"cache-control": "no-store"})

    @app.get("/api/products/{product}/tiles/{planes}/{level}/{column}/{row}")
    def tile(product: str, planes: str, level: int, column: int, row: int, side: int = 0) -> Response:
        here = side_of(sides, side)
        if not 0 <= level <= 16:
            raise HTTPException(404)
        names = planes.split(",")[:MOST_PLANES]
        content = b"".join(here.planes.tile(here.known(product), name, level, column, row) for name in names)
        return Response(content, media_type="application/octet-stream", headers={"cache-control": "no-store"})

    @app.get("/api/products/{product}/at")
    def at(product: str, x: float, y: float, side: int = 0) -> dict[str, object]:
        here = side_of(sides, side)
        model = position_model(here.confirmed(product))
        return positions_of_pixels(model, [[x, y]])[0].to_dict()

    @app.get("/api/products/{product}/flow")
    def flow(product: str, side: int = 0) -> dict[str, Any]:
        here = side_of(sides, side)
        return flow_of(here.planes, here.known(product))

    @app.get("/api/products/{product}/find")
    def find(product: str, place: str) -> dict[str, object]:
        from tasks.position.position import positions_of_places

        model = position_model(sides[0].confirmed(product))
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
    def small(product: str, request: Request, side: int = 0) -> Response:
        from tasks.pictures.thumbnail import thumbnail_of

        here = side_of(sides, side)
        version = here.planes.version(here.known(product))
        headers = {"cache-control": "private, no-cache", "etag": f'"{version}"'}
        if request.headers.get("if-none-match") == headers["etag"]:
            return Response(status_code=304, headers=headers)
        return Response(thumbnail_of(here.planes.cube(product)), media_type="image/png", headers=headers)
