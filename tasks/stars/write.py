"""Stars of several image files: one row each, whatever goes wrong with one; and their files NAME.json and NAME.png."""

import json
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from catalog.plain_text import printable
from catalog.safe_name import safe_product_name
from tasks.atomic import file_put_in_place
from tasks.boundary import reason_of, trouble_of
from tasks.stars.image import StarImage, StarRequest, stars_of_image
from tasks.stars.overlay import draw_stars
from tasks.stars.report import Json, in_json, nothing_known
from tasks.stars.settings import IdentificationSettings
from tasks.stars.together import Together


def stars_of_images(
    requests: Iterable[StarRequest], out: Path | None, solve: Sequence[str] = ()
) -> Iterator[tuple[Json, bool]]:
    """The result of each image as plain JSON, and whether it could be looked at: an image that is refused has its
    reason in the result, and the others go on; then what all images say of each camera (`solve`, see `fit_camera`).
    out: folder for files, None for none."""
    together = Together(tuple(solve), IdentificationSettings())
    for request in requests:
        results: list[Json] = []

        def look(request: StarRequest = request, results: list[Json] = results) -> None:
            found = stars_of_image(request)
            together.add(found)
            results.append(written(found, out))

        error = trouble_of(look, request.image.name)
        if error is None:
            yield results[0], True
        else:
            reason = reason_of(error)
            yield nothing_known(printable(request.image.name), reason), False
    for content in together.in_json():
        yield content, True


def result_of_image(request: StarRequest, out: Path | None) -> Json:
    """The result of one image, and its files. Raises RefusedError where it cannot be looked at."""
    return written(stars_of_image(request), out)


def written(found: StarImage, out: Path | None) -> Json:
    """The result as plain JSON, and its files."""
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
