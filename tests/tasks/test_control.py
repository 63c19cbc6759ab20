"""Control: planted errors of poses are found from ties between images, false ties are rejected, files are read."""

import json
import struct
from dataclasses import replace

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory, unknown_fields
from typer.testing import CliRunner

from catalog.camera import read_camera_file
from catalog.errors import FailedError, PlanetposeError, RefusedError, WrongOptionError
from catalog.pose import read_pose_file
from catalog.rotation import vector_deg_from_rotation
from catalog.target import find_target
from flows.cli import build_app
from lab.maps.network import MadeNetwork, across_deg, made_network, rms_across_deg
from lab.simulate.albedo_store import paper_views, write_albedo_store
from tasks.control.bundle import adjust_bundle
from tasks.control.camera_constants import constant_rows, constants_of
from tasks.control.files import NET, write_control
from tasks.control.matching import match_patches
from tasks.control.settings import ControlSettings
from tasks.control.store import control_report, control_store

VIEWS = ("LOR_0034823099", "LOR_0034849319", "LOR_0034866659", "C1634216", "C1635707", "C2062524")
EUROPA = find_target("europa")
FOCAL = ControlSettings(solve=("focal-length",))


def textured(seed: int = 2):
    """An albedo with features of 2 to 8 degrees."""
    import cv2

    from catalog.basemap import BaseMap

    rng = np.random.default_rng(seed)
    field = sum(cv2.GaussianBlur(rng.standard_normal((512, 1024)), (0, 0), s) * s for s in (3, 8))
    return BaseMap("textured", (1 + 0.15 * field / field.std()).clip(0.2).astype(np.float32), 0.0, "planted")


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    folder = tmp_path_factory.mktemp("control") / "store"
    chosen = [view for view in paper_views() if view.product in VIEWS]
    assert len(chosen) == len(VIEWS)
    stated = {"offset_px": [0.03, 0.03], "range_factor": 1e-4, "roll_deg": 0.01, "attitude_deg": [0.08] * 3}
    planted = write_albedo_store(
        folder, chosen, textured(), noise=0.004, attitude_error_deg=0.08, stated=stated, subpixels_across=400
    )
    return folder, planted, {view.product: view.pose for view in chosen}


@pytest.fixture(scope="module")
def control(store):
    return control_store(store[0], ControlSettings(points=700))


def test_attitudes_agree_after_the_adjustment_and_state_their_errors(store, control) -> None:
    before = np.array([across_deg(view.pose, store[2][view.product]) for view in control.views])
    poses = zip(control.bundle.poses, control.views, strict=True)
    after = np.array([across_deg(pose, store[2][view.product]) for pose, view in poses])
    stated = np.sqrt(np.einsum("kii->k", control.bundle.covariance[:, 4:, 4:]) / 3)
    report = control_report(control)
    print(f"\nacross {_rms(before):.3f} -> {_rms(after):.3f} deg, stated {_rms(stated):.3f}; {report['rms_px']:.3f} px")
    assert report["rms_px"] < 0.3
    assert report["points_used"] > 100
    assert _rms(after) < 0.75 * _rms(before)
    assert _rms(after) < 2 * _rms(stated)


def _rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def test_files_hold_the_network_and_poses_that_are_read_again(control, tmp_path) -> None:
    paths = write_control(control, tmp_path)
    assert all(path.is_file() for path in paths)
    for view, pose in zip(control.views, control.bundle.poses, strict=True):
        found = read_pose_file(tmp_path / f"{view.product}.pose.json").completed()
        assert np.array_equal(found.body_from_j2000, pose.body_from_j2000)
    label, header, points = read_net((tmp_path / NET).read_bytes())
    assert label["TargetName"] == header.targetName == "Europa"
    assert int(label["NumberOfPoints"]) == header.numPoints == len(points) == len(control.ties.points)
    assert int(label["NumberOfMeasures"]) == sum(len(point.measures) for point in points) == len(control.ties.image)
    first = points[0]
    assert (first.id, first.type) == ("pp000000", 2)
    adjusted = [first.adjustedX, first.adjustedY, first.adjustedZ]
    assert adjusted == pytest.approx(1e3 * control.bundle.points[0])
    assert len(first.adjustedCovar) == 6
    mine = np.flatnonzero(control.ties.point == 0)
    mine = mine[np.argsort(control.ties.image[mine])]
    places = [[measure.sample, measure.line] for measure in first.measures]
    assert places == pytest.approx(control.ties.xy_px[mine] + 1)
    reference = control.views[control.ties.image[mine[first.referenceIndex]]]
    assert first.measures[first.referenceIndex].serialnumber == reference.product


def message_type(name: str, fields: dict[int, tuple[str, str]], nested=None):
    """A class of Google's protobuf for the fields (number: name, type) of one of ISIS' messages; `*` marks repeated
    ones, `=` those that are packed."""
    file = descriptor_pb2.FileDescriptorProto(name=f"{name}.proto", package="Isis", syntax="proto2")
    message = file.message_type.add(name=name)
    for into, listed in ((message, fields), *([(message.nested_type.add(name="Measure"), nested)] if nested else [])):
        for number, (field, kind) in listed.items():
            made = into.field.add(name=field, number=number, label=3 if kind[0] in "*=" else 1)
            made.type = {"text": 9, "int": 5, "bool": 8, "double": 1, "message": 11}[kind.lstrip("*=")]
            made.options.packed = kind[0] == "="
            if made.type == 11:
                made.type_name = f".Isis.{name}.Measure"
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(f"Isis.{name}"))


# ControlNetFileHeaderV0005.proto and ControlPointFileEntryV0005.proto of ISIS (enumerations as int), of what is used.
HEADER_FIELDS = {
    1: ("networkId", "text"),
    2: ("targetName", "text"),
    3: ("created", "text"),
    4: ("lastModified", "text"),
    5: ("description", "text"),
    6: ("userName", "text"),
    7: ("numPoints", "int"),
}
POINT_FIELDS = {
    1: ("id", "text"),
    2: ("type", "int"),
    3: ("chooserName", "text"),
    6: ("ignore", "bool"),
    8: ("referenceIndex", "int"),
    9: ("aprioriSurfPointSource", "int"),
    11: ("aprioriRadiusSource", "int"),
    16: ("aprioriX", "double"),
    17: ("aprioriY", "double"),
    18: ("aprioriZ", "double"),
    20: ("adjustedX", "double"),
    21: ("adjustedY", "double"),
    22: ("adjustedZ", "double"),
    23: ("adjustedCovar", "=double"),
    25: ("measures", "*message"),
}
MEASURE_FIELDS = {
    1: ("serialnumber", "text"),
    2: ("type", "int"),
    3: ("sample", "double"),
    4: ("line", "double"),
    5: ("sampleResidual", "double"),
    6: ("lineResidual", "double"),
    7: ("choosername", "text"),
    10: ("ignore", "bool"),
    11: ("jigsawRejected", "bool"),
    15: ("samplesigma", "double"),
    16: ("linesigma", "double"),
}


def read_net(content: bytes):
    """Label, header and points of a version 5 network, read by Google's protobuf. Nothing in it is unknown to ISIS."""
    text = content[:65536].rstrip(b"\0").decode()
    label = dict(line.strip().replace('"', "").split(" = ", 1) for line in text.splitlines() if " = " in line)
    label = {key.strip(): value.strip() for key, value in label.items()}
    start, size = int(label["HeaderStartByte"]), int(label["HeaderBytes"])
    assert int(label["PointsStartByte"]) == start + size
    entry = message_type("ControlPointFileEntryV0005", POINT_FIELDS, MEASURE_FIELDS)
    at, points = start + size, []
    while at < len(content):
        (length,) = struct.unpack_from("<i", content, at)
        points.append(entry.FromString(content[at + 4 : at + 4 + length]))
        at += 4 + length
    assert at == start + size + int(label["PointsBytes"])
    header = message_type("ControlNetFileHeaderV0005", HEADER_FIELDS).FromString(content[start : start + size])
    read = [header, *points, *(measure for point in points for measure in point.measures)]
    assert not any(len(unknown_fields.UnknownFieldSet(message)) for message in read)
    return label, header, points


def adjusted(network: MadeNetwork, **settings):
    return adjust_bundle(
        network.wrong, network.cameras, EUROPA, network.ties, network.priors, ControlSettings(**settings)
    )


def test_false_ties_are_rejected_and_true_ones_kept() -> None:
    network = made_network(12, 60, np.random.default_rng(1), false=0.1)
    bundle = adjusted(network)
    point, bad = network.ties.point, network.false
    lonely = np.bincount(point[~bad], minlength=len(network.ties.points))[point] < 2
    assert bad.sum() > 30
    assert np.mean(~bundle.used[bad]) > 0.95
    assert np.mean(bundle.used[~bad & ~lonely]) > 0.95
    assert rms_across_deg(bundle.poses, network.true) < 0.5 * rms_across_deg(network.wrong, network.true)


@pytest.mark.parametrize("free_radius", [False, True])
def test_the_stated_covariance_is_that_of_repeated_adjustments(free_radius: bool) -> None:
    pulls = []
    for seed in range(8):
        network = made_network(8, 60, np.random.default_rng(seed))
        bundle = adjusted(network, free_radius=free_radius)
        for pose, t, covariance in zip(bundle.poses, network.true, bundle.covariance, strict=True):
            turn = vector_deg_from_rotation((pose.body_from_j2000 @ t.body_from_j2000.T).T)
            pulls.append(turn @ np.linalg.solve(covariance[4:, 4:], turn))
    assert 2.0 < np.mean(pulls) < 4.5  # chi-square of three


def with_constants(network: MadeNetwork, scale: float, bent: float, known: float) -> MadeNetwork:
    """The network as cameras measure it whose focal length is longer by `scale` and that bend by `bent`; known: 1-sigma
    of the focal length that is stated."""
    xy, camera = network.ties.xy_px, network.cameras[0]
    centre, corner = np.asarray(camera.centre_px), np.hypot(*camera.size_px) / 2
    away = (1 + scale) * (xy - centre)
    ties = replace(network.ties, xy_px=centre + away * (1 + bent * (away**2).sum(axis=1, keepdims=True) / corner**2))
    stated = camera.model_copy(update={"focal_length_sigma": known})
    return replace(network, ties=ties, cameras=[stated] * len(network.cameras))


@pytest.mark.parametrize(
    ("solve", "scale", "corner_px"),
    [(("focal-length",), 0.002, 0.0), (("distortion",), 0.0, 0.8), (("focal-length", "distortion"), -0.001, -0.6)],
)
def test_planted_camera_constants_come_back_within_their_errors(solve, scale: float, corner_px: float) -> None:
    corner = np.hypot(400, 400) / 2
    pulls = []
    for seed in range(4):
        network = made_network(6, 50, np.random.default_rng(seed), turned_deg=0.05)
        bundle = adjusted(with_constants(network, scale, corner_px / corner, 3e-3), solve=solve)
        rows = constant_rows(bundle.constants, bundle.constants_covariance)
        assert len(rows) == 1
        focal, bend = rows[0]["focal_length_factor"], rows[0]["distortion"]
        assert (focal is None, bend is None) == ("focal-length" not in solve, "distortion" not in solve)
        if focal:
            pulls.append((focal["value"] - 1 - scale) / focal["sigma"])
            assert focal["sigma"] < 0.2 * focal["sigma_before"]
        if bend:
            pulls.append((bend["value"] - corner_px) / bend["sigma"])
            assert bend["sigma"] < 0.6 * bend["sigma_before"]
    assert np.mean(np.square(pulls)) < 2.5
    assert np.abs(pulls).max() < 3.5


def test_a_focal_length_is_no_better_known_than_the_ranges() -> None:
    network = with_constants(made_network(5, 40, np.random.default_rng(2)), 0.001, 0.0, 3e-4)
    priors = network.priors.copy()
    priors[:, 2, 2] = 0.02**2
    loose = adjust_bundle(network.wrong, network.cameras, EUROPA, network.ties, priors, FOCAL)
    assert loose.constants_covariance[0, 0] ** 0.5 == pytest.approx(3e-4, rel=0.05)
    firm = adjust_bundle(network.wrong, network.cameras, EUROPA, network.ties, network.priors, FOCAL)
    assert firm.constants_covariance[0, 0] ** 0.5 < 0.7 * 3e-4


def test_cameras_are_distinguished_by_name_and_focal_length() -> None:
    a = made_network(2, 10, np.random.default_rng(1)).cameras[0]
    b, c = a.model_copy(update={"name": "other"}), a.model_copy(update={"focal_length_px": 1.01 * a.focal_length_px})
    constants = constants_of([a, b, a, c], FOCAL)
    assert constants.of_image.tolist() == [0, 1, 0, 2]
    assert constants.count == 3
    moved = constants.moved(np.array([1e-3, 2e-3, 3e-3]))
    at = np.array([[0.0, 0.0]])
    centre = np.asarray(a.centre_px)
    for image, scale in enumerate((1e-3, 2e-3, 1e-3, 3e-3)):
        assert moved.measured_at(image, at) == pytest.approx(centre + (1 + scale) * (at - centre))


def test_a_store_of_another_focal_length_gives_the_camera_that_its_poses_need(tmp_path) -> None:
    chosen = [
        replace(view, camera=view.camera.model_copy(update={"focal_length_sigma": 3e-3}))
        for view in paper_views()
        if view.product in VIEWS[:3]
    ]
    stated = {"offset_px": [0.03, 0.03], "range_factor": 1e-4, "roll_deg": 0.01, "attitude_deg": [0.08] * 3}
    write_albedo_store(
        tmp_path / "s", chosen, textured(), noise=0.004, stated=stated, subpixels_across=300, focal_length_factor=1.003
    )
    known = ControlSettings(points=500, solve=("focal-length",))
    made = control_store(tmp_path / "s", known)
    factor = control_report(made)["cameras"][0]["focal_length_factor"]
    write_control(made, tmp_path / "c")
    camera = read_camera_file(tmp_path / "c" / f"{chosen[0].camera.name}.toml")
    print(f"\nfactor {factor}")
    assert camera.focal_length_px == pytest.approx(factor["value"] * chosen[0].camera.focal_length_px)
    assert camera.focal_length_sigma == pytest.approx(factor["sigma"])
    assert factor["sigma"] < factor["sigma_before"]
    assert abs(factor["value"] - 1.003) < 3 * factor["sigma"]


@pytest.mark.parametrize("solve", [(), ("focal-length", "distortion")])
def test_sparse_and_dense_factors_agree(monkeypatch, solve) -> None:
    network = made_network(8, 40, np.random.default_rng(3))
    dense = adjusted(network, solve=solve)
    monkeypatch.setattr("tasks.control.reduced.DENSE", 0)
    sparse = adjusted(network, solve=solve)
    assert sparse.point_sigma_km == pytest.approx(dense.point_sigma_km, rel=1e-6)
    assert sparse.constants_covariance == pytest.approx(dense.constants_covariance, rel=1e-6)
    assert sparse.moves == pytest.approx(dense.moves, abs=1e-8)
    assert sparse.covariance == pytest.approx(dense.covariance, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("shift", [(0.0, 0.0), (1.3, -0.6), (-2.45, 2.2)])
@pytest.mark.parametrize(("gain", "slope"), [(1.0, 0.0), (1.7, 0.4)])
def test_patches_are_matched_to_a_small_part_of_a_pixel_under_other_light(shift, gain: float, slope: float) -> None:
    import cv2

    rng = np.random.default_rng(4)
    ground = 1 + 0.1 * cv2.GaussianBlur(rng.standard_normal((320, 320)), (0, 0), 16) * 16
    y, x = np.indices((29, 29), np.float32) * 8 + 44

    def seen(dx: float, dy: float, side: int):
        half = (side - 1) // 2
        rows, columns = (np.indices((side, side), np.float32) - half) * 8
        wide = cv2.GaussianBlur(ground, (0, 0), 5)
        return cv2.remap(wide, columns + 160 - 8 * dx, rows + 160 - 8 * dy, cv2.INTER_CUBIC).astype(np.float64)

    del x, y
    second = gain * seen(*shift, 29) * np.exp(slope * np.linspace(-1, 1, 29))[None, :]
    found = match_patches(seen(0, 0, 21)[None], second[None], 4)
    assert found.good.all()
    assert found.shift[0] == pytest.approx(shift, abs=0.05)
    assert found.correlation[0] > 0.97


def test_what_cannot_be_tied_is_refused(store, tmp_path) -> None:
    for wrong in ({"law": "x"}, {"patch_px": 8}):
        with pytest.raises(WrongOptionError):
            ControlSettings(**wrong)
    with pytest.raises(RefusedError, match="ties need two"):
        control_store(store[0] / VIEWS[0], ControlSettings())
    with pytest.raises(FailedError, match="no ground that two images show matches"):
        control_store(store[0], ControlSettings(points=20, least_correlation=0.999999))
    assert issubclass(FailedError, PlanetposeError)


def test_the_command_writes_what_it_names(store, tmp_path, monkeypatch) -> None:
    import contextlib
    import sys

    monkeypatch.setattr("flows.cli.output.clean_stdout", lambda: contextlib.nullcontext(sys.stdout))
    command = ["control", str(store[0]), "--points", "200", "--kernels", "--json", "--out", str(tmp_path / "c")]
    done = CliRunner().invoke(build_app(), command)
    assert done.exit_code == 0, done.output
    report = json.loads(next(line for line in done.stdout.splitlines() if line.startswith("{")))
    assert report["images"] == len(VIEWS)
    assert {"control.net", "control.json", "images.csv", "points.csv"} <= {p.name for p in (tmp_path / "c").iterdir()}
    assert len(list((tmp_path / "c" / "kernels").rglob("*_alone.tm"))) == 3
    assert CliRunner().invoke(build_app(), [*command, "--law", "x"]).exit_code == 2
