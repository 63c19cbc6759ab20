"""Scenes of two or three bodies, drawn; together with its number each says everything.

Jupiter's system on a camera like one that flew, at true sizes: what stands where is drawn in the picture, and places in
space follow. Metadata are some pixels off in pointing, 0.1 % in range and some tenths of a degree in the target's
orientation; the other bodies' places relative to the target are off by some kilometres.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.rotation import rotation_from_vector_deg
from catalog.target import find_target
from lab.bodies.caster import Annulus, Globe, Lamps, cast, lamps_of
from lab.bodies.places import MOONS, PLACES, Frame, orientation_of
from lab.honesty.caster import rays_of
from lab.honesty.scene import LENSES, Lens
from lab.honesty.solids import Solid, Texture, packaged_texture, procedural_texture

Array = NDArray[np.float64]
KINDS = (
    "beside", "transit", "straddling", "half-hidden", "hidden-by-planet", "shadow", "eclipsed", "moon-shadow", "ring",
    "night",
)  # fmt: skip
FRAME_PX = 320
MASTER_SEED = 20261201
SUN_KM = {"jupiter": 7.78e8, "saturn": 1.43e9}
LAWS: tuple[tuple[str, dict[str, float]], ...] = (
    ("lommel-seeliger", {}),
    ("lambert", {}),
    ("lunar-lambert", {}),
    ("hapke", {"w": 0.9, "b": -0.25, "b0": 0.5, "h": 0.05, "roughness_deg": 15.0}),
)
OFFSET_PX, RANGE_SIGMA, ATTITUDE_DEG, EPHEMERIS_KM = 8.0, 0.001, 0.3, 5.0
PHASES, NIGHT_PHASES = (15, 75), (95, 150)
ATTEMPTS, SAMPLES = 60, 60
LEAST_LIT, RIM = 0.35, 0.9
# Where something hides or shadows the target it does so.
MOST_LIT = dict.fromkeys(KINDS, 0.97) | {
    "beside": 1.0,
    "transit": 1.0,
    "straddling": 1.0,
    "moon-shadow": 0.9999,
    "night": 1.0,
}


@dataclass(frozen=True)
class Other:
    """Another body as it is: catalog name, centre from the target (km, J2000), the place that the metadata give it."""

    name: str
    from_target_km: Array
    stated_km: Array


@dataclass(frozen=True)
class Scene:
    """One image. pose_*: camera, target and Sun as `Pose` has them, true and as the metadata say."""

    id: str
    kind: str
    target: str
    lens: Lens
    law: tuple[str, dict[str, float]]
    camera_from_j2000: Array
    target_km: Array
    sun_km: Array
    body_from_j2000: Array
    stated: dict[str, Array] = field(default_factory=dict)
    others: tuple[Other, ...] = ()
    seed: int = 0

    @property
    def centre_px(self) -> Array:
        """True place (2,) of the target's centre."""
        v = self.camera_from_j2000 @ self.target_km
        return np.asarray(v[:2] / v[2] * self.lens.focal_px + (FRAME_PX - 1) / 2)

    def globes(self) -> list[Globe]:
        """All bodies, the target first."""
        return [self._globe(self.target, np.zeros(3)), *(self._globe(o.name, o.from_target_km) for o in self.others)]

    def lamps(self) -> Lamps | None:
        """Light of the planet on the target, in scenes of its night side; elsewhere it is lost in sunlight."""
        if self.kind != "night":
            return None
        planet = self.globes()[1]
        albedo = find_target(self.others[0].name).geometric_albedo
        return lamps_of(planet, albedo, self.target_km, self.target_km + self.sun_km)

    def _globe(self, name: str, offset: Array) -> Globe:
        known = find_target(name)
        turn = self.body_from_j2000 if name == self.target else orientation_of(name)
        bright = known.geometric_albedo / find_target(self.target).geometric_albedo
        solid = Solid(
            self.target_km + offset,
            np.array(known.radii_km),
            turn,
            *self.law,
            texture=texture_of(name, self.seed),
            brightness=bright if name != self.target else 1.0,
        )
        rings = tuple(Annulus(r.inner_km, r.outer_km, r.optical_depth, 0.4 * bright) for r in known.rings)
        return Globe(known.naif_id, solid, rings)

    def pose(self) -> dict[str, Any]:
        """The pose file's content: what the metadata say."""
        stated = {key: value.tolist() for key, value in self.stated.items()}
        bodies = [
            {
                "name": each.name,
                "from_target_km": each.stated_km.tolist(),
                "body_from_j2000": orientation_of(each.name).tolist(),
                "sigma_km": EPHEMERIS_KM,
            }
            for each in self.others
        ]
        return {"et": 2.0e8, **stated, "bodies": bodies, "errors": {"range_share": RANGE_SIGMA}}


def texture_of(name: str, seed: int) -> Texture:
    """The catalog's map, or markings of no body."""
    basemap = find_target(name).basemap
    return packaged_texture(basemap) if basemap else procedural_texture(seed % 3)


def unit(longitude_deg: float, latitude_deg: float) -> Array:
    """A direction (3,)."""
    lon, lat = np.radians([longitude_deg, latitude_deg])
    return np.array([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)])


def scene_of(kind: str, number: int) -> Scene:
    """The scene of a kind and number: the first draw that leaves enough of the target in sight and in sunlight."""
    for attempt in range(ATTEMPTS):
        scene = drawn(kind, number, attempt)
        if LEAST_LIT <= lit_share(scene) <= MOST_LIT[kind]:
            return scene
    raise ValueError(f"no scene {kind} {number} in {ATTEMPTS} draws")


def lit_share(scene: Scene) -> float:
    """How much of what the target would show of its day side alone is seen and in full sunlight: of the whole, or of
    the limb, whichever is less."""
    radius_px = scene.lens.focal_px * find_target(scene.target).mean_radius_km / float(np.linalg.norm(scene.target_km))
    steps = np.linspace(-radius_px, radius_px, SAMPLES)
    x, y = (grid.ravel() for grid in np.meshgrid(steps + scene.centre_px[0], steps + scene.centre_px[1]))
    middle = (FRAME_PX - 1) / 2
    rays = rays_of(scene.camera_from_j2000, scene.lens.focal_px, (middle, middle), x, y)
    globes, sun = scene.globes(), scene.target_km + scene.sun_km
    alone, seen = cast(rays, globes[:1], sun, 7), cast(rays, globes, sun, 7)
    day = alone.radiance > 0
    lit = day & (seen.body_id == globes[0].naif_id) & (seen.shadow < 0.5) & (seen.radiance > 0.9 * alone.radiance)
    rim = np.hypot(*(grid.ravel() for grid in np.meshgrid(steps, steps))) > RIM * radius_px
    return float(min(lit.sum() / max(day.sum(), 1), (lit & rim).sum() / max((day & rim).sum(), 1)))


def drawn(kind: str, number: int, attempt: int) -> Scene:
    """One draw."""
    random = np.random.default_rng([MASTER_SEED, KINDS.index(kind), number, attempt])
    lens = list(LENSES.values())[number % 4]
    law = LAWS[number % 3 if number % 5 else 3]
    ringed = kind == "ring"
    target = str(random.choice(["mimas", "enceladus", "tethys", "dione"] if ringed else MOONS))
    if kind == "moon-shadow":
        target = str(random.choice(["europa", "ganymede"]))
    radius_px = float(random.uniform(30, 75))
    radius_km = find_target(target).mean_radius_km
    range_km = lens.focal_px * radius_km / radius_px
    sight = unit(random.uniform(0, 360), random.uniform(-12, 12))
    phases = NIGHT_PHASES if kind == "night" else PHASES
    phase = float(random.uniform(*phases)) * random.choice([-1, 1])
    towards = rotation_from_vector_deg([0, 0, phase]) @ -sight
    sun = towards * SUN_KM["saturn" if ringed else "jupiter"]
    camera = looking_along(sight, float(random.uniform(-20, 20)), lens.focal_px, random.uniform(0.38, 0.62, 2))
    frame = Frame(range_km * sight, towards, camera, lens.focal_px, radius_px, radius_km, random)
    others = tuple(
        Other(name, offset, offset + random.normal(0, EPHEMERIS_KM / np.sqrt(3), 3))
        for name, offset in PLACES[kind](frame, target)
    )
    body = rotation_from_vector_deg([0, 0, random.uniform(0, 360)]) @ rotation_from_vector_deg([2.0, -1.0, 0.0])
    turn = rotation_from_vector_deg(np.degrees(np.append(random.normal(0, OFFSET_PX / lens.focal_px, 2), 0)))
    stated = {
        "camera_from_j2000": turn @ camera,
        "target_from_spacecraft_km": range_km * sight * (1 + random.normal(0, RANGE_SIGMA)),
        "sun_from_target_km": sun,
        "body_from_j2000": rotation_from_vector_deg(random.normal(0, ATTITUDE_DEG, 3)) @ body,
    }
    name = f"{kind}-{number:03d}"
    return Scene(name, kind, target, lens, law, camera, range_km * sight, sun, body, stated, others, number)


def looking_along(sight: Array, roll_deg: float, focal_px: float, place: Array) -> Array:
    """camera_from_j2000 that has `sight` at a place of the frame, in shares of its side."""
    right = np.cross(sight, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    camera = rotation_from_vector_deg([0, 0, roll_deg]) @ np.stack([right, np.cross(sight, right), sight])
    x, y = (place * FRAME_PX - (FRAME_PX - 1) / 2) / focal_px
    return np.asarray(rotation_from_vector_deg(np.degrees([-y, x, 0])) @ camera)
