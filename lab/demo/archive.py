"""The demo's archive: a few simulated images with the errors that `images.toml` plants."""

from dataclasses import dataclass, replace
from pathlib import Path

from catalog.basemap import BaseMap, map_of_target
from catalog.camera import find_camera
from catalog.target import Target, find_target
from lab.demo.images import DemoImage, demo
from lab.simulate.archive import write_archive
from lab.simulate.cameras import simulated_camera
from lab.simulate.detector import clean_exposure
from lab.simulate.errors import PlantedErrors
from lab.simulate.surface import TrueSurface
from lab.simulate.synthesis import TrueImage


@dataclass(frozen=True)
class SimulatedImage:
    """Where an image of the demo's archive is: raw file, pose file with planted errors, pose file with the truth."""

    entry: DemoImage
    image: Path
    predicted: Path
    truth: Path


def simulate_archive(folder: Path, products: tuple[str, ...] | None = None) -> list[SimulatedImage]:
    """Write the demo's images (all, or some `products`) to `folder`: raw files in their cameras' formats, with noise,
    PSF and reseau marks; PRODUCT.predicted.json, wrong by the planted errors; PRODUCT.truth.json.

    Optics, PSF and map are those that the corrections assume; the surface is lunar-Lambert.
    """
    target = find_target(demo().target)
    basemap = map_of_target(target)
    chosen = [entry for entry in demo().images if products is None or entry.product in products]
    entries = [_demo_image(entry, target, basemap) for entry in chosen]
    written = write_archive(folder, entries, demo().noise_seed, basemap, matched=True)
    return [
        SimulatedImage(entry, files.image, files.predicted, files.truth)
        for entry, files in zip(chosen, written, strict=True)
    ]


def _demo_image(entry: DemoImage, target: Target, basemap: BaseMap) -> TrueImage:
    camera = find_camera(entry.camera)
    exposure = replace(clean_exposure(camera, simulated_camera(camera.name).detector), peak_dn=entry.peak_dn)
    return TrueImage(
        entry.product,
        camera,
        target,
        entry.pose,
        entry.exposure_s,
        PlantedErrors(entry.offset_px, entry.range_factor, entry.attitude_deg),
        TrueSurface("lunar-lambert", {}, basemap),
        exposure,
    )
