"""The contents of a kernel set: which orientation, attitude and motion each exposure contributes, and for how long."""

from collections import defaultdict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from catalog.body import SECONDS_PER_DAY
from catalog.spice_pose import instrument_from_platform
from tasks.kernels.binary import Motion, Orientation, Spin
from tasks.kernels.exposure import LIGHT_KM_PER_S, Exposure
from tasks.kernels.names import camera_frame_id, craft_id, is_built_in
from tasks.kernels.windows import Window, windows

SPARE_S = 1.5  # of an attitude beyond the path of the light and the exposure; SPICE differentiates over 1 s
TRACK_S = 2.0  # of a trajectory beyond the exposure, for the same reason
LEAST_S = 1e-3
SUN = 10
SUN_MAY_DIFFER_DEG = 2e-5


@dataclass
class LeftOut:
    """Exposures that could not contribute, each with what and why."""

    notes: list[dict[str, str]] = field(default_factory=list)

    def note(self, exposure: Exposure, what: str, why: str) -> None:
        """Remember one."""
        self.notes.append({"product": exposure.product, "what": what, "why": why})


def _grouped(
    exposures: Sequence[Exposure],
    key: Callable[[Exposure], Hashable],
    middle: Callable[[Exposure], float],
    before: Callable[[Exposure], float],
    after: Callable[[Exposure], float],
    least: Callable[[Exposure], float],
    what: str,
    left_out: LeftOut,
) -> dict[Any, list[tuple[Exposure, Window]]]:
    """Exposures by what they speak about, with their windows."""
    groups: dict[Any, list[Exposure]] = defaultdict(list)
    for exposure in exposures:
        groups[key(exposure)].append(exposure)
    found = {}
    for group, members in groups.items():
        spans = windows(*([part(e) for e in members] for part in (middle, before, after, least)))
        for exposure, span in zip(members, spans, strict=True):
            if span is None:
                left_out.note(exposure, what, "another exposure of the set speaks for this instant")
        found[group] = [(e, span) for e, span in zip(members, spans, strict=True) if span is not None]
    return found


def _half(exposure: Exposure) -> float:
    return exposure.exposure_s / 2


def _no_less(_: Exposure) -> float:
    return LEAST_S


def _crossing_s(exposure: Exposure) -> float:
    return max(exposure.target.radii_km) / LIGHT_KM_PER_S


def camera_orientations(exposures: Sequence[Exposure], left_out: LeftOut) -> dict[int, list[Orientation]]:
    """By structure: each camera's own frame, for the exposure only."""
    groups = _grouped(
        exposures, lambda e: -camera_frame_id(e.camera), lambda e: e.pose.et, _half, _half, _no_less, "camera", left_out
    )
    return {
        structure: [Orientation(e.product, span, e.pose.camera_from_j2000) for e, span in members]
        for structure, members in groups.items()
    }


def platform_orientations(exposures: Sequence[Exposure], left_out: LeftOut) -> dict[int, list[Orientation]]:
    """By the mission's structure: the frame that its own FK hangs the camera on. Needs that FK and clock loaded; an
    exposure for which they are not is noted."""
    import spiceypy
    from spiceypy.utils.exceptions import SpiceyError

    platforms = {}
    for i, e in enumerate(exposures):
        if e.camera.naif_ck_id is None or e.camera.naif_spacecraft_id is None:
            continue
        try:
            spiceypy.sce2c(e.camera.naif_spacecraft_id, e.pose.et)
            from_platform = np.asarray(e.camera.camera_from_instrument, float) @ instrument_from_platform(
                e.camera, e.pose.et
            )
        except SpiceyError as error:
            left_out.note(e, "platform", f"the mission's clock or frames are not loaded ({error.short})")
            continue
        platforms[i] = from_platform.T @ e.pose.camera_from_j2000
    chosen = [exposures[i] for i in platforms]
    matrices = {id(exposures[i]): matrix for i, matrix in platforms.items()}
    groups = _grouped(
        chosen, lambda e: e.camera.naif_ck_id, lambda e: e.pose.et, _half, _half, _no_less, "platform", left_out
    )
    return {
        structure: [Orientation(e.product, span, matrices[id(e)]) for e, span in members]
        for structure, members in groups.items()
    }


def attitudes(exposures: Sequence[Exposure], left_out: LeftOut) -> dict[int, list[Spin]]:
    """By PCK frame class: the target's attitude from when the exposure's light left it to the exposure."""
    groups = _grouped(
        exposures,
        lambda e: e.target.naif_id,
        lambda e: e.emission_et,
        lambda e: _crossing_s(e) + _half(e) + SPARE_S,
        lambda e: e.light_time_s + _half(e) + SPARE_S,  # SPICE begins its light-time iteration at the exposure
        _crossing_s,
        "attitude",
        left_out,
    )
    return {
        body: [Spin(e.product, span, e.emission_et, e.pose.body_from_j2000, _rate(e)) for e, span in members]
        for body, members in groups.items()
    }


def _rate(exposure: Exposure) -> float:
    rotation = exposure.target.rotation
    rates = rotation.prime_meridian_deg if rotation else ()
    return rates[1] / SECONDS_PER_DAY if exposure.moving and len(rates) > 1 else 0.0


def _tracks(exposures: Sequence[Exposure], left_out: LeftOut) -> list[tuple[Exposure, Window]]:
    groups = _grouped(
        exposures,
        lambda e: craft_id(e.camera),
        lambda e: e.pose.et,
        lambda e: _half(e) + TRACK_S,
        lambda e: _half(e) + TRACK_S,
        _no_less,
        "spacecraft",
        left_out,
    )
    return [member for members in groups.values() for member in members]


def motions_with_mission(exposures: Sequence[Exposure], left_out: LeftOut) -> list[Motion]:
    """The spacecraft relative to the target, whose own trajectory the loaded kernels know. An exposure for which they
    do not, or whose pose knows no velocities, is noted."""
    from spiceypy.utils.exceptions import SpiceyError

    known: dict[int, tuple[np.ndarray, np.ndarray]] = {}
    usable = []
    for e in exposures:
        if not e.moving:
            left_out.note(e, "mission", "the pose knows no velocities, so it is one fixed geometry: only the set alone")
            continue
        try:
            known[id(e)] = _target_states(e)
        except SpiceyError as error:
            left_out.note(e, "mission", f"no loaded SPK knows {e.target.name} ({error.short})")
            continue
        usable.append(e)
    motions = []
    for e, span in _tracks(usable, left_out):
        at_exposure, at_emission = known[id(e)]
        position = at_emission[:3] - at_exposure[:3] - e.true_target_from_spacecraft_km
        velocity = e.velocities_km_s[0] - at_exposure[3:]
        motions.append(Motion(e.product, span, craft_id(e.camera), e.target.naif_id, e.pose.et, position, velocity))
    return motions


def _target_states(exposure: Exposure) -> tuple[np.ndarray, np.ndarray]:
    import spiceypy

    times = (exposure.pose.et, exposure.emission_et)
    at_exposure, at_emission = (np.asarray(spiceypy.spkgeo(exposure.target.naif_id, t, "J2000", 0)[0]) for t in times)
    return at_exposure, at_emission


def motions_alone(exposures: Sequence[Exposure], left_out: LeftOut) -> list[Motion]:
    """A small solar system of its own: the Sun at rest in the barycentre, each target on a straight track around its
    exposures, the spacecraft where the pose has it. Exposures that overlap in time share the target's track."""
    bodies: list[Motion] = []
    for e in sorted(exposures, key=lambda e: e.emission_et):
        track = _track_of(e)
        earlier = next((m for m in bodies[::-1] if m.body == track.body and m.window[1] > track.window[0]), None)
        if earlier is None:
            bodies.append(track)
            continue
        if _apart_deg(earlier.at(e.emission_et)[:3], track.position_km) > SUN_MAY_DIFFER_DEG:
            left_out.note(e, "alone", "another exposure of the set at the same time has its Sun elsewhere")
            continue
        window = (earlier.window[0], max(earlier.window[1], track.window[1]))
        bodies[bodies.index(earlier)] = Motion(**{**earlier.__dict__, "window": window})
    dropped = {note["product"] for note in left_out.notes if note["what"] == "alone"}
    crafts = []
    for e, span in _tracks([e for e in exposures if e.product not in dropped], left_out):
        track = next(m for m in bodies if m.body == e.target.naif_id and m.window[0] <= e.emission_et <= m.window[1])
        position = track.at(e.emission_et)[:3] - e.true_target_from_spacecraft_km
        crafts.append(Motion(e.product, span, craft_id(e.camera), 0, e.pose.et, position, e.velocities_km_s[0]))
    return [_sun(exposures), *bodies, *crafts]


def _track_of(exposure: Exposure) -> Motion:
    before, after = _crossing_s(exposure) + 1.0 + _half(exposure), TRACK_S + _half(exposure)
    window = (exposure.emission_et - before, exposure.pose.et + after)
    position, velocity = -exposure.true_sun_from_target_km, exposure.velocities_km_s[1]
    return Motion(exposure.product, window, exposure.target.naif_id, 0, exposure.emission_et, position, velocity)


def _sun(exposures: Sequence[Exposure]) -> Motion:
    light_s = max(float(np.linalg.norm(e.pose.sun_from_target_km)) for e in exposures) / LIGHT_KM_PER_S
    window = (min(e.emission_et for e in exposures) - 1.1 * light_s - 1e3, max(e.pose.et for e in exposures) + 1e3)
    return Motion("Sun at rest", window, SUN, 0, window[0], np.zeros(3), np.zeros(3))


def _apart_deg(a: np.ndarray, b: np.ndarray) -> float:
    cross = np.linalg.norm(np.cross(a, b))
    return float(np.degrees(np.arctan2(cross, a @ b)))


def described(exposures: Sequence[Exposure]) -> list[str]:
    """Lines about the exposures' targets that the reader of a comment needs."""
    targets = {e.target.name: e.target for e in exposures}
    return [
        f"{name}: attitude in frame {t.body_frame}, which SPICE knows by itself"
        if is_built_in(t)
        else f"{name}: attitude in a frame of this set"
        for name, t in targets.items()
    ]
