"""What the demo simulates: images, their true geometry, and the errors to plant (`images.toml`)."""

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from catalog.pose import Pose
from lab.simulate.europa57 import paper_images

DEMO_FILE = Path(__file__).parent / "images.toml"


@dataclass(frozen=True)
class DemoImage:
    """One image of the archive. pose: the truth. offset_px: true minus predicted centre; range_factor: true over
    predicted range; attitude_deg: rotation vector, body-fixed axes, that turns the predicted body into the true one.
    peak_dn: brightness of the lit disk. paper_offset_px: mean and largest of this camera in the paper's table 2."""

    product: str
    camera: str
    pose: Pose
    exposure_s: float
    peak_dn: float
    offset_px: tuple[float, float]
    range_factor: float
    attitude_deg: tuple[float, float, float]
    paper_offset_px: tuple[float, float]


@dataclass(frozen=True)
class Demo:
    """The archive: its target, the seed of its noise, its images, and the paper's residual of a planted offset."""

    target: str
    noise_seed: int
    images: tuple[DemoImage, ...]
    paper_residual_px: float


@cache
def demo() -> Demo:
    """The demo of the catalog."""
    content = tomllib.loads(DEMO_FILE.read_text())
    images = tuple(_image(entry, content) for entry in content["image"])
    return Demo(content["target"], content["noise_seed"], images, content["paper"]["planted_residual_px"])


def _image(entry: dict[str, Any], content: dict[str, Any]) -> DemoImage:
    published = paper_images().get(entry["geometry"])
    pose = published.pose if published else Pose.from_dict(content["pose"][entry["geometry"]])
    fields = {key: value for key, value in entry.items() if key != "geometry"}
    lists = {key: tuple(value) for key, value in fields.items() if isinstance(value, list)}
    exposure_s = published.exposure_s if published else 0.04583
    paper_offset_px = tuple(content["paper"]["offset_px"][entry["camera"]])
    return DemoImage(pose=pose, exposure_s=exposure_s, paper_offset_px=paper_offset_px, **{**fields, **lists})
