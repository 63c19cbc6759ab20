"""Mosaic, control, better maps and photometry of stores in which something is wrong: the rest is used, or the command
says what is missing."""

import json
import shutil

import pytest

from catalog.basemap import map_of_target
from catalog.errors import PlanetposeError
from lab.maps.albedo import blotches
from lab.simulate.albedo_store import paper_views, write_albedo_store
from tasks.control.settings import ControlSettings
from tasks.control.store import control_store
from tasks.improve.improve import improve_map, read_members
from tasks.improve.settings import ImproveSettings
from tasks.mosaic.build import build_mosaic
from tasks.mosaic.settings import MosaicSettings
from tasks.mosaic.view import load_view, mixture_notes
from tasks.photometry.regions import PhotometrySettings
from tasks.photometry.store import fit_store

PRODUCTS = (
    "C1630453", "C1632318", "C2053031", "C2056420", "C2058607", "LOR_0034732619", "LOR_0034849319", "LOR_0035025959",
)  # fmt: skip
COARSE = MosaicSettings(law="lunar-lambert", resolution="0.5ppd")


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sound") / "store"
    write_albedo_store(folder, paper_views(PRODUCTS), blotches(), noise=0.004, subpixels_across=200)
    return folder


@pytest.fixture
def store(sound, tmp_path):
    load_view.cache_clear()
    shutil.copytree(sound, tmp_path / "store")
    yield tmp_path / "store"
    load_view.cache_clear()


def mosaic(store, say=lambda text: None):
    return build_mosaic(store, store.parent / "map.zarr", COARSE, say)


def control(store, say=lambda text: None):
    return control_store(store, ControlSettings(points=300), say)


def better_map(store, say=lambda text: None):
    return improve_map(store, map_of_target, ImproveSettings(mosaic=COARSE, rounds=0, hold_frame="rotation"), say)


def photometry(store):
    return fit_store(store, PhotometrySettings(law="lambert"))[0]


def left_out_by_each(store) -> dict[str, dict[str, str]]:
    """Names and reasons of what each command leaves out."""
    members, _, improved = read_members(store, ImproveSettings(mosaic=COARSE))
    assert members
    return {
        "mosaic": dict(mosaic(store).left_out),
        "control": dict(control(store).left_out),
        "improve-map": dict(improved),
        "photometry": dict(photometry(store).left_out),
    }


def changed_attributes(product, **edits) -> None:
    """Write JSON attributes of a cube anew, each by the function it is given."""
    path = product / "cube.zarr" / "zarr.json"
    content = json.loads(path.read_text())
    for name, edit in edits.items():
        value = json.loads(content["attributes"][name])
        edit(value)
        content["attributes"][name] = json.dumps(value)
    path.write_text(json.dumps(content))


def chunk_of(product, plane: str):
    return next(path for path in (product / "cube.zarr" / plane / "c").rglob("*") if path.is_file())


def test_damaged_products_are_left_out_with_what_is_wrong_and_the_others_used(store) -> None:
    (store / "C1630453" / "cube.zarr" / "zarr.json").write_text("{")
    chunk_of(store / "C1632318", "latitude").unlink()
    shutil.rmtree(store / "C2056420" / "cube.zarr")
    expected = {
        "C1630453": "cannot be read (JSONDecodeError",
        "C1632318": "the plane latitude",
        "C2056420": "holds no cube.zarr",
    }
    for command, found in left_out_by_each(store).items():
        assert found.keys() == expected.keys(), command
        for product, said in expected.items():
            assert said in found[product], (command, found[product])
            assert product in found[product]
            assert found[product].endswith(("publish it again.", "Publish it again."))


def test_a_chunk_that_does_not_decompress_is_damage_of_its_product(store) -> None:
    chunk = chunk_of(store / "C1632318", "image")
    chunk.write_bytes(chunk.read_bytes()[:100])
    for command, found in left_out_by_each(store).items():
        assert list(found) == ["C1632318"], command
        assert "planetpose check" in found["C1632318"]


@pytest.mark.parametrize("command", [mosaic, control, better_map])
def test_images_of_two_bodies_are_refused_with_both_names(store, command) -> None:
    changed_attributes(store / "C1630453", target_model=lambda target: target.update(name="ganymede"))
    with pytest.raises(PlanetposeError, match="europa and ganymede"):
        command(store)
    assert "europa and ganymede" in photometry(store).reason


@pytest.mark.parametrize("command", [mosaic, control, better_map])
def test_several_filters_and_base_maps_are_named(store, command) -> None:
    for product in PRODUCTS[:2]:
        changed_attributes(
            store / product,
            provenance=lambda given: given.update(image={"filter": "GREEN"}, basemap={"name": "other"}),
        )
    said: list[str] = []
    command(store, said.append)
    assert any("several filters (GREEN 2, clear 6)" in text for text in said)
    assert any("several base maps (other 2, uniform 6)" in text for text in said)


def test_images_of_one_kind_and_filters_with_maps_of_their_own_need_no_note() -> None:
    assert mixture_notes([("clear", "a")] * 3) == []
    assert mixture_notes([("clear", "a"), ("GREEN", "a")], filters_apart=True) == []
    assert len(mixture_notes([("clear", "a"), ("GREEN", "b")])) == 2


@pytest.mark.parametrize("command", [mosaic, control, better_map, photometry])
def test_a_store_of_doubtful_images_or_none_says_so(store, command) -> None:
    for product in PRODUCTS:
        path = store / product / "result.json"
        path.write_text(json.dumps({**json.loads(path.read_text()), "status": "doubtful"}))
    (store / "index.parquet").unlink(missing_ok=True)
    with pytest.raises(PlanetposeError, match="8 doubtful") as error:
        command(store)
    assert "--doubtful" in error.value.remedy
    empty = store.parent / "empty"
    empty.mkdir()
    with pytest.raises(PlanetposeError, match="no image whose geometry is ok"):
        command(empty)


def test_a_single_image_makes_a_mosaic_by_the_usual_law_and_no_network(store) -> None:
    for product in PRODUCTS[1:]:
        shutil.rmtree(store / product)
    model = mosaic(store).models["all"]
    assert model.sigma == {}  # nothing of the law is known where one image shows each piece of ground
    assert 0.3 < model.values["limb_weight"] < 0.9
    for command in (control, better_map):
        with pytest.raises(PlanetposeError, match="1 images"):
            command(store)
