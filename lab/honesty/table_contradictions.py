"""Scenes whose metadata or maps contradict their pictures."""

from collections.abc import Iterator

from lab.honesty.table_surfaces import UNMAPPED, Draw, Fields, group, usual

ANGLES_DEG = (0.5, 1.0, 2.0, 4.0, 8.0, 12.0, 20.0, 30.0, 45.0, 60.0, 90.0, 135.0, 180.0)


@group
def wrong_orientation(random: Draw) -> Iterator[Fields]:
    """The body turned by 0.5-180 deg, on small disks, usual ones and crescents."""
    place = 0
    for radius, phase in ((35.0, 35.0), (55.0, 65.0), (100.0, 40.0), (90.0, 115.0)):
        for angle in ANGLES_DEG[place % 2 :: 1 if radius < 60 else 2]:
            yield usual(
                random,
                place,
                radius_px=radius * random.uniform(0.8, 1.1),
                phase_deg=phase + random.uniform(-10, 10),
                orientation_deg=angle,
            )
            place += 1


@group
def held(random: Draw) -> Iterator[Fields]:
    """The same, with the attitude held."""
    for place, angle in enumerate((1.0, 30.0, 90.0, 180.0)):
        yield usual(random, place, orientation_deg=angle, hold=("attitude",))


@group
def wrong_sun(random: Draw) -> Iterator[Fields]:
    """The Sun of the metadata elsewhere than the picture's, on mapped bodies and others."""
    for place, angle in enumerate((10.0, 20.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 50.0, 55.0, 60.0, 65.0)):
        unmapped: Fields = {"target": UNMAPPED[place % 6], "surface": "procedural", "given": "none"}
        yield usual(random, place, sun_off_deg=angle, **(unmapped if place % 3 == 2 else {}))


@group
def wrong_target(random: Draw) -> Iterator[Fields]:
    """Another body's picture; of most the metadata give a range at which the disk has the seen size."""
    pairs = [(target, "europa") for target in UNMAPPED]
    pairs += [("ganymede", "europa"), ("io", "europa"), ("europa", "io"), ("callisto", "ganymede"), ("mimas", "tethys")]
    pairs += [
        ("tethys", "rhea"),
        ("enceladus", "europa"),
        ("iapetus", "triton"),
        ("tethys", "europa"),
        ("io", "europa"),
    ]
    for place, (target, reported) in enumerate(pairs):
        surface = "map" if target in ("ganymede", "io", "europa", "callisto", "enceladus") else "procedural"
        fields = usual(random, place, reported=reported, surface=surface, given="map", same_range=place >= 14)
        yield fields | {"target": target, "radius_px": random.uniform(30, 100)}


@group
def mirrored(random: Draw) -> Iterator[Fields]:
    """Pictures read in the wrong order: mirrored, upside down, turned."""
    for place, radius in enumerate((20.0, 30.0, 45.0, 60.0, 90.0, 130.0)):
        for number, picture in enumerate(("mirrored-x", "mirrored-y", "turned-90", "turned-180")):
            if (place + number) % 4 != 3:
                yield usual(random, place + number, radius_px=radius, picture=picture, phase_deg=random.uniform(15, 75))


@group
def wrong_map(random: Draw) -> Iterator[Fields]:
    """Another body's map, one with none of the true markings, clouds over the true ones, and a coarse one."""
    for place, given in enumerate(("Io.jpg", "Ganymede.jpg", "Mars.jpg", "Moon.jpg", "Callisto.jpg", "Earth.jpg")):
        yield usual(random, place, target="europa", given=given, radius_px=random.uniform(30, 100))
    for place in range(4):
        fields: Fields = {"target": "triton", "surface": "shuffled", "given": "procedural"}
        yield usual(random, place, radius_px=random.uniform(20, 60), **fields)
    for place, noise in enumerate((0.12, 0.2, 0.3, 0.4, 0.3, 0.2)):
        yield usual(random, place, map_noise=noise, radius_px=random.uniform(25, 90))
