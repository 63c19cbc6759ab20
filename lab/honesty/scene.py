"""One scene of the benchmark: what is rendered, what the metadata say of it, and whether it can be solved."""

from dataclasses import asdict, dataclass, field
from typing import Any

MASTER_SEED = 20261130
# What a pose file is assumed to be good for (`joint.priors.file`): errors of rough metadata are drawn from it, those
# of good metadata from less. Both are cut at so many sigmas.
RANGE_SIGMA, ATTITUDE_SIGMA_DEG, ROLL_SIGMA_DEG, CUT_SIGMAS = 0.02, 3.0, 0.1, 2.0
GOOD_RANGE_SIGMA, GOOD_ATTITUDE_SIGMA_DEG = 0.003, 0.5
# What the focal length of a camera file that does not state its error is assumed to be good for, relative
# (`focal_length_sigma`): that of every scene is off by a draw from it.
FOCAL_SIGMA = 5e-4


@dataclass(frozen=True)
class Lens:
    """A camera like one that flew: name, frame, focal length, PSF width, full well and noise in DN."""

    name: str
    size_px: int
    focal_px: float
    psf_px: float
    full_dn: float
    read_dn: float
    gain_e_per_dn: float


LENSES = {
    "lorri": Lens("lorri", 1024, 201_465.0, 0.8, 3500.0, 1.1, 22.0),
    "voyager": Lens("voyager", 1000, 127_248.0, 1.2, 255.0, 0.8, 500.0),
    "galileo": Lens("galileo", 800, 98_456.0, 0.8, 255.0, 0.7, 300.0),
    "cassini": Lens("cassini", 1024, 166_953.0, 0.55, 4000.0, 2.0, 15.0),
}


@dataclass(frozen=True)
class Other:
    """Another body. kind: `front`, `behind`, `beside` or `shadow` (out of sight, before the Sun). size: its radius
    over the target's, as seen (of a shadow: as it is). apart: distance of the two centres, in the target's radius, in
    the picture (of a shadow: across the sunlight). angle_deg: its direction in the picture. brightness: factor."""

    kind: str
    size: float
    apart: float
    angle_deg: float
    brightness: float = 1.0


@dataclass(frozen=True)
class Scene:
    """One image and its metadata; together with `seed` it says everything.

    target: what is seen; reported: what the metadata call it. lens: a key of LENSES; frame_px: side of the square frame
    (a sub-frame about the boresight where smaller than the lens's). radius_px, phase_deg: as seen. centre: the target's
    centre in the frame, as shares of its side; None draws it near the middle. law, parameters: the surface's. surface:
    `map` (the packaged map with errors), `procedural`, `shuffled` (markings of another seed), or the name of another
    packaged map. given: the estimator's map: `map`, `procedural`, `none` (uniform), or the name of a packaged map.
    map_noise, map_contrast: see `solids.with_map_errors`. orientation_deg: planted turn of the body about a random
    axis; None draws it, as range and pointing are. metadata: `good` or `rough`, what their errors are drawn from.
    sun_off_deg: how far the metadata's Sun is off. picture: `as-is`, `mirrored-x`, `mirrored-y`, `turned-90`,
    `turned-180`. exposure: peak over full well. same_range: of a wrong target: metadata with its true range. fault,
    fault_size: what spoils the picture on its way into the file (`recording.FAULTS`), and how strongly. radii: the
    body's three over those of its file. late_deg: how far a wrong time turns the body about its pole.
    """

    id: str
    group: str
    seed: int
    target: str = "europa"
    reported: str | None = None
    lens: str = "lorri"
    frame_px: int = 512
    radius_px: float = 100.0
    phase_deg: float = 60.0
    centre: tuple[float, float] | None = None
    law: str = "lommel-seeliger"
    parameters: dict[str, float] = field(default_factory=dict)
    surface: str = "map"
    given: str = "map"
    map_noise: float = 0.03
    map_contrast: float = 1.0
    psf_factor: float = 1.0
    blur_px: float | None = None
    ratio: float = 1.0
    wings: float = 0.0
    moffat: float | None = None
    smear_px: float = 0.0
    exposure: float = 0.8
    noise_factor: float = 1.0
    hot: float = 0.0
    gamma: float = 1.0
    distortion_px: float = 0.0
    focal_error: float = 0.0
    relief: float = 0.0
    metadata: str = "rough"
    orientation_deg: float | None = None
    sun_off_deg: float = 0.0
    picture: str = "as-is"
    same_range: bool = False
    hold: tuple[str, ...] = ()
    others: tuple[Other, ...] = ()
    fault: str | None = None
    fault_size: float = 0.0
    radii: tuple[float, float, float] = (1.0, 1.0, 1.0)
    late_deg: float = 0.0

    @property
    def stated_target(self) -> str:
        """What the metadata call the target."""
        return self.reported or self.target

    @property
    def is_foreign(self) -> bool:
        """Whether no corrected pose can be right: another body, or a mirror image."""
        return self.stated_target != self.target or self.picture.startswith("mirrored")

    @property
    def stated_errors(self) -> dict[str, float]:
        """1-sigma errors that the pose file states of itself: good metadata know how good their range is. One that was
        made from the picture, by the size of a disk that is another body's, has nothing to state. How good their
        orientation is they state where no map can test it."""
        is_known = self.metadata == "good" and (self.reported is None or self.same_range)
        errors = {"range_share": GOOD_RANGE_SIGMA} if is_known else {}
        untested = is_known and self.given == "none" and self.orientation_deg is None
        return errors | ({"attitude_deg": GOOD_ATTITUDE_SIGMA_DEG} if untested else {})

    @property
    def in_frame(self) -> float:
        """Share of the disk's width and height that lies in the frame, the product of both."""
        if self.centre is None:
            return min(1.0, self.frame_px / (2 * self.radius_px)) ** 2
        share = 1.0
        for place in self.centre:
            middle = place * self.frame_px
            inside = min(middle + self.radius_px, self.frame_px) - max(middle - self.radius_px, 0)
            share *= max(inside, 0.0) / (2 * self.radius_px)
        return share

    @property
    def solvable(self) -> bool:
        """Whether an estimator must say `ok`, by a rule that knows the scene but no result: a lit disk of 12 px radius
        or more, phase angle at most 130 deg, half of it in the frame, metadata within 2 sigmas of their priors,
        optics within what cameras differ by (PSF 0.6-1.6 of the nominal width, an axis ratio of 1.25, wings), a
        detector linear to 5 %, at most a fiftieth of the disk saturated, nothing lost or added on the way to the file,
        the radii of the file, the relief of a round body, a map of the body that is right to 10 % and has half to one
        and a half of the contrast, or none, and the pose file says so; no other body on the disk or at its limb."""
        metadata = (
            not self.is_foreign
            and self.picture == "as-is"
            and self.sun_off_deg <= 3
            and (self.orientation_deg is None or self.orientation_deg <= CUT_SIGMAS * ATTITUDE_SIGMA_DEG)
            and self.focal_error == 0
            and abs(self.late_deg) <= 1
            and self.radii == (1.0, 1.0, 1.0)
        )
        picture = self.radius_px >= 12 and self.phase_deg <= 130 and self.in_frame >= 0.5 and self.hot <= 1e-4
        picture = (
            picture
            and self.fault is None
            and self.exposure <= 1.02
            and self.noise_factor <= 4
            and abs(self.gamma - 1) <= 0.05
        )
        optics = self.smear_px <= 1 and self.blur_px is None and self.distortion_px <= 0.05
        optics = optics and 0.6 <= self.psf_factor <= 1.6 and self.ratio <= 1.25
        body = self.relief <= 0.003 and self.given in ("none", self.surface)
        body = body and self.map_noise <= 0.1 and 0.5 <= self.map_contrast <= 1.5
        return metadata and picture and optics and body and all(o.kind == "beside" and o.apart > 2 for o in self.others)

    @property
    def size_class(self) -> str:
        """Class of radius: `8-25`, `25-60`, `60-150`, `150-`."""
        for limit, name in ((25, "8-25"), (60, "25-60"), (150, "60-150")):
            if self.radius_px < limit:
                return name
        return "150-"

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values, those derived included."""
        return {**asdict(self), "solvable": self.solvable, "foreign": self.is_foreign, "size_class": self.size_class}
