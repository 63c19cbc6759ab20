"""Write a kernel set: the files, their comments with provenance, and the two meta-kernels."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from catalog.spice import Kernel
from catalog.times import now_utc, utc_from_et
from tasks.atomic import folder_put_in_place
from tasks.kernels.binary import write_ck, write_pck, write_spk
from tasks.kernels.exposure import Exposure
from tasks.kernels.names import CLOCK_ID, camera_frame, camera_frame_id, craft_id, target_frame
from tasks.kernels.parts import (
    LeftOut,
    attitudes,
    camera_orientations,
    described,
    motions_alone,
    motions_with_mission,
    platform_orientations,
)
from tasks.kernels.text import clock_values, frame_values, meta_values, radii_values, wrapped, write_text_kernel
from tasks.publish.cube import software_version

ALONE, MISSION = "_alone.tm", ".tm"
COMMON = (".tsc", ".tf", ".tpc", ".bpc", ".bc")
WHAT = {
    ".tsc": "Clock of the camera frames: microseconds of TDB. Needs no leap seconds.",
    ".tf": "Frames of the cameras (+X sample, +Y line, +Z boresight; pinhole of the undistorted frame), and names.",
    ".tpc": "Radii on which latitudes, longitudes and angles of the cubes were computed.",
    ".bpc": "Corrected attitude of the targets while the light of the exposures travelled; it goes before a text PCK.",
    ".bc": "Corrected orientation of the cameras' own frames (CK type 3), each only for its exposure, at rest.",
    "_platform.bc": "The same for the mission's own structures (CK type 3), so that its frames are corrected.",
    ".bsp": "Corrected spacecraft position relative to the target, around the exposures (SPK type 13).",
    "_alone.bsp": "Spacecraft, targets and Sun around the exposures, for use without any other trajectory: the Sun "
    "rests in the barycentre. Do not mix with other SPKs.",
}


@dataclass(frozen=True)
class KernelSet:
    """What was written. files: by suffix. meta_kernels: `alone`, and `mission` if the set can follow the mission's own
    kernels. left_out: what exposures could not contribute, and why."""

    name: str
    folder: Path
    products: list[str]
    files: dict[str, Path]
    left_out: list[dict[str, str]] = field(default_factory=list)

    @property
    def meta_kernels(self) -> dict[str, Path]:
        """The set's entry points."""
        kinds = {"alone": ALONE, "mission": MISSION}
        return {kind: self.files[suffix] for kind, suffix in kinds.items() if suffix in self.files}

    def names_of(self, exposure: Exposure) -> dict[str, Any]:
        """What to ask SPICE for: names of target and frames, numbers of spacecraft and camera."""
        return {
            "target": str(exposure.target.naif_id),
            "target_frame": target_frame(exposure.target),
            "spacecraft": str(craft_id(exposure.camera)),
            "camera_frame": camera_frame(exposure.camera),
            "camera_id": -camera_frame_id(exposure.camera),
        }


def write_kernel_set(name: str, exposures: Sequence[Exposure], folder: Path, loaded: Sequence[Kernel]) -> KernelSet:
    """Write the set `name` of `exposures` into the new or replaced folder `folder`/`name`.

    To be called inside `catalog.spice.kernel_pool`, whose kernels `loaded` tell the mission's clock and frames and the
    target's trajectory; what they do not tell is left out, and what plain SPICE needs to do without is always there.
    """
    left_out = LeftOut()
    final = (folder / name).absolute()
    with folder_put_in_place(final) as temporary:
        suffixes = _write_files(name, exposures, temporary, loaded, left_out)
        mission_is_complete = ".bsp" in suffixes
        _write_meta(name, final, temporary, ALONE, [*COMMON, "_alone.bsp"], exposures, loaded)
        if mission_is_complete:
            after = [*COMMON, *(s for s in ("_platform.bc", ".bsp") if s in suffixes)]
            _write_meta(name, final, temporary, MISSION, after, exposures, loaded)
    metas = [ALONE, *([MISSION] if mission_is_complete else [])]
    files = {suffix: final / f"{name}{suffix}" for suffix in (*suffixes, *metas)}
    return KernelSet(name, final, [e.product for e in exposures], files, left_out.notes)


def _write_files(
    name: str, exposures: Sequence[Exposure], folder: Path, loaded: Sequence[Kernel], left_out: LeftOut
) -> list[str]:
    import spiceypy

    def path(suffix: str) -> Path:
        return folder / f"{name}{suffix}"

    def comment(suffix: str) -> list[str]:
        return wrapped([WHAT[suffix], "", *provenance(exposures, loaded)])

    cameras = list({e.camera.name: e.camera for e in exposures}.values())
    targets = list({e.target.name: e.target for e in exposures}.values())
    texts = {
        ".tsc": ("SCLK", clock_values()), ".tf": ("FK", frame_values(cameras, targets)),
        ".tpc": ("PCK", radii_values(targets)),
    }  # fmt: skip
    for suffix, (architecture, values) in texts.items():
        write_text_kernel(path(suffix), architecture, [WHAT[suffix], *_by(), *described(exposures)], values)
    clock = str(path(".tsc"))
    spiceypy.furnsh(clock)
    try:
        cameras_own = camera_orientations(exposures, left_out)
        write_ck(path(".bc"), dict.fromkeys(cameras_own, CLOCK_ID), cameras_own, comment(".bc"))
    finally:
        spiceypy.unload(clock)
    write_pck(path(".bpc"), attitudes(exposures, left_out), comment(".bpc"))
    write_spk(path("_alone.bsp"), motions_alone(exposures, left_out), comment("_alone.bsp"))
    written = [*COMMON, "_alone.bsp"]
    platforms = platform_orientations(exposures, left_out)
    crafts = {e.camera.naif_ck_id or 0: e.camera.naif_spacecraft_id or 0 for e in exposures}
    if platforms:
        write_ck(path("_platform.bc"), crafts, platforms, comment("_platform.bc"))
    motions = motions_with_mission(exposures, left_out)
    if motions:
        write_spk(path(".bsp"), motions, comment(".bsp"))
    return written + (["_platform.bc"] if platforms else []) + ([".bsp"] if motions else [])


def _write_meta(
    name: str,
    final: Path,
    folder: Path,
    suffix: str,
    members: Sequence[str],
    exposures: Sequence[Exposure],
    loaded: Sequence[Kernel],
) -> None:
    before = {
        ALONE: ["Load this file alone: it needs no other kernel (a leap-second kernel only for UTC, as in STR2ET)."],
        MISSION: [
            "Load this file AFTER the mission's kernels: leap seconds, clock, planets and moons, and for the mission's "
            "own frames its FK. What comes later goes before. The set was written with:",
            *(f"   {kernel.path.name}  sha256 {kernel.sha256[:16]}" for kernel in loaded),
        ],
    }[suffix]
    order = [f"   {name}{member}: {WHAT[member]}" for member in members]
    asking = _example(exposures[0])
    comment = [*_by(), "", *before, "", "Order of loading:", *order, "", *asking, "", *provenance(exposures)]
    comment += ["", "Edit PATH_VALUES if the files are moved."]
    write_text_kernel(
        folder / f"{name}{suffix}", "MK", comment, meta_values(final, [f"{name}{member}" for member in members])
    )


def _by() -> list[str]:
    return [f"Written {now_utc()} by planetpose {software_version()}."]


def _example(exposure: Exposure) -> list[str]:
    return [
        f"Example, pixel (x, y) of {exposure.product}, 0-based, of the undistorted frame: SINCPT( 'ELLIPSOID', "
        f"'{exposure.target.naif_id}', {exposure.pose.et:.6f}, '{target_frame(exposure.target)}', 'CN+S', "
        f"'{craft_id(exposure.camera)}', '{camera_frame(exposure.camera)}', [(x - CENTRE_PX(1)) / FOCAL_LENGTH_PX, "
        "(y - CENTRE_PX(2)) / FOCAL_LENGTH_PX, 1] ).",
        f"CENTRE_PX and FOCAL_LENGTH_PX are variables of INS-{camera_frame_id(exposure.camera)} in the kernel pool.",
    ]


def provenance(exposures: Sequence[Exposure], loaded: Sequence[Kernel] = ()) -> list[str]:
    """Where each exposure's numbers came from: file and settings by hash, pose, who wrote the cube."""
    lines = []
    for e in exposures:
        pose = e.pose.to_dict()
        lines += [f"{e.product}: {e.target.name} by {e.camera.name}, {utc_from_et(e.pose.et)}, {e.exposure_s:g} s"]
        lines += [f"   {key}: {json.dumps(value)}" for key, value in (e.origin | pose).items()]
    return [*_by(), *lines, *(["Loaded: " + ", ".join(k.path.name for k in loaded)] if loaded else [])]
