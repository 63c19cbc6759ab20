"""A scene renders simulations of one target through one camera; only the pose changes."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from catalog.basemap import BaseMap
from catalog.camera import Camera
from catalog.pose import Pose
from catalog.target import Target
from tasks.simulate.others import OtherBodiesSettings
from tasks.simulate.photometry import BasisName, bases_of
from tasks.simulate.pixels import detect
from tasks.simulate.shine import cosines_of, shines_of, with_shines
from tasks.simulate.trail import smeared
from tasks.simulate.window import Window, disk_radius_px, target_window


class SceneSettings(BaseModel):
    """How simulations are made. psf_sigma_px: None takes the camera's. trail_px: (x, y) of a line along which the
    exposure spreads every point (see `tasks.simulate.trail`). oversample: None chooses by the disk's size.
    behind_share: where the target's surroundings are brighter than the frame's darkest parts by more than this share of
    its span of brightness, a body is taken to be behind the target, which hides its light (a moon in front of its
    planet, see `tasks.compare.occulted`); None never. others: of other bodies in the frame."""

    model_config = ConfigDict(frozen=True, extra="forbid")
    photometry: BasisName = "lunar-lambert"
    psf_sigma_px: float | None = Field(None, ge=0, le=20)
    trail_px: tuple[float, float] = (0.0, 0.0)
    oversample: int | None = Field(None, ge=1, le=16)
    behind_share: float | None = Field(0.1, gt=0, lt=1)
    rays: Literal["closed-form", "mitsuba-limb", "mitsuba"] = "closed-form"
    others: OtherBodiesSettings = OtherBodiesSettings()


@dataclass(frozen=True)
class Surface:
    """Sub-pixel samples of the rendered geometry, all (ny*s, nx*s): hit, cosines of incidence (0 at night) and
    emission, and the map's albedo."""

    hit: NDArray[np.bool_]
    mu0: NDArray[np.float32]
    mu: NDArray[np.float32]
    albedo: NDArray[np.float32]


@dataclass(frozen=True)
class Simulation:
    """bases: float32 (k, ny, nx) basis images under `window`; the simulated image is their weighted sum plus a
    background. shading: the same without the map (albedo 1). coverage, lit: fraction of each pixel that the target
    and its sunlit side fill; blurred like the image. draw_shading, draw_lit: draw these two, which few need, at their
    first use. hides: how many of the bases, the last ones, are no light of the target but what it takes away
    of the light behind it."""

    window: Window
    oversample: int
    psf_sigma_px: float
    bases: NDArray[np.float32]
    coverage: NDArray[np.float32]
    draw_shading: Callable[[], NDArray[np.float32]]
    draw_lit: Callable[[], NDArray[np.float32]]
    hides: int = 0

    @cached_property
    def shading(self) -> NDArray[np.float32]:
        """(k, ny, nx): the bases without the map."""
        return self.draw_shading()

    @cached_property
    def lit(self) -> NDArray[np.float32]:
        """(ny, nx): fraction of each pixel that the target's sunlit side fills."""
        return self.draw_lit()

    @property
    def of_target(self) -> NDArray[np.float32]:
        """The bases that are light of the target."""
        return self.bases[: len(self.bases) - self.hides]

    def image(self, weights: NDArray | None = None, background: float = 0.0) -> NDArray[np.float32]:
        """Weighted sum of the target's bases (ny, nx); equal weights by default."""
        bases = self.of_target
        weights = np.ones(len(bases)) if weights is None else weights
        return np.tensordot(np.asarray(weights, np.float32), bases, 1) + np.float32(background)

    def hiding(self, light: NDArray[np.float32]) -> "Simulation":
        """The same with one basis more: what the target takes away of the light (ny, nx) behind it."""
        return replace(self, bases=np.concatenate([self.bases, -(light * self.coverage)[None]]), hides=self.hides + 1)


@dataclass(frozen=True)
class Scene:
    """Camera, target, base map and settings: everything of a simulation but the pose."""

    camera: Camera
    target: Target
    basemap: BaseMap
    settings: SceneSettings = field(default_factory=SceneSettings)

    @property
    def psf_sigma_px(self) -> float:
        """Gaussian PSF width in use."""
        own = self.settings.psf_sigma_px
        return self.camera.psf_sigma_px if own is None else own

    def oversample_for(self, pose: Pose) -> int:
        """Sub-pixels per pixel side: more for small disks, whose limb has few pixels."""
        if self.settings.oversample:
            return self.settings.oversample
        diameter = 2 * disk_radius_px(pose, self.camera, self.target)
        return int(np.clip(np.ceil(600 / max(diameter, 1.0)), 2, 8))

    @property
    def map_frame_deg(self) -> float:
        """1-sigma about each of the body's axes of how the base map lies in the frame of its coordinates, degrees; 0
        for a map without markings."""
        if np.ptp(self.basemap.albedo) == 0:
            return 0.0
        return self.target.expected_map_frame_deg(self.basemap.albedo.shape[0])

    def coarser(self, pose: Pose, across: float) -> "Scene":
        """The same with no more sub-pixels than make the disk `across` of them wide."""
        diameter = 2 * disk_radius_px(pose, self.camera, self.target)
        enough = max(1, int(np.ceil(across / max(diameter, 1.0))))
        oversample = min(self.oversample_for(pose), enough)
        return replace(self, settings=self.settings.model_copy(update={"oversample": oversample}))

    def with_rendered_limb(self) -> "Scene":
        """The same with at least the limb rendered by Mitsuba."""
        if self.settings.rays != "closed-form":
            return self
        return replace(self, settings=self.settings.model_copy(update={"rays": "mitsuba-limb"}))

    def window(self, pose: Pose, margin_px: float | None = None) -> Window:
        """The target's window (see `target_window`)."""
        return target_window(pose, self.camera, self.target, margin_px)

    def surface(self, pose: Pose, window: Window, oversample: int) -> Surface:
        """Cosines and albedo at every sub-pixel, by the ray caster of the settings."""
        if self.settings.rays == "mitsuba":
            from tasks.simulate.mitsuba_geometry import rendered_surface as surface
        elif self.settings.rays == "mitsuba-limb":
            from tasks.simulate.mitsuba_geometry import surface_with_rendered_limb as surface
        else:
            from tasks.simulate.closed_form import ellipsoid_surface as surface
        return Surface(*surface(pose, self.camera, self.target, self.basemap, window, oversample))

    def shade(self, surface: Surface, pose: Pose, window: Window, oversample: int) -> list[NDArray[np.float32]]:
        """Basis images (ny*s, nx*s), albedo 1, of the chosen photometry at the sub-pixels, under the Sun and the light
        of other bodies."""
        shines = shines_of(pose, self.target, self.settings.others)
        cosines = cosines_of(shines, pose, self.camera, self.target, window, oversample)
        cosines = [np.where(surface.hit, cosine, np.float32(0)) for cosine in cosines]
        return [
            with_shines(law, surface.mu0, surface.mu, pose.phase_deg, shines, cosines)
            for law in bases_of(self.settings.photometry)
        ]

    def render(self, pose: Pose, window: Window | None = None) -> Simulation:
        """Simulate `pose` under `window` (default: the target's window, which may leave the frame).

        Raises ValueError when the target is behind the camera or the window is empty.
        """
        window = window or self.window(pose)
        if min(window.shape) < 1:
            raise ValueError(f"empty window {window}")
        s = self.oversample_for(pose)
        surface = self.surface(pose, window, s)
        fine = self.shade(surface, pose, window, s)
        sigma = self.psf_sigma_px

        def seen(plane: NDArray[np.float32]) -> NDArray[np.float32]:
            return smeared(detect(plane, s, sigma), self.settings.trail_px)

        return Simulation(
            window=window,
            oversample=s,
            psf_sigma_px=sigma,
            bases=np.stack([seen(surface.albedo * basis) for basis in fine]),
            coverage=seen(surface.hit.astype(np.float32)),
            draw_shading=lambda: np.stack([seen(basis) for basis in fine]),
            draw_lit=lambda: seen((surface.mu0 > 0).astype(np.float32)),
        )
