"""Images with known truth that the joint step is tried on: scenes of the honesty benchmark, by its own ray caster."""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from catalog.basemap import map_of_target, read_map, uniform_map
from catalog.camera import find_camera
from catalog.observation import Observation
from catalog.pose import Pose
from catalog.target import find_target
from lab.honesty.picture import write_scene
from lab.honesty.scene import LENSES
from lab.honesty.scene import Scene as Row
from lab.honesty.table import all_scenes
from lab.simulate.plant import planted
from tasks.simulate import Scene, SceneSettings

# What the steps before it leave: px of the centre, range factor, degrees about the body's axes.
LEFT_PX, LEFT_RANGE, LEFT_DEG = (0.8, -0.6), 1.002, (0.3, -0.2, 0.25)


@dataclass(frozen=True)
class Case:
    """One image: what was seen of `truth`, with what scene it is explained, where the solution begins, and what the
    metadata say."""

    name: str
    observation: Observation
    scene: Scene
    truth: Pose
    start: Pose
    predicted: Pose


def cases_of(names: Iterable[str]) -> list[Case]:
    """The scenes of the honesty benchmark with these ids."""
    known = {row.id: row for row in all_scenes()}
    return [case_of(known[name]) for name in names]


def case_of(row: Row) -> Case:
    """One scene, rendered, as the joint step sees it after point, range and attitude."""
    from astropy.io import fits

    with TemporaryDirectory() as folder:
        files, truth = write_scene(row, Path(folder))
        camera = find_camera(str(files.camera))
        image = np.asarray(fits.getdata(files.image), np.float32)
        given = read_map(files.map) if files.map else None
        predicted = Pose.from_dict(json.loads(files.pose.read_text()))
    target, lens = find_target(row.stated_target), LENSES[row.lens]
    noise = np.sqrt(lens.read_dn**2 + np.maximum(image, 0) / lens.gain_e_per_dn).astype(np.float32)
    seen = Observation(image, noise, np.zeros(image.shape, np.uint16))
    basemap = given or (uniform_map() if row.given == "none" else map_of_target(target))
    scene = Scene(camera, target, basemap, SceneSettings.model_validate({"photometry": "mixture"}))
    true = Pose.from_dict(truth["pose"])
    start = planted(true, camera, LEFT_PX, LEFT_RANGE, LEFT_DEG)
    return Case(row.id, seen, scene, true, start, predicted)
