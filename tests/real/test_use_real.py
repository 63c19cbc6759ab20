"""Real images as users and their scripts meet the program: refusals, other formats, pose files, the cache, --json."""

import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from astropy.io import fits
from PIL import Image
from real_bench import Bench, shorter

from catalog.camera import find_camera
from catalog.pose import Pose
from catalog.readers import read_frame
from catalog.rotation import rotation_from_vector_deg
from flows.result import EMPTY
from tasks.point.rotation import pose_moved_by
from tasks.profile import find_profile

pytestmark = pytest.mark.real

EUROPA = "galileo/C0552809300R.IMG"
KEYS = list(EMPTY)  # which ones these are, tests/flows/test_cli.py holds
PLANTED = {"offset_px": (23.4, -31.7), "range_factor": 1.004, "attitude_deg": (0.5, -0.4, 0.6)}
MINIMAL_CAMERA = """name = "my-ssi"
size_px = [800, 800]
centre_px = [399, 399]
focal_length_mm = 1500.46656
pixel_pitch_mm = 0.01524
"""


@pytest.fixture(scope="module")
def exported(bench: Bench, europa_by_limb: dict[str, Any]) -> Bench:
    """The bench with the Galileo image as europa.fits and europa8.png, and wrong.json: the corrected pose with planted
    errors."""
    image = read_frame(bench.image(EUROPA)).observation.image
    fits.PrimaryHDU(image).writeto(bench.folder / "europa.fits")
    Image.fromarray(image.astype(np.uint8)).save(bench.folder / "europa8.png")
    pose, camera = Pose.from_dict(europa_by_limb["pose"]), find_camera("galileo-ssi")
    turned = rotation_from_vector_deg(PLANTED["attitude_deg"]) @ pose.body_from_j2000
    wrong = pose_moved_by(pose, camera, PLANTED["offset_px"]).with_range_factor(PLANTED["range_factor"])
    bench.write_json("wrong.json", wrong.replaced(body_from_j2000=turned).to_dict())
    return bench


@pytest.mark.parametrize("name", ["europa.fits", "europa8.png"])
def test_any_picture_with_camera_target_and_pose_file_gives_what_the_vicar_file_gave(
    exported: Bench, europa_by_limb: dict[str, Any], name: str
) -> None:
    result = exported.correct(
        exported.folder / name,
        store=f"store-{name}",
        camera="galileo-ssi",
        target="europa",
        pose_file=exported.folder / "wrong.json",
        profile=shorter(2),
    )
    away = np.subtract(result["centre_px"], europa_by_limb["centre_px"])
    turn = np.subtract(result["attitude_deg"], PLANTED["attitude_deg"])
    print(f"{name}: centre {away.round(4)} px from the VICAR file's, bar 0.05; offset {result['offset_px']};", end=" ")
    print(f"range factor {result['range_factor'] * PLANTED['range_factor']:.5f}, attitude off by {turn.round(3)} deg")
    assert result["status"] == "ok"
    assert np.hypot(*away) < 0.05
    assert np.add(result["offset_px"], PLANTED["offset_px"]) == pytest.approx([0, 0], abs=0.05)
    assert result["range_factor"] * PLANTED["range_factor"] == pytest.approx(1, abs=5e-4)
    assert np.linalg.norm(turn) < 0.1
    assert (result["camera"], result["target"], result["pose_source"]) == ("galileo-ssi", "europa", "file")


def test_a_users_camera_needs_five_lines(exported: Bench, europa_by_limb: dict[str, Any]) -> None:
    """Without the distortion the disk's centre is half a pixel away at most (1.2 px in the frame's corner)."""
    result = exported.correct(
        exported.folder / "europa8.png",
        store="my-camera",
        camera=str(exported.write("my-ssi.toml", MINIMAL_CAMERA)),
        target="Europa",
        pose_file=exported.folder / "wrong.json",
        profile=shorter(2),
    )
    away = np.subtract(result["centre_px"], europa_by_limb["centre_px"])
    print(f"pinhole: centre {away.round(3)} px from the corrected frame's, limb rms {result['limb_rms_px']:.3f} px")
    assert (result["status"], result["camera"], result["target"]) == ("ok", "my-ssi", "europa")
    assert np.hypot(*away) < 0.5
    assert result["limb_rms_px"] < 0.2


def test_the_pose_of_a_result_is_a_pose_file_that_needs_no_correction(
    bench: Bench, europa_by_limb: dict[str, Any]
) -> None:
    pose_file = bench.write_json("corrected.json", europa_by_limb["pose"])
    again = bench.correct(bench.image(EUROPA), store="again", pose_file=pose_file, profile=shorter(2))
    print(f"offset {again['offset_px']} px, range factor {again['range_factor']}, attitude {again['attitude_deg']} deg")
    assert (again["status"], again["pose_source"]) == ("ok", "file")
    assert again["offset_px"] == pytest.approx([0, 0], abs=0.03)
    assert again["range_factor"] == pytest.approx(1, abs=2e-4)
    assert np.linalg.norm(again["attitude_deg"]) < 0.05
    assert again["cached"] == ["ingest", "undistort"]  # what does not depend on the pose


def test_a_second_run_does_no_step_and_prints_one_json_object(bench: Bench, europa: dict[str, Any]) -> None:
    started = time.monotonic()
    done = bench.command("correct", bench.image(EUROPA), "--no-kernels", "--store", "out", "--json")
    seconds = time.monotonic() - started
    print(f"second run: {seconds:.2f} s, bar 6 s")
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == 1
    result = json.loads(done.stdout)
    assert list(result) == KEYS
    assert result["cached"] == list(result["seconds"])
    changing = ("cached", "cube", "overlay")
    assert {key: result[key] for key in KEYS if key not in changing} == {
        key: europa[key] for key in KEYS if key not in changing
    }
    assert (bench.folder / result["overlay"]).samefile(europa["overlay"])
    assert not (bench.folder / "state").exists()  # no Prefect server was needed


@pytest.mark.parametrize(
    ("setting", "first"),
    [
        ("", None),
        ("[undistort]\nkernel = 'bicubic'\n", "undistort"),
        ("[simulate]\noversample = 5\n", "point-1"),
        ("[point]\nstop_px = 0.01\n", "point-1"),
        ("[range.ssim]\nstep = 0.001\n", "range-1"),
        ("[later.range.limb]\nstop_px = 0.01\n", "range-2"),
        ("[attitude]\nmax_deg = 4.0\n", "attitude-1"),
        ("[validate]\nhalf_px = 7\n", "validate"),
        ("[accept]\nmax_limb_rms_px = 2.5\n", "publish"),
    ],
)
def test_a_changed_setting_redoes_its_step_and_what_follows(
    bench: Bench, europa_by_limb: dict[str, Any], setting: str, first: str | None
) -> None:
    assert europa_by_limb["status"] == "ok"
    profile = merged_with_standard(bench, setting)
    assert bench.first_undone(bench.image(EUROPA), profile=profile, store="by-limb") == first


def merged_with_standard(bench: Bench, setting: str) -> Any:
    """The standard profile with one setting changed by a user's file."""
    return find_profile(str(bench.write("standard.toml", f'base = "standard"\n{setting}')))


@pytest.fixture(scope="module")
def rejects(bench: Bench) -> Bench:
    """The bench with files that must be refused."""
    europa, pluto = bench.image(EUROPA).read_bytes(), bench.image("new_horizons/lor_0299140073_0x630_sci.fit")
    for length in (0, 12, 1500, 9_000, 100_000, 809_999):
        bench.write(f"cut{length}.IMG", europa[:length])
    bench.write("cut.fit", pluto.read_bytes()[:3_000_000])
    bench.write("cut.raw", bench.image("voyager/f1636832.raw").read_bytes()[:-3000])
    bench.write("cut.imq", bench.image("voyager/c4400436.imq").read_bytes()[:-3000])
    bench.write("text.IMG", "What is this?\n")
    bench.write("noise.IMG", np.random.default_rng(0).bytes(100_000))
    (bench.folder / "folder.IMG").mkdir()
    Image.fromarray(read_frame(bench.image(EUROPA)).observation.image.astype(np.uint8)).save(bench.folder / "plain.png")
    bench.write("no-focal.toml", 'name = "x"\nsize_px = [800, 800]\ncentre_px = [399, 399]\n')
    bench.write("broken.toml", "name = \n")
    pose = {"et": 0, "camera_from_j2000": np.eye(3).tolist(), "body_from_j2000": np.eye(3).tolist()}
    pose |= {"target_from_spacecraft_km": [0, 0, 1e6], "sun_from_target_km": [-1e8, 0, -1e8]}
    skewed, mirrored = np.eye(3), np.diag([1.0, 1.0, -1.0])
    skewed[0, 1] = 1e-3
    bench.write_json("pose.json", pose)
    bench.write_json("skewed.json", pose | {"camera_from_j2000": skewed.tolist()})
    bench.write_json("mirrored.json", pose | {"body_from_j2000": mirrored.tolist()})
    bench.write_json("misspelt.json", pose | {"camera_to_j2000": np.eye(3).tolist()})
    return bench


PICTURE = {"camera": "galileo-ssi", "target": "europa", "pose_file": "pose.json"}
REFUSALS: list[tuple[str, dict[str, Any], str, str]] = [
    (f"images:{'galileo/C0532836239R.IMG'}", {}, "map-too-coarse", "finer base map"),
    *((f"cut{n}.IMG", {}, "truncated", "Fetch the file again") for n in (12, 1500, 9_000, 100_000, 809_999)),
    ("cut0.IMG", {}, "the file is empty", "are read"),
    ("cut.fit", {}, "truncated", "Fetch the file again"),
    ("cut.raw", {}, "truncated", "Fetch the file again"),
    ("cut.imq", {}, "image-unreadable", "Fetch the file again"),
    ("text.IMG", {}, "text", "NPY, and any of them in .gz or .bz2, are read"),
    ("noise.IMG", {}, "no known image format", "NPY, and any of them in .gz or .bz2, are read"),
    ("folder.IMG", {}, "image-is-folder", "folder.IMG/*.IMG"),
    ("nowhere.IMG", {}, "does not exist", "Check the path"),
    ("plain.png", {}, "camera-unknown", "--camera"),
    ("plain.png", {"camera": "galileo-ssi"}, "target-unknown", "--target"),
    ("plain.png", {"camera": "galileo-ssi", "target": "europa"}, "no time", "--pose"),
    ("plain.png", PICTURE | {"camera": "kodak"}, "camera-unknown", "voyager1-nac"),
    ("plain.png", PICTURE | {"camera": "no-focal.toml"}, "focal_length_px", "It needs at least name"),
    ("plain.png", PICTURE | {"camera": "broken.toml"}, "camera-file-unreadable", "Give a TOML file"),
    ("plain.png", PICTURE | {"camera": "none.toml"}, "No such file", "Give a TOML file"),
    ("plain.png", PICTURE | {"camera": "cassini-nac"}, "frame-size", "give the --camera that took it"),
    ("plain.png", PICTURE | {"target": "vulcan"}, "target-unknown", "europa"),
    ("plain.png", PICTURE | {"pose_file": "skewed.json"}, "not orthonormal", "nearest rotation"),
    ("plain.png", PICTURE | {"pose_file": "mirrored.json"}, "left-handed", "order and sign"),
    ("plain.png", PICTURE | {"pose_file": "misspelt.json"}, "camera_to_j2000", "known are utc, et"),
    ("plain.png", PICTURE | {"pose_file": "text.IMG"}, "pose-file-invalid", "README"),
    ("plain.png", PICTURE | {"pose_file": "none.json"}, "pose-file-missing", "Check the path"),
    ("plain.png", PICTURE | {"basemap": "plain.png"}, "800x800", "twice as wide as high"),
    ("plain.png", PICTURE | {"basemap": "text.IMG"}, "map-unreadable", "PNG, JPEG or TIFF"),
    ("plain.png", PICTURE | {"kernels": ("none.bsp",)}, "kernel-missing", "kernel file"),
    (f"images:{EUROPA}", {"target": "io"}, "does not give them for io", "--kernels"),
]


@pytest.mark.parametrize(("image", "options", "fault", "remedy"), REFUSALS)
def test_what_cannot_be_processed_is_refused_with_fault_and_remedy(
    rejects: Bench, monkeypatch: pytest.MonkeyPatch, image: str, options: dict[str, Any], fault: str, remedy: str
) -> None:
    monkeypatch.chdir(rejects.folder)
    path = rejects.image(image.partition(":")[2]) if image.startswith("images:") else Path(image)
    result = rejects.correct(path, store="refused", **options)
    print(result["reason"])
    assert result["status"] == "refused"
    assert fault in result["reason"]
    assert remedy in result["reason"]
    assert list(result) == KEYS
    assert {result[key] for key in ("cube", "limb_rms_px")} == {None}
    store = Path("refused")
    assert not store.exists() or [path.name for path in store.iterdir()] == [".failed"]
    # What could be read leaves a picture of why it was refused, outside of the products.
    left = [Path(result[key]) for key in ("overlay", "tried") if result[key]]
    assert all(path.is_file() and path.parent.parent == store.resolve() / ".failed" for path in left)


def test_a_bad_image_does_not_stop_the_others(rejects: Bench, europa: dict[str, Any]) -> None:
    """One command, through Prefect: of its images only the good one is in the store afterwards."""
    images = ["cut100000.IMG", "text.IMG", rejects.image("galileo/C0532836239R.IMG"), rejects.image(EUROPA), "none.IMG"]
    started = time.monotonic()
    done = rejects.command("correct", *images, "--no-kernels", "--server", "embedded", "--json", "--quiet")
    print(f"{time.monotonic() - started:.1f} s")
    results = [json.loads(line) for line in done.stdout.splitlines()]
    assert [Path(image).stem for image in images] == [result["product"] for result in results]
    assert [result["status"] for result in results] == ["refused", "refused", "refused", "ok", "refused"]
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    stored = {path.name for path in (rejects.folder / "out").iterdir()}
    assert stored & {result["product"] for result in results} == {"C0552809300R"}
    assert results[3]["pose"] == europa["pose"]
