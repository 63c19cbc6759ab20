"""Corrections of real images that several parts of the report share; done once, then answered from the cache."""

import json
from pathlib import Path
from typing import Any

from flows.one_image import one_result
from flows.progress import Silent
from flows.request import Request
from lab.paper.real_images import REAL_IMAGES
from lab.paper.section import Context
from tasks.profile import Profile, find_profile
from tasks.step import run

STORE, POSES = "paper", "poses"
Result = dict[str, Any]


def there(context: Context) -> list[str]:
    """Names of the real images whose files are in the data folder."""
    images = (context.data or Path()) / "images"
    return [name for name, image in REAL_IMAGES.items() if context.data and (images / image.file).is_file()]


def method_profile(method: str) -> Profile:
    """The paper's profile with another registration; the second pass is pointing alone, by the same."""
    paper = find_profile("paper")
    point = paper.point.model_copy(update={"registration": method})
    later = paper.later.model_copy(update={"steps": ("point",)})
    return paper.model_copy(update={"name": f"paper-{method}", "passes": 2, "point": point, "later": later})


def corrected(context: Context, product: str, profile: Profile, image: Path | None = None) -> Result:
    """The result of one of the real images under a profile, without Prefect; its product is kept beside the cache.

    image: another file of the same scene. The data folder must be there.
    """
    known = REAL_IMAGES[product]
    data = context.data or Path()
    path = image or data / "images" / known.file
    context.tell(f"{path.name} by profile {profile.name}")
    request = Request(
        image=path,
        store=context.cache / STORE / f"{profile.name}{path.suffix.lower()}",
        target=known.target,
        pose_file=pose_file(context, product),
        kernels=(data / "kernels",) if known.kernels else (),
        profile=profile,
        cache=context.cache,
    )
    return one_result(request, Silent(), run_step=run)


def pose_file(context: Context, product: str) -> Path | None:
    """The pose file that a real image needs, written beside the cache; None when it needs none."""
    parts = REAL_IMAGES[product].pose_parts()
    if parts is None:
        return None
    path = context.cache / STORE / POSES / f"{product}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(parts, indent=1) + "\n")
    return path
