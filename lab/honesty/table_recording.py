"""Scenes whose pictures were spoiled on their way into the file, or whose camera, body or time is wrong by a little."""

from collections.abc import Iterator

from lab.honesty.table_surfaces import UNMAPPED, Draw, Fields, group, usual

# How strong each fault is, two or more strengths of each.
STRENGTHS: dict[str, tuple[float, ...]] = {
    "zero-filled": (0.0, -0.5, 0.3),
    "few-levels": (6, 5, 4),
    "blocks": (0.002, 0.006, 0.015),
    "stray-light": (0.05, 0.2, 0.5),
    "halo": (0.1, 0.25),
    "ghost": (0.02, 0.06, 0.15),
    "bright-columns": (0.01, 0.05),
    "line-jitter": (0.3, 0.8, 1.5),
    "cosmic-rays": (2e-4, 2e-3),
    "dropped-lines": (0.05, 0.2),
    "lines-left-out": (1, 3),
    "knee": (0.8, 0.5),
    "clipped": (0.9, 0.7, 0.4),
    "two-gains": (0.03, 0.1, 0.3),
    "sharpened": (0.5, 1.5),
    "stretched": (0.005, 0.01, 0.03),
    "wrapped": (0.9, 0.6),
}


@group
def recording(random: Draw) -> Iterator[Fields]:
    """Each fault of the way into the file at each strength, on a mapped body and on one without a map."""
    place = 0
    for name, strengths in STRENGTHS.items():
        for strength in strengths:
            for mapped in (True, False) if strength == strengths[-1] else (True,):
                fields = usual(random, place, fault=name, fault_size=float(strength))
                if not mapped:
                    fields |= {"target": UNMAPPED[place % 6], "surface": "procedural", "given": "none"}
                    fields |= {"metadata": "good"}
                yield fields
                place += 1


@group
def wrong_shape(random: Draw) -> Iterator[Fields]:
    """A body file whose radii are wrong: one axis, or all of them where the range is known."""
    for place, factors in enumerate(
        ((1.0, 1.0, 0.98), (1.0, 1.0, 0.96), (1.02, 1.0, 1.0), (1.0, 1.0, 1.01), (0.97, 1.0, 1.02), (1.0, 1.0, 0.99))
    ):
        unmapped: Fields = {"target": UNMAPPED[place % 6], "surface": "procedural", "given": "none"}
        yield usual(random, place, radii=factors, metadata="good", **(unmapped if place % 2 else {}))
    for place, factor in enumerate((0.98, 1.02)):
        yield usual(random, place, radii=(factor, factor, factor), metadata="good")


@group
def wrong_scale(random: Draw) -> Iterator[Fields]:
    """A focal length wrong by 1 %, and a summing mode that is not the file's, where the range is known."""
    for place, error in enumerate((0.01, -0.01, 0.01, 1.0, -0.5)):
        yield usual(random, place, focal_error=error, metadata="good")


@group
def wrong_time(random: Draw) -> Iterator[Fields]:
    """A time wrong by minutes to hours: the body turned about its pole, within and beyond what is expected."""
    for place, angle in enumerate((0.7, 3.0, 7.0, 15.0, -15.0, 25.0)):
        yield usual(random, place, late_deg=angle)


@group
def wrong_filter(random: Draw) -> Iterator[Fields]:
    """A map of another colour: markings of less or more contrast, or dark for bright."""
    for place, contrast in enumerate((0.1, 0.3, 1.8, -0.3, -1.0)):
        yield usual(random, place, map_contrast=contrast)


@group
def twice_wrong(random: Draw) -> Iterator[Fields]:
    """A mirrored or turned picture of a body whose orientation is wrong as well."""
    for place, picture in enumerate(("mirrored-x", "mirrored-y", "mirrored-x", "turned-180", "turned-90")):
        yield usual(random, place, picture=picture, orientation_deg=(20.0, 90.0, 150.0, 40.0, 90.0)[place])
