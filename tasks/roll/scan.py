"""Roll from far away: disk and simulation in polar coordinates, shifted against each other."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from catalog.pose import Pose
from tasks.compare.brightness import correlation
from tasks.compare.match import Match
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px

Array = NDArray[np.float32]
RINGS, ANGLES = 24, 360
# From near the centre, where turns move nothing, to just outside the limb.
INNER_RADII, OUTER_RADII = 0.15, 1.04
MIN_SHADING = 0.02


@dataclass(frozen=True)
class PolarScan:
    """angles_deg: (n,) tried. camera, target: (n,) correlation of the image with the simulation when the camera, or the
    target alone, is turned by them."""

    angles_deg: NDArray[np.float64]
    camera: NDArray[np.float64]
    target: NDArray[np.float64]

    @property
    def unturned(self) -> float:
        """Correlation without a turn: in the middle of the angles."""
        return float(self.camera[len(self.camera) // 2])

    def contrast(self, kind: str) -> float:
        """How much less of the image the best turn leaves unexplained than a middling one: 0 (a disk that looks the
        same from every side) to 1."""
        scores = np.maximum(self.camera if kind == "camera" else self.target, 0)
        unexplained = 1 - scores**2
        return float(1 - unexplained.min() / max(np.median(unexplained), 1e-12))

    def best(self, kind: str) -> tuple[float, float]:
        """Angle, degrees, and correlation of the best turn of `kind` (camera or target)."""
        scores = self.camera if kind == "camera" else self.target
        top = int(np.argmax(scores))
        return float(self.angles_deg[top]), float(scores[top])


def polar_scan(match: Match, reach_deg: float) -> PolarScan:
    """Correlation of the image with the simulation turned by up to `reach_deg` either way, in steps of a degree.

    A camera's roll turns markings and shading together; a turn of the target turns the markings under a shading that
    stays, for a sphere. At every angle the brightness of each basis image is fitted again.
    """
    radius = disk_radius_px(match.pose, match.scene.camera, match.scene.target)
    image, *bases = polar((match.image, *match.simulation.bases), match.centre_px, radius)
    usable = polar((match.usable.astype(np.float32),), match.centre_px, radius)[0] > 0.999
    shading = polar(tuple(match.simulation.shading), match.centre_px, radius)
    albedo = polar((full_albedo(match.scene, match),), match.centre_px, radius)[0]
    step_deg = 360.0 / ANGLES
    shifts = np.arange(-int(reach_deg / step_deg), int(reach_deg / step_deg) + 1)
    camera, target = [], []
    for shift in shifts:
        camera.append(fitted_correlation(image, [np.roll(basis, shift, axis=1) for basis in bases], usable))
        turned = np.roll(albedo, shift, axis=1)
        hidden = bases[len(shading) :]
        target.append(fitted_correlation(image, [*(turned * shade for shade in shading), *hidden], usable))
    return PolarScan(np.asarray(shifts * step_deg, np.float64), np.array(camera), np.array(target))


def polar(pictures: tuple[Array, ...], centre_px: NDArray, radius_px: float) -> list[Array]:
    """Pictures (ny, nx) resampled to (RINGS, ANGLES), angles from +x towards +y."""
    import cv2

    ring = np.linspace(INNER_RADII, OUTER_RADII, RINGS)[:, None] * radius_px
    angle = np.arange(ANGLES)[None, :] * (2 * np.pi / ANGLES)
    x, y = (
        (centre + ring * part).astype(np.float32)
        for centre, part in zip(centre_px, (np.cos(angle), np.sin(angle)), strict=True)
    )
    return [cv2.remap(p.astype(np.float32), x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT) for p in pictures]


def full_albedo(scene: Scene, match: Match) -> Array:
    """The map (ny, nx) as the camera would see it with the Sun behind it, also where the simulation has night."""
    lit = lit_from_camera(match.pose)
    simulation = scene.render(lit, match.simulation.window)
    bright = simulation.shading[0] > MIN_SHADING * simulation.shading[0].max()
    return np.divide(simulation.bases[0], simulation.shading[0], out=np.zeros_like(match.image), where=bright)


def lit_from_camera(pose: Pose) -> Pose:
    """The pose with the Sun in the spacecraft's direction."""
    distance_km = float(np.linalg.norm(pose.sun_from_target_km))
    return pose.replaced(sun_from_target_km=-pose.target_from_spacecraft_km * (distance_km / pose.range_km))


def fitted_correlation(image: Array, bases: list[Array], usable: NDArray[np.bool_]) -> float:
    """Correlation over usable pixels of the image and the weighted sum of bases and a constant that fits it best; 0
    without usable pixels."""
    if np.count_nonzero(usable) < 100:
        return 0.0
    # Rings farther out stand for more pixels.
    weight = np.sqrt(np.linspace(INNER_RADII, OUTER_RADII, RINGS, dtype=np.float32))[:, None]
    columns = np.stack([*bases, np.ones_like(image)])
    design = (columns * weight)[:, usable].T.astype(np.float64)
    normal = design.T @ design
    right = design.T @ (image * weight)[usable].astype(np.float64)
    solution = np.linalg.lstsq(normal, right, rcond=1e-10)[0]
    model = np.tensordot(solution, columns, 1)
    return correlation(image, model, usable)
