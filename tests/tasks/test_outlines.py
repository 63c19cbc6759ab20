"""Regions of GeoJSON files: what is inside, whatever the meridian, the direction of longitudes, holes and poles."""

import json
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from catalog.errors import RefusedError
from tasks.export.outlines import read_outlines
from tasks.export.pixels import Selection
from tasks.photometry.regions import read_regions


def square(west: float, south: float, east: float, north: float) -> list[list[float]]:
    return [[west, south], [east, south], [east, north], [west, north], [west, south]]


def feature(name: str | None, kind: str, coordinates) -> dict:
    properties = {} if name is None else {"region": name}
    return {
        "type": "Feature",
        "properties": properties,
        "geometry": {"type": kind, "coordinates": coordinates},
    }


def written(tmp_path, *features, name="regions.geojson"):
    path = tmp_path / name
    path.write_text(json.dumps({"type": "FeatureCollection", "features": list(features)}))
    return path


def only(path, **options):
    ((_, outline),) = read_outlines(path, **options)
    return outline


# Ways to write the square from 350 to 10 degrees east.
CROSSING = (
    square(350, -5, 10, 5),
    square(-10, -5, 10, 5),
    square(350, -5, 370, 5),
    [[10, 5], [350, 5], [350, -5], [10, -5], [10, 5]],
)


@pytest.mark.parametrize("ring", CROSSING)
def test_a_region_may_cross_the_meridian_however_it_is_written(tmp_path, ring) -> None:
    outline = only(written(tmp_path, feature("a", "Polygon", [ring])))
    longitude = np.array([351.0, 359.9, 0.1, 9.0, 11.0, 349.0, 180.0, np.nan])
    inside = outline.contains(np.zeros(8), longitude)
    assert inside.tolist() == [True, True, True, True, False, False, False, False]
    assert not outline.contains(np.array([6.0, -6.0]), np.zeros(2)).any()
    assert outline.box_deg() == ((-5.0, 5.0), (350.0, 10.0))


def test_west_longitudes_are_turned(tmp_path) -> None:
    path = written(tmp_path, feature("a", "Polygon", [square(100, 0, 60, 10)]))
    outline = only(path, west_longitudes=True)
    assert outline.contains(np.full(3, 5.0), np.array([280.0, 80.0, 259.0])).tolist() == [True, False, False]
    assert outline.box_deg() == ((0.0, 10.0), (260.0, 300.0))
    table = tmp_path / "regions.csv"
    table.write_text("region,south,north,west,east\na,0,10,100,60\nall,-90,90,360,0\n")
    boxes = dict(read_regions(table, Selection(), west_longitudes=True))
    assert boxes["a"].longitude_deg == (260.0, 300.0)
    assert abs(np.subtract(*boxes["all"].longitude_deg)) == 360


def test_holes_and_several_polygons(tmp_path) -> None:
    ring = [square(0, -20, 40, 20), square(10, -10, 30, 10)]
    outline = only(written(tmp_path, feature("a", "MultiPolygon", [ring, [square(100, 0, 110, 10)]])))
    latitude, longitude = np.array([15.0, 0.0, 0.0, 5.0, 5.0]), np.array([20.0, 20.0, 5.0, 105.0, 50.0])
    assert outline.contains(latitude, longitude).tolist() == [True, False, True, True, False]
    assert outline.box_deg() == ((-20.0, 20.0), (0.0, 360.0))


@pytest.mark.parametrize("sign", [1, -1])
def test_a_ring_round_the_body_encloses_its_pole(tmp_path, sign) -> None:
    cap = [[lon, 60 * sign] for lon in (0, 90, 180, 270, 360)]
    core = [[lon, 80 * sign] for lon in (0, 90, 180, 270, 0)]
    outline = only(written(tmp_path, feature("cap", "Polygon", [cap, core])))
    latitude = sign * np.array([61.0, 59.0, 79.0, 81.0, 90.0, -70.0])
    for longitude in (0.0, 45.0, 359.0):
        assert outline.contains(latitude, np.full(6, longitude)).tolist() == [True, False, True, False, False, False]


def test_an_edge_that_hardly_rises_is_crossed_without_a_division(tmp_path) -> None:
    outline = only(written(tmp_path, feature("a", "Polygon", [[[0, 0], [0, 1], [2, 2e-309], [0, 0]]])))
    assert outline.contains(np.array([0.5, 0.5, 1e-310]), np.array([0.5, 1.5, 3.0])).tolist() == [True, False, False]


def test_a_belt_is_all_longitudes(tmp_path) -> None:
    for west, east in ((0, 360), (-180, 180)):
        outline = only(written(tmp_path, feature("belt", "Polygon", [square(west, -10, east, 10)])))
        assert outline.contains(np.zeros(5), np.array([0.0, 90.0, 180.0, 270.0, 359.0])).all()
        assert not outline.contains(np.full(3, 11.0), np.array([0.0, 90.0, 180.0])).any()


def degrees(least: float, most: float) -> st.SearchStrategy[float]:
    """Six decimals: of -1e-20 the remainder by 360 is 360, and a step from 360 to 0 is the whole circle."""
    return st.floats(least, most).map(lambda value: round(value, 6))


@given(
    st.lists(st.tuples(degrees(-25, 25), degrees(-60, 60)), min_size=3, max_size=8),
    degrees(0, 360),
    st.integers(0, 2**31),
)
def test_what_is_inside_turns_with_the_region(tmp_path_factory, corners, middle, seed) -> None:
    """Against matplotlib's points in a polygon, at any place on the circle."""
    from matplotlib.path import Path

    flat = np.array([*corners, corners[0]])
    area = abs(np.sum(flat[:-1, 0] * flat[1:, 1] - flat[1:, 0] * flat[:-1, 1])) / 2
    if area < 1:
        return
    folder = tmp_path_factory.mktemp("turned")
    ring = [[(lon + middle) % 360, lat] for lon, lat in flat.tolist()]
    ring[-1] = ring[0]
    outline = only(written(folder, feature("a", "Polygon", [ring])))
    rng = np.random.default_rng(seed)
    places = np.column_stack([rng.uniform(-60, 60, 300), rng.uniform(-70, 70, 300)])
    # matplotlib fills by winding: a ring that crosses itself differs there.
    if _crosses_itself(flat):
        return
    expected = Path(flat).contains_points(places)
    assert np.array_equal(outline.contains(places[:, 1], (places[:, 0] + middle) % 360), expected)


def _crosses_itself(ring) -> bool:
    def side(a, b, c):
        return np.sign((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))

    edges = list(pairwise(ring))
    return any(
        side(*one, two[0]) * side(*one, two[1]) <= 0 and side(*two, one[0]) * side(*two, one[1]) <= 0
        for number, one in enumerate(edges)
        for two in edges[number + 2 : len(edges) - (number == 0)]
    )


SQUARE = square(0, 0, 10, 10)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("{", "no sound JSON"),
        ("[1, 2]", "no GeoJSON"),
        ('{"type": "FeatureCollection"}', "no list"),
        ('{"type": "FeatureCollection", "features": []}', "no feature"),
        ('{"type": "FeatureCollection", "features": [3]}', "feature 1 is no Feature"),
        (json.dumps(feature("A", "Point", [1, 2])), "region A is no polygon but Point"),
        (json.dumps({"type": "Feature", "geometry": None, "id": "X"}), "region X is no polygon"),
        (json.dumps(feature("A", "Polygon", [])), "region A has a polygon without a ring"),
        (json.dumps(feature("A", "MultiPolygon", [])), "region A has no coordinates"),
        (json.dumps(feature("A", "Polygon", [SQUARE[:-1]])), "does not end where it begins"),
        (json.dumps(feature("A", "Polygon", [SQUARE[:3]])), "fewer than 4"),
        (json.dumps(feature("A", "Polygon", [[[0, 0], [1, 1], [2, 2], [0, 0]]])), "without area"),
        (json.dumps(feature("A", "Polygon", [square(0, 0, 1e5, 2e5)])), "no longitude and latitude"),
        (json.dumps(feature("A", "Polygon", [[*SQUARE[:2], ["1", 2], *SQUARE[2:]]])), "not [longitude, latitude]"),
        (json.dumps(feature("A", "Polygon", [[*SQUARE[:2], 5, *SQUARE[2:]]])), "not [longitude, latitude]"),
        (json.dumps(feature("A", "Polygon", 7)), "region A has a polygon without a ring"),
        ('{"type": "Polygon", "coordinates": [[[NaN, 0]]]}', "no finite number"),
    ],
)
def test_a_bad_file_is_refused_with_what_is_wrong(tmp_path, content, said) -> None:
    path = tmp_path / "bad.geojson"
    path.write_text(content)
    with pytest.raises(RefusedError) as error:
        read_regions(path, Selection())
    assert said in str(error.value)
    assert path.name in str(error.value)
    assert "Polygon" in error.value.remedy


def test_missing_files_names_given_twice_and_bad_limits_are_refused(tmp_path) -> None:
    twice = written(tmp_path, feature("A", "Polygon", [SQUARE]), feature("A", "Polygon", [square(20, 0, 30, 5)]))
    table = tmp_path / "regions.csv"
    for path, said in ((twice, "name A"), (tmp_path / "none.geojson", "none.geojson"), (table, "limits of region a")):
        table.write_text("region,south,north,west,east\na,10,-10,0,20\n")
        with pytest.raises(RefusedError, match=said):
            read_regions(path, Selection())
    table.write_text("region,south,north,west,east\na,-10,10,0,20\na,-10,10,0,20\n")
    with pytest.raises(RefusedError, match="name a"):
        read_regions(table, Selection())


def test_features_without_a_name_have_their_number(tmp_path) -> None:
    path = written(tmp_path, feature(None, "Polygon", [SQUARE]), feature(None, "Polygon", [square(20, 0, 30, 5)]))
    assert [name for name, _ in read_outlines(path)] == ["1", "2"]


def test_a_small_region_is_cut_into_small_patches_of_ground() -> None:
    from tasks.photometry.region import ground_patches

    rng = np.random.default_rng(2)
    for west, side, low, high in ((355.0, 10.0, 20, 50), (0.0, 60.0, 30, 40), (0.0, 3.0, 9, 20)):
        latitude, longitude = rng.uniform(0, side, 20_000), (west + rng.uniform(0, side, 20_000)) % 360
        assert low <= len(np.unique(ground_patches(latitude, longitude))) <= high, side
