"""`planetpose photometry`, `report` and `show` as a user types them."""

import csv
import json
import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from flows.cli import build_app
from tasks.publish.checksums import checksum_faults

RUN = CliRunner()
SELECTED = (
    "--latitude",
    "-50",
    "50",
    "--longitude",
    "0",
    "360",
    "--max-incidence-deg",
    "70",
    "--max-emission-deg",
    "70",
)


@pytest.fixture
def capture(monkeypatch):
    """Commands answer on the real stdout; here the runner's is as good."""
    import contextlib
    import sys

    monkeypatch.setattr("flows.cli.output.clean_stdout", lambda: contextlib.nullcontext(sys.stdout))


def test_one_region_gives_json_tables_and_a_figure(lunar_lambert_store, tmp_path, capture) -> None:
    command = ["photometry", str(lunar_lambert_store), *SELECTED, "--hold", "mag_per_deg=0.012", "--json"]
    done = RUN.invoke(build_app(), [*command, "--out", str(tmp_path)])
    assert done.exit_code == 0, done.output
    region = json.loads(done.stdout)
    assert json.loads((tmp_path / "photometry.json").read_text()) == [region]
    found = {each["name"]: each for each in region["parameters"]}
    assert found["mag_per_deg"] | {"meaning": ""} == {
        "name": "mag_per_deg", "value": 0.012, "sigma": None, "unit": "mag/deg", "how": "held", "meaning": "",
    }  # fmt: skip
    assert abs(found["limb_weight"]["value"] - 0.75) < 3 * found["limb_weight"]["sigma"]
    assert [each["product"] for each in region["images"]] == [f"PHASE_{p:05.1f}" for p in (12, 40, 70, 100)]
    with (tmp_path / "images.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["factor"]) for row in rows] == [each["factor"] for each in region["images"]]
    assert (tmp_path / "region.png").read_bytes().startswith(b"\x89PNG")


def test_images_of_each_filter_or_camera_are_fitted_apart(lunar_lambert_store, tmp_path, capture) -> None:
    store = tmp_path / "store"
    shutil.copytree(lunar_lambert_store, store)
    changed = store / "PHASE_040.0" / "cube.zarr" / "zarr.json"
    content = json.loads(changed.read_text())
    provenance = json.loads(content["attributes"]["provenance"])
    provenance["image"]["filter"] = "GREEN"
    content["attributes"]["provenance"] = json.dumps(provenance)
    changed.write_text(json.dumps(content))
    command = ["photometry", str(store), *SELECTED, "--law", "lambert", "--json", "--out", str(tmp_path / "out")]
    done = RUN.invoke(build_app(), [*command, "--bands", "filter"])
    fits = {region["region"]: region for region in map(json.loads, done.stdout.splitlines())}
    assert len(fits) == 2
    assert [each["product"] for each in fits["region (GREEN)"]["images"]] == ["PHASE_040.0"]
    assert all(
        each["product"] != "PHASE_040.0" for name in fits.keys() - {"region (GREEN)"} for each in fits[name]["images"]
    )
    assert len(list((tmp_path / "out").glob("*.png"))) == 2
    assert RUN.invoke(build_app(), [*command, "--bands", "colour"]).exit_code == 2


def test_regions_of_a_file_are_fitted_one_by_one_and_an_unseen_one_says_so(
    lunar_lambert_store, tmp_path, capture
) -> None:
    regions = tmp_path / "regions.csv"
    regions.write_text("region,south,north,west,east\nequator,-30,30,0,360\npole,89.9,90,0,360\n")
    command = ["photometry", str(lunar_lambert_store), "--regions", str(regions), "--json", "--out", str(tmp_path)]
    done = RUN.invoke(build_app(), command)
    assert done.exit_code == 1
    equator, pole = (json.loads(line) for line in done.stdout.splitlines())
    assert (equator["status"], pole["status"]) == ("ok", "failed")
    assert "region-unseen" in pole["reason"]


def test_polygons_of_a_file_are_fitted_and_written_in_east_longitudes(lunar_lambert_store, tmp_path, capture) -> None:
    frame = [[-180, -40], [180, -40], [180, 40], [-180, 40], [-180, -40]]
    hole = [[lon, -10] for lon in (-170, -50, 50, 170)] + [[lon, 10] for lon in (170, 50, -50, -170)] + [[-170, -10]]
    features = [
        {"type": "Feature", "properties": {"name": name}, "geometry": {"type": "Polygon", "coordinates": rings}}
        for name, rings in (("whole", [frame]), ("ring", [frame, hole]))
    ]
    path = tmp_path / "areas.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    command = ["photometry", str(lunar_lambert_store), "--regions", str(path), "--json", "--law", "lambert"]
    answers = {}
    for option in ([], ["--west-longitudes"]):
        done = RUN.invoke(build_app(), [*command, *option, "--out", str(tmp_path / "out")])
        assert done.exit_code == 0, done.output
        answers[bool(option)] = [json.loads(line) for line in done.stdout.splitlines()]
    whole, ring = answers[False]
    assert whole["longitude_deg"] == [0.0, 360.0]
    assert ring["outline"]["coordinates"][0][1][0] == [-170.0, -10.0]
    assert answers[True][1]["outline"]["coordinates"][0][1][0] == [170.0, -10.0]
    seen = [{each["product"]: each["pixels_seen"] for each in region["images"]} for region in (whole, ring)]
    assert all(0.3 * seen[0][product] < seen[1][product] < 0.95 * seen[0][product] for product in seen[0])


@pytest.mark.parametrize("wrong", [("--law", "oren-nayar"), ("--hold", "w"), ("--latitude", "north", "south")])
def test_wrong_usage_is_reported(lunar_lambert_store, wrong) -> None:
    assert RUN.invoke(build_app(), ["photometry", str(lunar_lambert_store), *wrong]).exit_code == 2


def test_a_file_that_lists_no_regions_is_refused(lunar_lambert_store, tmp_path) -> None:
    regions = tmp_path / "regions.csv"
    regions.write_text("name\nequator\n")
    done = RUN.invoke(build_app(), ["photometry", str(lunar_lambert_store), "--regions", str(regions)])
    assert done.exit_code != 0
    assert "south, north, west, east" in str(done.exception)


def test_show_draws_planes_and_leaves_the_product_sound(lunar_lambert_store, tmp_path) -> None:
    folder = tmp_path / "PHASE_070.0"
    shutil.copytree(lunar_lambert_store / folder.name, folder)
    done = RUN.invoke(build_app(), ["show", str(folder), "--planes", "--no-open"])
    assert done.exit_code == 0, done.output
    assert [Path(line).name for line in done.stdout.splitlines()] == ["planes.png"]
    assert checksum_faults(folder) == []


def test_an_unknown_picture_is_wrong_usage(lunar_lambert_store) -> None:
    assert RUN.invoke(build_app(), ["report", str(lunar_lambert_store), "--picture", "selfie"]).exit_code == 2
