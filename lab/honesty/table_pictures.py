"""Scenes whose pictures are not as the model has them: blur, smear, frame's edge, detector, optics, other bodies."""

from collections.abc import Iterator

from lab.honesty.scene import Other
from lab.honesty.table_surfaces import Draw, Fields, group, others_of, usual


@group
def psf(random: Draw) -> Iterator[Fields]:
    """PSFs within what cameras differ by: widths, wings, Moffat profiles, unequal axes."""
    kinds: tuple[Fields, ...] = (
        {"psf_factor": 0.65},
        {"psf_factor": 1.5},
        {"wings": 0.15},
        {"wings": 0.25},
        {"moffat": 2.5},
        {"moffat": 3.5},
        {"ratio": 1.2},
        {"ratio": 1.25, "moffat": 3.0},
    )
    for place, kind in enumerate(kinds * 2):
        yield usual(random, place, **kind)


@group
def blurred(random: Draw) -> Iterator[Fields]:
    """Out of focus: Gaussian and Moffat cores of 2.5-5 px."""
    for place, width in enumerate((2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 3.0, 4.0, 5.0, 5.0)):
        yield usual(random, place, blur_px=width, moffat=3.0 if place >= 6 else None)


@group
def smeared(random: Draw) -> Iterator[Fields]:
    """Even trails of 3-7 px, symmetric about mid-exposure: the centre does not move."""
    for place, length in enumerate((3.0, 3.0, 3.0, 4.0, 4.0, 5.0, 5.0, 5.0, 6.0, 6.0, 7.0, 7.0, 7.0, 7.0)):
        yield usual(random, place, smear_px=length)


@group
def cut(random: Draw) -> Iterator[Fields]:
    """Disks that edges of the frame cut."""
    centres = ((0.06, 0.5), (0.0, 0.5), (-0.08, 0.45), (0.5, 1.02), (0.97, 0.96), (1.0, 0.5), (0.03, 0.02))
    for place, centre in enumerate(centres * 2):
        yield usual(random, place, radius_px=random.uniform(70, 170), centre=centre, phase_deg=random.uniform(15, 80))


@group
def saturated(random: Draw) -> Iterator[Fields]:
    """Exposed beyond the full well."""
    for place, exposure in enumerate((1.0, 1.1, 1.3, 1.6, 2.5, 5.0, 1.2, 2.0)):
        yield usual(random, place, exposure=exposure)


@group
def noisy(random: Draw) -> Iterator[Fields]:
    """Weak signals, and hot pixels."""
    for place, factor in enumerate((3.0, 4.0, 6.0, 10.0)):
        yield usual(random, place, noise_factor=factor, exposure=0.3)
    for place, hot in enumerate((5e-5, 1e-4, 5e-4, 2e-3)):
        yield usual(random, place, hot=hot)


@group
def detector(random: Draw) -> Iterator[Fields]:
    """Signal not proportional to light."""
    for place, gamma in enumerate((0.6, 0.7, 0.8, 0.9, 1.1, 1.2, 1.3, 1.4)):
        yield usual(random, place, gamma=gamma, radius_px=random.uniform(60, 130))


@group
def distorted(random: Draw) -> Iterator[Fields]:
    """Optics that bend by 0.3 px (RMS over the disk), which the camera file does not say."""
    for place in range(8):
        yield usual(random, place, distortion_px=0.3, radius_px=random.uniform(60, 140))


@group
def focal_length(random: Draw) -> Iterator[Fields]:
    """A focal length wrong by 0.2 %."""
    for place, error in enumerate((0.002, -0.002, 0.002, -0.002, 0.001, -0.001)):
        yield usual(random, place, focal_error=error, radius_px=random.uniform(110, 220))


@group
def relief(random: Draw) -> Iterator[Fields]:
    """Bodies whose smooth relief (RMS over the radius) is not in the file of the target."""
    for place, height in enumerate((0.01, 0.01, 0.02, 0.02, 0.03, 0.03, 0.05, 0.05, 0.07, 0.07, 0.1, 0.1)):
        unmapped: Fields = {"target": "mimas", "surface": "procedural", "given": "none"}
        yield usual(random, place, radius_px=random.uniform(40, 110), relief=height, **(unmapped if place % 2 else {}))


@group
def other_bodies(random: Draw) -> Iterator[Fields]:
    """Another body in front, behind, at the limb, or elsewhere in the frame."""
    bodies = (
        Other("front", 0.12, 0.5, 40.0, 0.5),
        Other("front", 0.3, 0.3, 200.0, 1.5),
        Other("front", 0.3, 1.0, 120.0),
        Other("front", 0.6, 1.2, 310.0),
        Other("behind", 0.5, 1.1, 75.0),
        Other("behind", 1.5, 1.6, 160.0, 0.7),
        Other("behind", 6.0, 5.0, 20.0, 0.6),
        Other("behind", 6.0, 0.5, 250.0, 0.5),
        Other("beside", 0.3, 1.35, 100.0),
        Other("beside", 0.5, 1.6, 220.0),
        Other("beside", 0.2, 2.5, 300.0),
        Other("beside", 0.8, 3.0, 15.0),
        Other("beside", 0.9, 2.4, 135.0, 2.0),
        Other("behind", 1.0, 1.9, 65.0, 1.5),
    )
    for place, other in enumerate(bodies):
        yield usual(random, place, radius_px=random.uniform(45, 80), frame_px=640, **others_of(other))


@group
def shadows(random: Draw) -> Iterator[Fields]:
    """Another body's shadow on the disk."""
    kinds = ((0.15, 0.3), (0.3, 0.2), (0.3, 0.8), (0.6, 0.9), (0.6, 0.3), (0.9, 1.0), (0.4, 1.1), (0.8, 1.3))
    for place, (size, apart) in enumerate(kinds):
        other = Other("shadow", size, apart, random.uniform(0, 360))
        yield usual(random, place, phase_deg=random.uniform(25, 80), **others_of(other))
