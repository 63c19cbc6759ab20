"""How a user helps or overrules: where to start, what to hold, what to mask, and a result to go on from."""

import json
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from astropy.io import fits
from numpy.typing import NDArray
from PIL import Image
from small_image import PLANTED_OFFSET_PX, TRUE_CENTRE_PX, write_small_archive
from typer.testing import CliRunner

from catalog.errors import RefusedError
from catalog.flips import Flip, flipped
from catalog.mask import masked, read_mask
from catalog.observation import Observation, Quality
from catalog.pose import Pose
from catalog.rotation import rotation_from_vector_deg
from catalog.unchanged import Answer
from flows.cli import build_app
from flows.cli.correct import warn
from flows.cli.downstream import answer_with_json
from flows.one_image import one_result
from flows.options import AdjustOptions
from flows.progress import Silent
from flows.request import Request
from tasks.profile import Profile, find_profile
from tasks.publish.cube import open_cube
from tasks.step import run
from tasks.stored import load_observation

RANGE_KM = 780_000.0
JOINT = """
base = "defaults"
passes = 1
steps = ["point", "joint"]
[simulate]
oversample = 2
[joint]
oversample = 2
second_start = false

[point]
stop_px = 0.1
"""

Correct = Callable[..., dict[str, Any]]


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("archive")
    write_small_archive(folder)
    (folder / "joint.toml").write_text(JOINT)
    return folder


def correct_in(
    folder: Path,
    image: str = "small.png",
    hold: tuple[str, ...] = (),
    steps: tuple[str, ...] = ("point", "joint"),
    **more: Any,
) -> dict[str, Any]:
    """Correct an image of `folder` with the joint profile, without Prefect."""
    profile = find_profile(str(folder / "joint.toml")).holding(hold).model_copy(update={"steps": steps})
    request = Request(
        image=folder / image,
        camera=str(folder / "small.toml"),
        target="europa",
        pose_file=folder / "pose.json",
        kernels=(),
        store=folder / "out",
        cache=folder / "cache",
        profile=profile,
        **more,
    )
    return one_result(request, Silent(), run_step=run)


@pytest.fixture(scope="module")
def plain_result(archive: Path) -> dict[str, Any]:
    """The small image corrected without help, published in `archive`/out."""
    return correct_in(archive)


@pytest.fixture
def correct(archive: Path, plain_result: dict[str, Any], tmp_path: Path) -> Correct:
    """Corrects in a copy of the archive, which has the unhelped image's steps in its cache and its product."""
    assert plain_result["status"] in ("ok", "doubtful"), plain_result["reason"]
    shutil.copytree(archive, tmp_path / "here")
    return partial(correct_in, tmp_path / "here")


def test_a_held_range_stays_exactly_what_was_predicted(correct: Correct, plain_result: dict[str, Any]) -> None:
    result = correct(hold=("range", "roll"))
    print({key: (plain_result[key], result[key]) for key in ("range_factor", "roll_deg", "offset_px")})
    assert plain_result["range_factor"] != 1.0
    assert result["range_factor"] == 1.0
    assert result["roll_deg"] is None
    assert result["uncertainty"]["range_factor"] is None
    assert result["range_factor_free"] is None
    assert result["guidance"]["held"] == ["range", "roll"]
    assert result["offset_px"] == pytest.approx(PLANTED_OFFSET_PX, abs=0.1)
    assert json.loads(Path(result["cube"]).with_name("settings.json").read_text())["hold"] == ["range", "roll"]
    assert result["cached"][:4] == ["ingest", "pose", "undistort", "point-1"]


def test_steps_that_would_change_what_is_held_are_left_out() -> None:
    usual = Profile()
    assert usual.holding(["range"]).corrections(1) == ("point", "attitude")
    assert usual.holding(["offset"]).corrections(2) == ("attitude",)
    joint = Profile(steps=("point", "range", "joint")).holding(["offset", "attitude"])
    assert joint.corrections(1) == ("joint",)
    assert joint.settings_of("joint").hold == ("offset", "attitude")


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        (["--hold", "offset,attitude"], "none of the steps"),
        (["--hold", "distance"], "offset"),
        (["--start-offset", "3"], "two numbers"),
        (["--start-offset", "-3,inf"], "not finite"),
    ],
)
def test_help_that_makes_no_sense_is_wrong_usage(arguments: list[str], fault: str) -> None:
    done = CliRunner().invoke(build_app(), ["correct", "none.png", "--profile", "standard", *arguments])
    assert done.exit_code == 2
    assert fault in done.stderr.replace("│", " ")


@pytest.mark.parametrize(
    ("content", "fault"), [(None, "does not exist"), ("a,b\n1,2\n", "no column that is known as ra_deg")]
)
def test_a_star_catalog_is_checked_before_any_image(content: str | None, fault: str, tmp_path: Path) -> None:
    sky = tmp_path / "sky.csv"
    if content is not None:
        sky.write_text(content)
    done = CliRunner().invoke(
        build_app(), ["correct", "none.png", "--store", str(tmp_path / "out"), "--stars", str(sky)],
        env={"COLUMNS": "400"},
    )  # fmt: skip
    assert done.exit_code == 2
    assert fault in done.stderr
    assert "none.png" not in done.stderr


def test_a_masked_half_of_the_disk_leaves_the_answer_within_its_errors(
    correct: Correct, plain_result: dict[str, Any], archive: Path, tmp_path: Path
) -> None:
    half = np.zeros((104, 112), np.uint8)
    half[:50] = 255
    Image.fromarray(half).save(tmp_path / "half.png")
    result = correct(mask=tmp_path / "half.png")
    assert result["status"] in ("ok", "doubtful"), result["reason"]
    error, sigma = np.subtract(result["centre_px"], TRUE_CENTRE_PX), np.array(result["uncertainty"]["centre_px"])
    print(f"half masked: error {error.round(3)} px, sigma {sigma.round(3)} px, unmasked {plain_result['centre_px']}")
    assert (np.abs(error) < 4 * sigma).all()
    assert np.hypot(*error) < 0.3
    assert (sigma > plain_result["uncertainty"]["centre_px"]).all()
    assert result["guidance"]["mask"] == str(tmp_path / "half.png")
    [folder] = {path.parent for path in (tmp_path / "here/cache/undistort").rglob("record.json")} - {
        tmp_path / "here" / path.parent.relative_to(archive)
        for path in (archive / "cache/undistort").rglob("record.json")
    }
    quality = load_observation(folder).quality
    assert ((quality & Quality.MASKED_BY_USER != 0) == (half != 0)).all()
    assert "undistort" not in result["cached"]


@pytest.mark.parametrize("suffix", ["png", "tif", "fits", "npy"])
def test_masks_are_read_from_pictures_fits_and_arrays(tmp_path: Path, suffix: str) -> None:
    wanted = np.zeros((5, 7), bool)
    wanted[1:3, 4] = True
    path = tmp_path / f"mask.{suffix}"
    values: NDArray[np.uint8] = wanted.astype(np.uint8)
    if suffix == "fits":
        fits.writeto(path, values)
    elif suffix == "npy":
        np.save(path, wanted)
    else:
        Image.fromarray(values).save(path)
    assert (read_mask(path) == wanted).all()


def test_a_mask_that_does_not_fit_is_refused_with_file_fault_and_remedy(correct: Correct, tmp_path: Path) -> None:
    small, text = tmp_path / "tiny.npy", tmp_path / "text.png"
    np.save(small, np.ones((4, 4)))
    text.write_text("no picture")
    for path, code in ((small, "mask-size"), (text, "mask-unreadable"), (tmp_path / "gone.png", "mask-missing")):
        result = correct(mask=path)
        assert result["status"] == "refused"
        assert result["reason"].startswith(f"{code}: ")
        assert str(path) in result["reason"]
    frame = Observation(np.ones((4, 4), np.float32), np.ones((4, 4), np.float32), np.zeros((4, 4), np.uint16))
    with pytest.raises(RefusedError, match="whole image"):
        masked(frame, np.ones((4, 4), bool), small)


def test_a_start_offset_takes_the_body_that_is_meant(correct: Correct, archive: Path, tmp_path: Path) -> None:
    """Two disks in one frame, the brighter and sharper of which is not the one that is meant."""
    one = np.asarray(Image.open(archive / "small.png")).astype(float)
    two = np.full((104, 232), 1000.0)
    two[:, :112] = 1000 + 0.6 * (one - 1000) + np.random.default_rng(3).normal(0, 200, one.shape)
    two[:, 120:] = one
    Image.fromarray(np.clip(two, 0, 65535).astype(np.uint16)).save(tmp_path / "here" / "two.png")
    camera = (archive / "small.toml").read_text().replace("[112, 104]", "[232, 104]")
    (tmp_path / "here" / "small.toml").write_text(camera)
    alone, helped = (correct("two.png", steps=("point",), start_offset_px=start) for start in (None, (4.0, 6.0)))
    print(f"alone {alone['centre_px']}, helped {helped['centre_px']}, {helped['status']}: {helped['reason']}")
    assert alone["centre_px"] == pytest.approx((TRUE_CENTRE_PX[0] + 120, TRUE_CENTRE_PX[1]), abs=0.5)
    assert helped["centre_px"] == pytest.approx(TRUE_CENTRE_PX, abs=0.3)
    assert helped["offset_px"] == pytest.approx(PLANTED_OFFSET_PX, abs=0.3)  # from the predicted, not the given start
    assert helped["guidance"]["start_offset_px"] == [4.0, 6.0]


def test_going_on_from_a_result_reproduces_it(correct: Correct, plain_result: dict[str, Any], tmp_path: Path) -> None:
    product = tmp_path / "here/out/small"
    result = correct(resume=product)
    moved = np.subtract(result["centre_px"], plain_result["centre_px"])
    sigma = plain_result["uncertainty"]
    print(f"resumed: moved {moved} px, range by {result['range_factor'] / plain_result['range_factor'] - 1:+.2e}")
    assert (np.abs(moved) < 0.5 * np.array(sigma["centre_px"])).all()
    assert result["range_factor"] == pytest.approx(plain_result["range_factor"], abs=0.5 * sigma["range_factor"])
    assert result["offset_px"] == pytest.approx(PLANTED_OFFSET_PX, abs=0.1)
    # Half of the prior's 0.1 deg: roll and the body's turn about the sight trade little by little for each other.
    assert result["roll_deg"] == pytest.approx(plain_result["roll_deg"], abs=0.05)
    assert result["attitude_deg"] == pytest.approx(plain_result["attitude_deg"], abs=0.5 * min(sigma["attitude_deg"]))
    assert result["guidance"]["resumed_from"] == str(product)
    assert "start" in result["seconds"]
    for name, code in (("nothing", "resume-unreadable"), ("bad", "resume-invalid"), ("other", "resume-other-image")):
        path = tmp_path / f"{name}.json"
        if name == "bad":
            path.write_text("{}")
        if name == "other":
            path.write_text(json.dumps(plain_result["pose"] | {"et": 3600.0, "utc": None}))
        refused = correct(resume=path)
        assert refused["reason"].startswith(code), refused["reason"]
        assert str(path) in refused["reason"] or code == "resume-other-image"


def test_an_adjusted_store_has_pose_files_from_which_correct_goes_on(
    correct: Correct, plain_result: dict[str, Any], tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="0"):
        answer_with_json("adjust", AdjustOptions(store=tmp_path / "here/out", out=tmp_path / "adjusted"), json=True)
    report = json.loads(capfd.readouterr().out)
    assert report == json.loads((tmp_path / "adjusted/adjust.json").read_text())
    [image] = report["images"]
    print(report["overestimated_distance"])
    assert image["range_factor"] == pytest.approx(plain_result["range_factor"], abs=1e-3)
    result = correct(resume=tmp_path / "adjusted", hold=("range", "attitude", "roll"))
    assert result["reason"] is None
    assert result["range_factor"] == pytest.approx(image["range_factor"], rel=1e-9)
    assert result["roll_deg"] == pytest.approx(image["roll_deg"], abs=1e-3)  # the roll that was resumed and held
    assert result["attitude_deg"] == pytest.approx(image["attitude_deg"], abs=1e-3)
    assert result["centre_px"] == pytest.approx(TRUE_CENTRE_PX, abs=0.1)


def test_a_label_that_names_another_target_is_reported_on_stderr_in_result_and_provenance(
    correct: Correct, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    labelled = tmp_path / "here" / "labelled.fits"
    with Image.open(tmp_path / "here" / "small.png") as picture:
        fits.writeto(labelled, np.asarray(picture), fits.Header({"TARGET": "IO"}))
    result = correct(image="labelled.fits")
    reported = "the label says target io, --target europa is used"
    assert result["status"] in ("ok", "doubtful"), result["reason"]
    assert result["guidance"]["overruled"] == [reported]
    with open_cube(Path(result["cube"])) as cube:
        assert json.loads(cube.attrs["provenance"])["guidance"]["overruled"] == [reported]
    warn(result, Answer())
    assert capfd.readouterr().err.splitlines()[-1] == f"planetpose: labelled: {reported}"


def test_a_product_that_lost_a_file_is_published_again_but_an_overlay_may_go(correct: Correct) -> None:
    cube = Path(correct()["cube"])
    chunk = next(path for path in (cube / "latitude" / "c").rglob("*") if path.is_file())
    values = chunk.read_bytes()
    (cube.parent / "overlay.png").unlink()
    assert "publish" in correct()["cached"]
    chunk.unlink()
    assert "publish" not in correct()["cached"]
    assert chunk.read_bytes() == values
    assert (cube.parent / "overlay.png").exists()


@pytest.mark.parametrize("flip", ["y", "rot90"])
def test_a_picture_that_is_flipped_back_gives_the_same_pose(
    flip: Flip, correct: Correct, plain_result: dict[str, Any], tmp_path: Path
) -> None:
    here = tmp_path / "here"
    undo: Flip = "rot270" if flip == "rot90" else flip
    with Image.open(here / "small.png") as picture:
        Image.fromarray(flipped(np.asarray(picture), undo)).save(here / "mirrored.png")
    result = correct("mirrored.png", flip=flip)
    assert result["guidance"]["flip"] == flip
    assert result["centre_px"] == pytest.approx(plain_result["centre_px"], abs=0.02)
    assert result["range_factor"] == pytest.approx(plain_result["range_factor"], abs=2e-4)
    assert "ingest" not in result["cached"]


def test_an_attitude_that_is_held_is_looked_at(correct: Correct, plain_result: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "here" / "pose.json"
    pose = Pose.from_dict(json.loads(path.read_text()))
    about_pole = rotation_from_vector_deg([0.0, 0.0, 180.0])
    path.write_text(json.dumps(pose.replaced(body_from_j2000=about_pole @ pose.body_from_j2000).to_dict()))
    result = correct(hold=("attitude",))
    print(plain_result["orientation"], result["orientation"], result["reason"])
    assert plain_result["orientation"]["markings"] == "matched"
    assert result["orientation"]["markings"] == "mismatched"
    assert result["status"] == "doubtful"
    assert "markings-do-not-match" in result["reason"]
