"""Mosaic and orientations in turn, until both are at rest."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import overload

import numpy as np
from numpy.typing import NDArray

from catalog.basemap import BaseMap
from catalog.errors import RefusedError
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.target import Target
from tasks.control.bundle import adjust_bundle
from tasks.control.patches import places_on
from tasks.control.store import prior_of
from tasks.export.source import read_source
from tasks.improve.filled import filled, levelled, old_map_on
from tasks.improve.frame import MapTurn, mean_turn_deg, turn_between, turn_to_features, turned_back
from tasks.improve.map_patches import GroundMap
from tasks.improve.map_ties import ground_from, map_ties
from tasks.improve.settings import ImproveSettings
from tasks.improve.sums import Projector, Sums
from tasks.joint.parameters import State, difference
from tasks.mosaic.grid import MosaicGrid, mosaic_grid
from tasks.mosaic.model import Model, solve_model
from tasks.mosaic.samples import samples_of
from tasks.mosaic.settings import pixel_size_km
from tasks.mosaic.view import View, load_view, mixture_notes
from tasks.photometry.region import each_taken, refuse_empty, refuse_several, unreadable_products, usable_products
from tasks.project.uncertainty import ATTITUDE, PoseUncertainty

Array = NDArray[np.float64]
Image = NDArray[np.float32]
FEWEST_USED = 12  # places that an image must show to be moved by them
FRAME_SETTLED_DEG = 0.002  # a smaller turn of all images together is left


@dataclass(frozen=True)
class Fit:
    """What an image's pose rests on: covariance (7, 7) of its unknowns; places of the map that were found in the image,
    and that were used; RMS of the latter, px."""

    covariance: Array
    places: int
    used: int
    rms_px: float


@dataclass(frozen=True)
class Member:
    """An image of the store. before, prior: its published pose and covariance (7, 7), without how the old map lies in
    the body's frame, which all images share; predicted: by the metadata. pose: as it is now. fit: the last one; None
    where too few places of the map were found in the image."""

    folder: Path
    before: Pose
    predicted: Pose
    prior: Array
    pose: Pose
    fit: Fit | None = None

    @property
    def product(self) -> str:
        """Its name."""
        return self.folder.name

    @property
    def covariance(self) -> Array:
        """Of the pose as it is now (7, 7)."""
        return self.fit.covariance if self.fit else self.prior


class Views(Sequence[View]):
    """The images of members with their poses as they are now; the last few are kept in memory."""

    def __init__(self, members: Sequence[Member]) -> None:
        self.members = members

    def __len__(self) -> int:
        return len(self.members)

    @overload
    def __getitem__(self, number: int) -> View: ...
    @overload
    def __getitem__(self, number: slice) -> "Views": ...
    def __getitem__(self, number: int | slice) -> "View | Views":
        if isinstance(number, slice):
            return Views(self.members[number])
        member = self.members[number]
        return replace(load_view(member.folder), pose=member.pose)


@dataclass(frozen=True)
class Improved:
    """members: with their poses at the end; sums: the mosaic of them; values (rows, columns): the new base map; old:
    the old one on its grid, levelled; turn: between the two; moves: of each round, median over the images, in sigmas;
    left_out: products that could not be read, and why."""

    target: Target
    old_map: BaseMap
    grid: MosaicGrid
    settings: ImproveSettings
    members: tuple[Member, ...]
    model: Model
    sums: Sums
    values: Image
    turn: MapTurn
    moves: tuple[float, ...]
    left_out: tuple[tuple[str, str], ...]

    @property
    def settled(self) -> bool:
        """Whether the iteration came to rest."""
        return bool(self.moves and self.moves[-1] < self.settings.still)


def improve_map(
    store: Path,
    old_map_of: Callable[[Target], BaseMap],
    settings: ImproveSettings,
    say: Callable[[str], None] = lambda _: None,
) -> Improved:
    """Make a base map of the images of `store` and correct their poses against it, in turn. An image is always compared
    with the map that the others make, so that it does not confirm itself. old_map_of: the old base map of the store's
    body. Raises RefusedError where no image can be
    used or they show several bodies, FailedError where old and new map have too little in common to hold the frame."""
    members, target, left_out = read_members(store, settings)
    for note in mixture_notes((view.filter, view.basemap) for view in Views(members)):
        say(note)
    old_map = old_map_of(target)
    say(f"{len(members)} images")
    grid = mosaic_grid("equirectangular", target, pixel_size_km(settings.mosaic.resolution, target), (0.0, 0.0), None)
    model = solve_model(samples_of(Views(members), settings.mosaic), settings.mosaic)
    projector = Projector(grid, model, settings.mosaic)
    old = ground_of(old_map, target, grid)
    moves: list[float] = []
    while True:
        sums = projector.summed(Views(members))
        back, turn = frame_turn(members, ground_from(sums, grid), old, target, settings)
        if len(moves) >= settings.rounds or (moves and moves[-1] < settings.still):
            break
        moved = registered(members, projector, sums, target, settings)
        moves.append(median_move(members, moved))
        members = [turned(member, back) for member in moved]
        projector = projector.expecting(sums.reflectance)
        say(f"round {len(moves)}: orientations moved by {moves[-1]:.2f} of their sigma (median)")
    if np.abs(back).max() > FRAME_SETTLED_DEG:
        members = [turned(member, back) for member in members]
        sums = projector.summed(Views(members))
        turn = frame_turn(members, ground_from(sums, grid), old, target, settings)[1]
    old_values = levelled(old_map_on(grid, old_map), sums.reflectance, grid.latitude())
    values = filled(sums, old_values, settings.old_weight)
    return Improved(
        target, old_map, grid, settings, tuple(members), model, sums, values, turn, tuple(moves), left_out
    )  # fmt: skip


def read_members(store: Path, settings: ImproveSettings) -> tuple[list[Member], Target, tuple[tuple[str, str], ...]]:
    """The usable images of a store, their body, and products that could not be read with the reasons."""
    folders, broken = usable_products(store, settings.mosaic.doubtful), unreadable_products(store)
    members: list[Member] = []
    targets: dict[str, Target] = {}
    left_out = list(broken)

    def take(folder: Path) -> None:
        source = read_source(folder)
        refuse_empty(source)
        predicted = Pose.from_dict(json.loads(source.attributes["pose_before"]))
        prior = own_prior(json.loads(source.attributes["uncertainty"]), settings)
        targets[source.target.name] = source.target
        members.append(Member(folder, source.pose, predicted, prior, source.pose))

    left_out += each_taken(folders, take)
    refuse_several(targets)
    if len(members) < 2:
        fault = f"{store} has {len(members)} images that can be used; a map against which one is compared needs others."
        raise RefusedError(Reason.NO_USABLE_IMAGE, fault, "Look at `planetpose index`.")
    return members, next(iter(targets.values())), tuple(left_out)


def own_prior(uncertainty: dict, settings: ImproveSettings) -> Array:
    """Covariance (7, 7) of a published pose without how the old map lies in the body's frame: all images share that,
    and the frame is held by other means. Of an orientation at least `least_attitude_deg` about each axis."""
    covariance = prior_of(uncertainty, settings.patches)
    frame = PoseUncertainty.from_dict(uncertainty).map_frame_deg if "covariance" in uncertainty else 0.0
    of_attitude = covariance[ATTITUDE, ATTITUDE] - frame**2 * np.eye(3)
    variances, axes = np.linalg.eigh(of_attitude)
    least = max(settings.patches.least_attitude_deg, 1e-4)
    covariance[ATTITUDE, ATTITUDE] = (axes * np.maximum(variances, least**2)) @ axes.T
    return covariance


def ground_of(basemap: BaseMap, target: Target, grid: MosaicGrid) -> GroundMap:
    """A base map as the ground of patches, no coarser than `grid`."""
    pixel_km = float(np.radians(360 / basemap.albedo.shape[1]) * target.mean_radius_km)
    positive = np.maximum(basemap.albedo, 1e-3 * float(basemap.albedo.mean())).astype(np.float32)
    resolution = np.full((2, 4), pixel_km, np.float32)
    return GroundMap(positive, resolution, basemap.left_edge_deg, max(pixel_km, grid.pixel_km))


def registered(
    members: Sequence[Member], projector: Projector, sums: Sums, target: Target, settings: ImproveSettings
) -> list[Member]:
    """The members with poses that are adjusted together to where they show the map's places."""
    views = Views(members)
    ties = map_ties(views, projector, sums, places_on(target, settings.patches.points), settings.patches)
    cameras = [load_view(member.folder).camera for member in members]
    priors = np.array([member.prior for member in members])
    bundle = adjust_bundle([member.before for member in members], cameras, target, ties, priors, settings.patches)
    found = []
    for number, member in enumerate(members):
        mine = ties.image == number
        used = mine & bundle.used
        rms = float(np.sqrt((bundle.residual_px[used] ** 2).sum(axis=1).mean())) if used.any() else 0.0
        fit = Fit(bundle.covariance[number], int(mine.sum()), int(used.sum()), rms)
        enough = fit.used >= FEWEST_USED
        found.append(replace(member, pose=bundle.poses[number], fit=fit) if enough else replace(member, fit=None))
    return found


def frame_turn(
    members: Sequence[Member], new: GroundMap, old: GroundMap, target: Target, settings: ImproveSettings
) -> tuple[Array, MapTurn]:
    """By how much (3,) the map of the members is turned in the frame, and its turn against the old map."""
    turn = turn_between(new, old, target, settings.patches)
    back = turn.turn_deg.copy()
    if settings.hold_frame == "rotation":
        back = mean_turn_deg([member.pose for member in members], [member.predicted for member in members])
    elif settings.hold_frame == "feature":
        back[2] = turn_to_features(new, old, target, settings.features, settings.patches)
    return back, turn


def turned(member: Member, turn_deg: Array) -> Member:
    """The member in coordinates turned back by `turn_deg`; what is known of it beforehand with it."""
    return replace(member, pose=turned_back(member.pose, turn_deg), before=turned_back(member.before, turn_deg))


def median_move(before: Sequence[Member], after: Sequence[Member]) -> float:
    """How far orientations moved, in their sigmas: median over images and axes."""
    moves = [
        np.abs(difference(State(new.pose, 1.0), State(old.pose, 1.0), load_view(new.folder).camera)[ATTITUDE])
        / np.sqrt(np.diag(new.covariance)[ATTITUDE])
        for old, new in zip(before, after, strict=True)
        if new.fit
    ]
    return float(np.median(moves)) if moves else 0.0
