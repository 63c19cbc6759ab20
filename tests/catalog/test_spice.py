"""Kernels: the pool is left as it was found, and what they do not cover is said in words."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from catalog.camera import find_camera
from catalog.errors import RefusedError
from catalog.pose import PartialPose
from catalog.spice import kernel_pool, list_kernels, refuse_what_holds_no_kernel
from catalog.spice_pose import pose_parts_from_loaded, pose_parts_from_spice
from catalog.target import find_target
from catalog.times import et_from_utc
from lab.simulate.europa57 import PaperImage, paper_images

spiceypy = pytest.importorskip("spiceypy")
real = pytest.mark.real

TEXT_KERNEL = "KPL/PCK\n\\begindata\nBODY999999_RADII = ( 1.0 2.0 3.0 )\n\\begintext\n"


@pytest.fixture
def pck(tmp_path: Path) -> Path:
    path = tmp_path / "toy.tpc"
    path.write_text(TEXT_KERNEL)
    return path


@pytest.fixture(autouse=True)
def empty_pool() -> Iterator[None]:
    spiceypy.kclear()
    yield
    spiceypy.kclear()


def test_kernels_are_there_inside_and_gone_outside(pck: Path) -> None:
    with kernel_pool([pck]) as kernels:
        assert spiceypy.bodfnd(999999, "RADII")
        assert [kernel.provenance()["name"] for kernel in kernels] == ["toy.tpc"]
    assert not spiceypy.bodfnd(999999, "RADII")


def test_an_error_inside_the_block_still_empties_the_pool(pck: Path) -> None:
    with pytest.raises(ZeroDivisionError), kernel_pool([pck]):
        raise ZeroDivisionError
    assert spiceypy.ktotal("ALL") == 0


def test_kernels_that_the_user_had_loaded_stay_loaded(pck: Path, tmp_path: Path) -> None:
    own = tmp_path / "own.tpc"
    own.write_text(TEXT_KERNEL.replace("999999", "888888"))
    spiceypy.furnsh(str(own))
    with kernel_pool([pck]):
        assert spiceypy.bodfnd(888888, "RADII")
    assert spiceypy.bodfnd(888888, "RADII")
    assert not spiceypy.bodfnd(999999, "RADII")


def test_a_file_that_is_no_kernel_is_refused_by_name_and_leaves_nothing(pck: Path, tmp_path: Path) -> None:
    broken = tmp_path / "broken.bsp"
    broken.write_bytes(b"\0" * 4096)
    with pytest.raises(RefusedError, match=r"broken\.bsp"), kernel_pool([pck, broken]):
        pass
    assert spiceypy.ktotal("ALL") == 0


def test_a_path_that_does_not_exist_is_refused() -> None:
    with pytest.raises(RefusedError, match=r"nowhere\.bsp does not exist"), kernel_pool([Path("nowhere.bsp")]):
        pass


def test_folders_are_furnished_by_type_and_name_and_meta_kernels_last(pck: Path, tmp_path: Path) -> None:
    for name in ("z.bc", "b/2.bsp", "a/1.bsp", "m.tm", "naif.tls", "readme.txt", "x.tf"):
        (tmp_path / "k" / name).parent.mkdir(parents=True, exist_ok=True)
        text = "" if name.endswith((".bc", ".bsp")) else "\\begindata\nA = 1\n"
        (tmp_path / "k" / name).write_text(
            text.replace("A = 1", f"KERNELS_TO_LOAD = '{pck}'") if name == "m.tm" else text
        )
    names = [kernel.path.name for kernel in list_kernels([tmp_path / "k" / "m.tm", tmp_path / "k"])]
    assert names == ["naif.tls", "x.tf", "1.bsp", "2.bsp", "z.bc", "m.tm", "toy.tpc"]


def test_a_meta_kernels_members_are_recorded_with_their_hashes(pck: Path, tmp_path: Path) -> None:
    meta = tmp_path / "meta.tm"
    meta.write_text(f"KPL/MK\n\\begindata\nKERNELS_TO_LOAD = ( '{pck}' )\n\\begintext\n")
    with kernel_pool([meta]) as kernels:
        assert spiceypy.bodfnd(999999, "RADII")
        assert [kernel.path.name for kernel in kernels] == ["meta.tm", "toy.tpc"]
        assert all(len(kernel.sha256) == 64 for kernel in kernels)
    assert spiceypy.ktotal("ALL") == 0


def test_without_kernels_nothing_is_known_and_nothing_raises() -> None:
    found = pose_parts_from_spice(find_camera("cassini-nac"), find_target("enceladus"), 0.0, [])
    assert found.parts.missing()[0] == "camera_from_j2000"
    assert found.missing == ("no kernels are loaded",)


@real
def test_the_whole_data_folder_is_furnished_and_cleared(data_folder: Path) -> None:
    import time

    start = time.perf_counter()
    with kernel_pool([data_folder / "kernels"]) as kernels:
        count = len(kernels)
    seconds = time.perf_counter() - start
    print(f"{count} kernels furnished and cleared in {seconds:.2f} s")
    assert count > 40
    assert spiceypy.ktotal("ALL") == 0


@real
def test_what_the_kernels_do_not_cover_is_named_by_kernel_type_and_body(data_folder: Path) -> None:
    et = et_from_utc("2005-03-09T04:09:09.568")
    kernels = [data_folder / "kernels"]
    found = pose_parts_from_spice(find_camera("cassini-nac"), find_target("enceladus"), et, kernels, light_time_s=1.0)
    print("\n".join(found.missing))
    assert any(text.startswith("SPK: position of enceladus") and "-82, 602" in text for text in found.missing)
    assert any(text.startswith("SCLK: clock of spacecraft -82") for text in found.missing)
    assert found.parts.body_from_j2000 is not None  # the PCK knows Enceladus


CK_SLICES = [  # camera, target, a moment inside the slice; the target's disk must be where the camera looks
    ("voyager1-nac", "jupiter", "1979-03-05T04:14:57"),
    ("voyager1-wac", "jupiter", "1979-03-05T09:28:34"),
    ("voyager2-nac", "europa", "1979-07-09T15:12:07"),
    ("voyager2-wac", "jupiter", "1979-07-09T21:18:21"),
    ("galileo-ssi", "io", "1997-02-19T21:07:27"),
    ("newhorizons-lorri", "io", "2007-02-28T13:14:22"),
]


@real
@pytest.mark.parametrize(("camera_name", "target_name", "utc"), CK_SLICES)
def test_the_c_kernels_camera_looks_at_its_target(
    camera_name: str, target_name: str, utc: str, data_folder: Path
) -> None:
    camera, target = find_camera(camera_name), find_target(target_name)
    found = pose_parts_from_spice(camera, target, et_from_utc(utc), [data_folder / "kernels"])
    assert found.missing == ()
    pose = found.parts.completed()
    centre = camera.project(pose.target_in_camera_km)
    radius_px = camera.focal_length_px * target.mean_radius_km / pose.range_km
    print(f"{camera_name} {utc}: {target_name} centre {centre.round(1)} px, radius {radius_px:.1f} px")
    half = 0.5 * np.array(camera.size_px)
    nearest = np.maximum(np.abs(centre - half) - half, 0)  # distance of the disk's centre from the frame
    assert np.hypot(*nearest) < radius_px


@pytest.fixture(scope="module")
def spice_of_paper_images(data_folder: Path) -> dict[str, PartialPose]:
    """What SPICE says of the paper's 57 images."""
    target = find_target("europa")
    with kernel_pool([data_folder / "kernels"]) as loaded:
        return {
            name: pose_parts_from_loaded(find_camera(image.camera), target, image.pose.et, loaded).parts
            for name, image in paper_images().items()
        }


def _difference(image: PaperImage, spice: PartialPose) -> tuple[float, float]:
    """Range (km) and direction (microrad) of the paper, without its range factor, minus SPICE's."""
    ours, theirs = spice.target_from_spacecraft_km, image.pose.target_from_spacecraft_km
    assert ours is not None
    range_km = float(np.linalg.norm(ours))
    angle = np.linalg.norm(ours / range_km - theirs / np.linalg.norm(theirs))
    return float(np.linalg.norm(theirs)) / image.range_factor - range_km, float(1e6 * angle)


@real
def test_spice_positions_agree_with_the_papers_57_images(spice_of_paper_images: dict[str, PartialPose]) -> None:
    images = paper_images()
    differences = {name: _difference(image, spice_of_paper_images[name]) for name, image in images.items()}
    for name, (range_km, microrad) in differences.items():
        print(f"{images[name].camera:18} {name:15} range {range_km:8.1f} km, direction {microrad:7.1f} microrad")
    lorri = np.array([d for name, d in differences.items() if images[name].camera == "newhorizons-lorri"])
    voyager = np.array([d for name, d in differences.items() if images[name].camera.startswith("voyager")])
    assert (len(lorri), len(voyager)) == (18, 39)
    assert np.abs(lorri[:, 0]).max() < 4.0
    assert lorri[:, 1].max() < 1.5
    assert np.abs(voyager[:, 0]).max() < 600  # the authors' trajectory files differ


@real
def test_the_papers_attitudes_are_ours_within_its_own_scatter(spice_of_paper_images: dict[str, PartialPose]) -> None:
    turns = []
    for name, image in paper_images().items():
        ours = spice_of_paper_images[name].body_from_j2000
        assert ours is not None
        cosine = (np.trace(image.pose.body_from_j2000 @ ours.T) - 1) / 2
        turns.append(float(np.degrees(np.arccos(min(cosine, 1.0)))))
    turns.sort()
    print(f"the paper's attitude corrections: median {np.median(turns):.2f} deg, largest {turns[-2:]}")
    assert turns[-2] < 1.8
    assert turns[-1] == pytest.approx(12.53, abs=0.05)  # LOR_0035033162


@real
def test_paper_images_are_the_published_numbers(data_folder: Path) -> None:
    published = json.loads((data_folder.parent / "paper" / "europa57.json").read_text())
    assert [entry["img_name"].removesuffix("_0X630_SCI_1") for entry in published] == list(paper_images())
    for entry, image in zip(published, paper_images().values(), strict=True):
        assert image.pose.range_km == pytest.approx(np.linalg.norm(entry["moon_pos"]) / 1000, rel=1e-11)
        assert image.pose.phase_deg == pytest.approx(np.degrees(entry["phase"]), abs=0.3)  # its own is of another epoch
        looking_at = np.array(entry["Rcam"]).T @ np.array(entry["moon_pos"])
        looking_at /= np.linalg.norm(looking_at)
        np.testing.assert_allclose(image.pose.target_in_camera_km / image.pose.range_km, looking_at, atol=1e-10)


def test_a_folder_without_kernels_and_a_file_that_is_none_are_refused_by_name(pck: Path, tmp_path: Path) -> None:
    refuse_what_holds_no_kernel([pck, tmp_path])
    (tmp_path / "empty").mkdir()
    with pytest.raises(RefusedError, match=r"empty holds no kernel \(\.tls, "):
        refuse_what_holds_no_kernel([tmp_path / "empty"])
    note = tmp_path / "note.txt"
    note.write_text("no kernel")
    with pytest.raises(RefusedError, match=r"note\.txt is neither a binary SPICE file nor a text"):
        refuse_what_holds_no_kernel([note])
    note.write_text(TEXT_KERNEL)
    refuse_what_holds_no_kernel([note])
