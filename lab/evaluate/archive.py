"""Evaluate: correct a simulated archive with one or more profiles and compare every pose with the truth."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from catalog.basemap import map_of_target
from catalog.camera import Camera, find_camera
from catalog.errors import PlanetposeError, RefusedError
from catalog.pose import IN_IMAGE, Pose, read_pose_file
from catalog.reasons import Reason
from catalog.target import Target, find_target
from flows.chain import Chain, NotCachedError, only_cached
from flows.image import correct_image
from flows.one_image import one_result
from flows.progress import Silent
from flows.request import Request
from lab.evaluate.assess import Assessment, assess, in_sigmas
from lab.simulate.archive import MANIFEST, read_manifest
from tasks.joint.parameters import OFFSET, RANGE
from tasks.joint.uncertainty import of_the_body, of_the_camera
from tasks.profile import Profile
from tasks.simulate import Scene
from tasks.simulate.window import disk_radius_px
from tasks.step import run

Row = dict[str, Any]


@dataclass(frozen=True)
class Job:
    """One image to be corrected with one profile. listed: its line of `images.csv`. pose_in_image: without its pose
    file."""

    folder: Path
    listed: dict[str, str]
    profile: Profile
    store: Path
    pose_in_image: bool = False

    @property
    def request(self) -> Request:
        """The options of `planetpose correct` for this image: its pose file, or `--pose image`; no kernels."""
        return Request(
            image=self.folder / self.listed["image"],
            store=self.store / self.profile.name,
            pose_file=Path(IN_IMAGE) if self.pose_in_image else self.folder / self.listed["pose_file"],
            kernels=(),
            profile=self.profile,
        )


def evaluate_archive(
    folder: Path,
    profiles: Sequence[Profile],
    store: Path,
    products: Sequence[str] = (),
    cameras: Sequence[str] = (),
    limit: int | None = None,
    jobs: int = 1,
    tell: Callable[[Row], None] = lambda _: None,
    pose_in_image: bool = False,
) -> list[Row]:
    """Rows (see `evaluate_image`) of every image of `folder`, all or some, with every profile; `jobs` at a time.
    pose_in_image: the predicted poses are thrown away, and found in the images.

    More than one job: each in a process of its own. Raises RefusedError when there is no such archive, or nothing of it
    is left.
    """
    listed = [
        row
        for row in read_manifest(folder / MANIFEST)
        if (not products or row["product"] in products) and (not cameras or row["camera"] in cameras)
    ][:limit]
    if not listed:
        wanted = ", ".join([*products, *cameras])
        raise RefusedError(Reason.NOTHING_TO_EVALUATE, f"{folder} lists none of {wanted or 'them'}.", "See images.csv.")
    work = [Job(folder, row, profile, store, pose_in_image) for profile in profiles for row in listed]
    rows = []
    for row in _rows(work, jobs):
        tell(row)
        rows.append(row)
    return rows


def _rows(work: list[Job], jobs: int) -> Iterator[Row]:
    if jobs == 1:
        yield from map(evaluate_image, work)
        return
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        yield from pool.map(evaluate_image, work)


def evaluate_image(job: Job) -> Row:
    """Correct one image (its cached steps are not done again) and compare with the truth. The row, plain JSON values:

    product, camera, profile, status, reason, code (the reason's first word). truth: what images.csv says was planted.
    steps: for each step that ends with a pose, `pose` or `image_pose` being the predicted one, its `Assessment` and
    seconds. before, after: of the predicted and of the published pose (None without one). uncertainty: as in the
    result; sigmas: errors in its units, without what simulated images lack (see `not_simulated`). seconds: per step.
    """
    request = job.request
    result = one_result(request, Silent(), run_step=run)
    truth = read_pose_file(job.folder / job.listed["truth_file"]).completed()
    camera, target = find_camera(job.listed["camera"]), find_target(job.listed["target"])

    def compared(pose: Pose) -> Assessment:
        return assess(pose, truth, camera, target)

    steps = {
        name: {**compared(done.result.pose).to_dict(), "seconds": done.record.seconds}
        for name, done in replayed(request).done.items()
        if "pose" in done.step.kind.changes
    }
    after = compared(Pose.from_dict(result["pose"])) if result["pose"] else None
    reason = result["reason"]
    return {
        "product": job.listed["product"],
        "camera": camera.name,
        "profile": job.profile.name,
        "status": result["status"],
        "reason": reason,
        "code": reason.partition(":")[0] if reason else None,
        "truth": {key.removeprefix("truth."): value for key, value in job.listed.items() if key.startswith("truth.")},
        "before": steps.get("pose") or steps.get("image_pose"),
        "after": after.to_dict() if after else None,
        "uncertainty": result["uncertainty"],
        "sigmas": in_sigmas(after, result["uncertainty"], not_simulated(job.profile, truth, camera, target))
        if after
        else None,
        "limb_rms_px": result["limb_rms_px"],
        "steps": steps,
        "seconds": result["seconds"],
    }


def not_simulated(profile: Profile, truth: Pose, camera: Camera, target: Target) -> dict[str, float]:
    """1-sigma of what the joint step's errors allow for and simulated images do not have: errors of the focal length,
    of the body's radius and its relief, and of the frame of the map (the other map's own is taken out). By keys of
    `uncertainty`."""
    if "joint" not in profile.steps:
        return {}
    variance = of_the_body(target, disk_radius_px(truth, camera, target)) + of_the_camera(camera)
    lacking = np.sqrt(np.diag(variance))
    return {
        "centre_px": float(lacking[OFFSET][0]),
        "range_factor": float(lacking[RANGE]),
        "attitude_deg": Scene(camera, target, map_of_target(target)).map_frame_deg,
    }


def replayed(request: Request) -> Chain:
    """The chain of an image that was corrected before, its records read from the cache, as far as it came."""
    chain = Chain(request, only_cached)
    with suppress(PlanetposeError, NotCachedError):
        correct_image(chain)
    return chain
