"""A store whose images show a planted albedo: the paper's 57 views of Europa, or others, rendered with a law that
shares nothing with the mosaics made from them (`lab.honesty.laws`)."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from catalog.basemap import BaseMap
from catalog.camera import Camera, find_camera
from catalog.observation import Observation
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from catalog.target import Target, find_target
from lab.honesty.laws import radiance
from lab.simulate.europa57 import paper_images
from lab.simulate.randomness import generator
from tasks.geometry.bilinear import map_values
from tasks.project.rays import intersect, rays_of
from tasks.project.uncertainty import PoseUncertainty
from tasks.publish import Publication, publish
from tasks.simulate.scene import detect
from tasks.simulate.window import disk_radius_px, target_window

Array = NDArray[np.float64]
EUROPA = {"w": 0.93, "b": -0.3, "b0": 0.4, "h": 0.02, "roughness_deg": 16.0}
SIGMAS = {"offset_px": [0.05, 0.05], "range_factor": 1e-4, "roll_deg": 0.01, "attitude_deg": [0.05, 0.05, 0.05]}
SUBPIXELS_ACROSS = 900
SKY_DN = 12.0


@dataclass(frozen=True)
class ViewToMake:
    """One image: its camera (undistorted frame), its pose, its exposure."""

    product: str
    camera: Camera
    pose: Pose
    filter: str = "clear"


@dataclass(frozen=True)
class PlantedAlbedo:
    """What was planted: units_per_if times an image's factor is its scale; errors: rotation vectors in degrees by which
    the published attitudes differ from the true ones."""

    law: str
    parameters: dict[str, float]
    units_per_if: float
    factors: dict[str, float]
    errors: dict[str, Array] = field(default_factory=dict)

    def standard_reflectance(self, geometry_deg: tuple[float, float, float] = (30.0, 0.0, 30.0)) -> float:
        """I/F of ground of albedo 1 at incidence, emission, phase."""
        i, e, g = (np.array([np.radians(angle)]) for angle in geometry_deg)
        return float(radiance(self.law, self.parameters, np.cos(i), np.cos(e), g)[0])


def paper_views(products: Iterable[str] = ()) -> list[ViewToMake]:
    """The paper's 57 views, or some, each in a frame that is cut to its disk."""
    chosen = set(products)
    return [
        ViewToMake(each.image, cut_to_disk(find_camera(each.camera), each.pose, find_target("europa")), each.pose)
        for each in paper_images().values()
        if not chosen or each.image in chosen
    ]


def cut_to_disk(camera: Camera, pose: Pose, target: Target) -> Camera:
    """The pinhole of a window around the disk, without distortion."""
    window = target_window(pose, camera, target)
    x, y = camera.centre_px
    return Camera(
        name=camera.name,
        size_px=(window.x1 - window.x0, window.y1 - window.y0),
        centre_px=(x - window.x0, y - window.y0),
        focal_length_px=camera.focal_length_px,
        psf_sigma_px=camera.psf_sigma_px,
    )


def write_albedo_store(
    store: Path,
    views: Iterable[ViewToMake],
    albedo: BaseMap,
    law: str = "hapke",
    parameters: Mapping[str, float] | None = None,
    units_per_if: float = 3000.0,
    level_sigma: float = 0.03,
    noise: float = 0.005,
    attitude_error_deg: float = 0.0,
    place_error_px: float = 0.0,
    stated: Mapping[str, object] | None = None,
    subpixels_across: int = SUBPIXELS_ACROSS,
    seed: int = 1,
    focal_length_factor: float = 1.0,
) -> PlantedAlbedo:
    """Publish the views. noise: of a pixel, relative to the brightest; level_sigma: relative 1-sigma of the images'
    calibration; attitude_error_deg, place_error_px: 1-sigma, about each axis and along x and y, by which the published
    poses are wrong; stated: the 1-sigma that products state; subpixels_across: a disk; focal_length_factor: true focal
    length over the published one. Returns what was planted."""
    target = find_target("europa")
    chosen = dict(parameters or EUROPA)
    factors, errors = {}, {}
    for view in views:
        rng = generator(seed, view.product, "albedo store")
        factor = float(np.exp(rng.normal(0, level_sigma)))
        camera = view.camera.model_copy(update={"focal_length_px": focal_length_factor * view.camera.focal_length_px})
        clean = factor * units_per_if * picture(view.pose, camera, target, albedo, law, chosen, subpixels_across)
        sigma = noise * float(clean.max())
        image = (SKY_DN + clean + rng.normal(0, sigma, clean.shape)).astype(np.float32)
        turn = rng.normal(0, 1, 3) * attitude_error_deg
        shift = rng.normal(0, 1, 2) * place_error_px / view.camera.focal_length_px
        camera_turn = rotation_from_vector_deg(np.degrees([-shift[1], shift[0], 0.0]))
        pose = view.pose.replaced(
            body_from_j2000=rotation_from_vector_deg(turn) @ view.pose.body_from_j2000,
            camera_from_j2000=camera_turn @ view.pose.camera_from_j2000,
        )
        _publish(store, view, image, sigma, pose, target, stated or SIGMAS)
        factors[view.product], errors[view.product] = factor, turn
    return PlantedAlbedo(law, chosen, units_per_if, factors, errors)


def picture(
    pose: Pose,
    camera: Camera,
    target: Target,
    albedo: BaseMap,
    law: str,
    parameters: Mapping[str, float],
    subpixels_across: int = SUBPIXELS_ACROSS,
) -> NDArray[np.float32]:
    """I/F (ny, nx) as the camera sees it: sub-pixels, blurred, summed."""
    nx, ny = camera.size_px
    part = int(np.clip(np.ceil(subpixels_across / (2 * disk_radius_px(pose, camera, target))), 2, 9))
    fine = np.zeros((ny * part, nx * part), np.float32)
    x, y = ((np.arange(n * part) + 0.5) / part - 0.5 for n in (nx, ny))
    rays = rays_of(pose, camera, target)
    for rows in np.array_split(np.arange(len(y)), max(1, fine.size // 500_000)):
        scaled = intersect(rays, np.stack(np.meshgrid(x, y[rows]), axis=-1))
        hit = np.isfinite(scaled[..., 0])
        strip = np.zeros(hit.shape, np.float32)
        strip[hit] = _radiance(scaled[hit], pose, target, albedo, law, parameters)
        fine[rows] = strip
    return detect(fine, part, camera.psf_sigma_px)


def _radiance(
    scaled: Array, pose: Pose, target: Target, albedo: BaseMap, law: str, parameters: Mapping[str, float]
) -> Array:
    radii = np.asarray(target.radii_km)
    place, normal = scaled * radii, scaled / radii
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    to_camera = pose.spacecraft_in_body_km - place
    to_camera /= np.linalg.norm(to_camera, axis=-1, keepdims=True)
    sun = pose.sun_direction_in_body
    phase = np.arccos(np.clip(to_camera @ sun, -1, 1))
    unit = place / np.linalg.norm(place, axis=-1, keepdims=True)
    latitude, longitude = np.degrees(np.arcsin(unit[:, 2])), np.degrees(np.arctan2(unit[:, 1], unit[:, 0]))
    ground = map_values(albedo.albedo, albedo.left_edge_deg, latitude, longitude)
    mu = np.maximum((normal * to_camera).sum(axis=-1), 0)
    return np.asarray(ground * radiance(law, parameters, normal @ sun, mu, phase))


def _publish(
    store: Path,
    view: ViewToMake,
    image: NDArray[np.float32],
    sigma: float,
    pose: Pose,
    target: Target,
    stated: Mapping[str, object],
) -> None:
    observation = Observation(image, np.full_like(image, sigma), np.zeros(image.shape, np.uint16))
    result = {
        "product": view.product, "status": "ok", "reason": None, "camera": view.camera.name, "target": target.name,
        "offset_px": [0.0, 0.0], "range_factor": 1.0, "attitude_deg": [0.0, 0.0, 0.0],
    }  # fmt: skip
    papers = {
        "image": {"sha256": "simulated", "filter": view.filter}, "kernels": [],
        "basemap": {"name": "uniform", "sha256": "uniform"},
    }  # fmt: skip
    publish(
        Publication(
            product=view.product, observation=observation, camera=view.camera, target=target, pose_before=pose,
            pose_after=pose, uncertainty=PoseUncertainty.from_sigmas(stated), result=result,
            settings={"profile": "planted"}, provenance=papers,
        ),
        store,
    )  # fmt: skip
