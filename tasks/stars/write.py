"""Stars of several image files: one row each, whatever goes wrong with one; and their files NAME.json and NAME.png."""

import json
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path

from catalog.plain_text import printable
from catalog.safe_name import safe_product_name
from tasks.atomic import file_put_in_place
from tasks.boundary import reason_of, trouble_of
from tasks.stars.image import StarImage, StarRequest, stars_of_image
from tasks.stars.overlay import draw_stars
from tasks.stars.report import Json, in_json, nothing_known


def stars_of_images(requests: Iterable[StarRequest], out: Path | None) -> Iterator[tuple[Json, bool]]:
    """The result of each image as plain JSON, and whether it could be looked at: an image that is refused has its
    reason in the result, and the others go on. out: folder for files, None for none."""
    for request in requests:
        results: list[Json] = []
        error = trouble_of(partial(_append, results, request, out), request.image.name)
        if error is None:
            yield results[0], True
        else:
            reason = reason_of(error)
            yield nothing_known(printable(request.image.name), reason), False


def _append(results: list[Json], request: StarRequest, out: Path | None) -> None:
    results.append(result_of_image(request, out))


def result_of_image(request: StarRequest, out: Path | None) -> Json:
    """The result of one image, and its files. Raises RefusedError where it cannot be looked at."""
    found = stars_of_image(request)
    content = in_json(found)
    if out is not None:
        content |= {"files": [str(path) for path in write_files(found, content, out)]}
    return content


def write_files(found: StarImage, content: Json, out: Path) -> list[Path]:
    """NAME.json and NAME.png in the folder, each put there whole."""
    out.mkdir(parents=True, exist_ok=True)
    name = safe_product_name(found.path.stem)
    table, picture = out / f"{name}.json", out / f"{name}.png"
    with file_put_in_place(table) as temporary:
        temporary.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    title = f"{printable(found.path.name)}: {content['stars']} stars"
    if content["stars"]:
        title += f", rms {content['rms_px']:.2f} px; residuals enlarged"
    with file_put_in_place(picture) as temporary:
        draw_stars(found, temporary, title)
    return [table, picture]
