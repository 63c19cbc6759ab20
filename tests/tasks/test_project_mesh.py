"""Shape models: against SPICE's own DSK ray tracing, against the ellipsoid, and their shadows against brute force."""

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
import spiceypy
from scipy.spatial.transform import Rotation

from catalog.camera import Camera
from catalog.errors import RefusedError
from catalog.pose import Pose
from catalog.spice import kernel_pool
from catalog.target import Target
from lab.benchmark.spice_oracle import BODY, BODY_ID, FRAME, SPACECRAFT, write_kernels
from tasks.project.backplanes import ANGLES, SUNLIT
from tasks.project.mesh import Mesh, mesh_of, read_mesh
from tasks.project.mesh_radial import outermost_points
from tasks.project.more_planes import more_planes
from tasks.project.pixels import project_pixels
from tasks.project.places import pixels_of_places
from tasks.project.planes import project_planes
from tasks.project.points import latitude_longitude
from tasks.project.shaped import mesh_seen

CAMERA = Camera(name="test", size_px=(120, 100), centre_px=(57.0, 52.0), focal_length_px=6e4)
RADII = (12.0, 12.0, 12.0)


def sphere_mesh(n: int) -> Mesh:
    """4 n^2 triangles on the unit sphere, between parallels and meridians."""
    latitude, longitude = np.meshgrid(np.linspace(-90, 90, n + 1), np.arange(2 * n) * 180 / n, indexing="ij")
    lat, lon = np.radians(latitude).ravel(), np.radians(longitude).ravel()
    vertices = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=1)
    row, column = np.meshgrid(np.arange(n), np.arange(2 * n), indexing="ij")
    a, b = row * 2 * n + column, row * 2 * n + (column + 1) % (2 * n)
    corners = [np.stack([a, b, b + 2 * n], -1), np.stack([a, b + 2 * n, a + 2 * n], -1)]
    faces = np.concatenate([f.reshape(-1, 3) for f in corners])
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return Mesh(vertices, faces[area > 1e-9])


def lumpy_mesh(n: int) -> Mesh:
    """Two lobes with a neck between them: parts of the body hide and shade others."""
    sphere = sphere_mesh(n)
    x, y, z = sphere.vertices_km.T
    scale = 5.0 + 6.5 * x**2 + 0.8 * y + 0.6 * np.sin(5 * z)
    return Mesh(sphere.vertices_km * scale[:, None], sphere.faces)


def write_obj(mesh: Mesh, path: Path) -> Path:
    lines = [f"v {x:.9f} {y:.9f} {z:.9f}\n" for x, y, z in mesh.vertices_km]
    path.write_text("".join([*lines, *(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in mesh.faces)]))
    return path


def write_dsk(mesh: Mesh, path: Path) -> Path:
    """A DSK kernel as NAIF's own tools write it."""
    with TemporaryDirectory() as folder, kernel_pool([]):
        write_kernels(pose_of(), Target(name="pebble", naif_id=BODY_ID, radii_km=RADII), Path(folder))
        with kernel_pool([Path(folder)]):  # for the name of its frame
            _write_dsk(mesh, path)
    return path


def _write_dsk(mesh: Mesh, path: Path) -> None:
    vertices, plates = mesh.vertices_km.copy(), (mesh.faces + 1).astype(np.int32)
    low, high = spiceypy.dskrb2(vertices, plates, 1, np.zeros(10))
    index_d, index_i = spiceypy.dskmi2(vertices, plates, 5.0, 4, 200000, 100000, 200000, True, 500000)
    handle = spiceypy.dskopn(str(path), "test", 0)
    latitudes, longitudes = (-np.pi / 2, np.pi / 2), (-np.pi, np.pi)
    spiceypy.dskw02(
        handle, BODY_ID, 1, 1, FRAME, 1, np.zeros(10), *longitudes, *latitudes, low, high, -1e9, 1e9, vertices, plates,
        index_d, index_i,
    )  # fmt: skip
    spiceypy.dskcls(handle, True)


def pose_of(sun=(6e8, 5e8, -3e8)) -> Pose:
    camera_from_j2000, body_from_j2000 = Rotation.from_rotvec([(0.3, 1, -2), (1, 0.2, 0.5)]).as_matrix()
    centre = CAMERA.ray(np.add(CAMERA.centre_px, (4.0, -3.0)))
    return Pose(0.0, camera_from_j2000, camera_from_j2000.T @ centre * 18100.0, sun, body_from_j2000)


@pytest.fixture(scope="module")
def lumpy(tmp_path_factory) -> Target:
    path = write_dsk(lumpy_mesh(40), tmp_path_factory.mktemp("shape") / "lumpy.bds")
    return Target(name="pebble", naif_id=BODY_ID, radii_km=RADII).with_shape(path)


@pytest.fixture(scope="module")
def planes(lumpy):
    return project_planes(pose_of(), CAMERA, lumpy, planes=(*ANGLES, "range_km", SUNLIT))


def test_a_dsk_comes_back_as_it_was_written(lumpy):
    expected, found = lumpy_mesh(40), mesh_of(lumpy)
    assert np.array_equal(found.faces, expected.faces)
    assert np.array_equal(found.vertices_km, expected.vertices_km)


def test_every_pixel_is_spices_on_the_same_plates(lumpy, planes, tmp_path):
    pose = pose_of()
    rows, columns = np.nonzero(planes.on_body)
    chosen = np.random.default_rng(0).choice(len(rows), 300, replace=False)
    off = []
    with kernel_pool([]), spiceypy.no_found_check():
        write_kernels(pose, lumpy, tmp_path)
        with kernel_pool([tmp_path, Path(lumpy.shape)]):
            how = ("DSK/UNPRIORITIZED", BODY, pose.et, FRAME, "NONE", SPACECRAFT)
            for x, y in zip(columns[chosen], rows[chosen], strict=True):
                point, _, _, found = spiceypy.sincpt(*how, "J2000", pose.camera_from_j2000.T @ CAMERA.ray([x, y]))
                assert found
                _, _, phase, incidence, emission = spiceypy.ilumin(*how, point)
                _, longitude, latitude = spiceypy.reclat(point)
                theirs = np.degrees([latitude, longitude, incidence, emission, phase])
                difference = np.abs((theirs - [planes[n][y, x] for n in ANGLES] + 180) % 360 - 180)
                off.append(difference * [1, np.cos(latitude), 1, 1, 1])
    largest = np.sort(np.max(off, axis=1))
    print(f"300 pixels on {len(lumpy_mesh(40).faces)} plates: 99 % within {largest[-4]:.1e} deg, the bar is 1e-6")
    assert largest[-4] < 1e-6  # where single precision takes the neighbour along an edge, angles jump


def test_places_between_pixels_are_traced_one_by_one(lumpy, planes):
    xy = np.stack(np.meshgrid(np.arange(30, 90, 4), np.arange(20, 80, 4)), axis=-1).astype(float)
    whole = project_pixels(pose_of(), CAMERA, lumpy, xy, ANGLES)
    beside = project_pixels(pose_of(), CAMERA, lumpy, xy + 1e-6, ANGLES)
    x, y = xy.reshape(-1, 2).astype(int).T
    assert np.array_equal(whole["latitude"].ravel(), planes.latitude[y, x], equal_nan=True)
    both = np.isfinite(whole["latitude"]) & np.isfinite(beside["latitude"])
    assert both.sum() > 60
    assert (np.isfinite(whole["latitude"]) == np.isfinite(beside["latitude"])).mean() > 0.99
    assert np.median(np.abs(whole["latitude"] - beside["latitude"])[both]) < 1e-5
    nowhere = project_pixels(pose_of(), CAMERA, lumpy, np.full((3, 2), np.nan), ANGLES)
    assert np.isnan(nowhere["latitude"]).all()


def hidden_from_sun(mesh: Mesh, points: np.ndarray, sun: np.ndarray) -> np.ndarray:
    """Whether another triangle lies between each point and the Sun, by Moeller and Trumbore's test of all triangles."""
    a, b, c = (mesh.vertices_km[mesh.faces[:, i]] for i in range(3))
    d = sun / np.linalg.norm(sun)
    across = np.cross(d, c - a)
    determinant = np.einsum("ij,ij->i", b - a, across)
    found = []
    for point in points:
        s = point - a
        u = np.einsum("ij,ij->i", s, across) / determinant
        q = np.cross(s, b - a)
        v, t = q @ d / determinant, np.einsum("ij,ij->i", q, c - a) / determinant
        found.append(bool(((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-4)).any()))
    return np.array(found)


def test_shadows_are_those_of_brute_force(lumpy):
    pose, mesh = pose_of(sun=(0.0, -6e8, 0.0)), mesh_of(lumpy)  # low over the body: one lobe shades the other
    on_body, seen = mesh_seen(pose, CAMERA, lumpy, (0, 0, *CAMERA.size_px), shadows=True)
    facing = np.nonzero(seen.incidence < 90)[0]
    shaded = hidden_from_sun(mesh, seen.points_km[facing], seen.sun_km)
    found = ~seen.sunlit[facing]
    print(
        f"{shaded.sum()} of {len(facing)} pixels that face the Sun are shaded; {(found != shaded).sum()} found wrongly"
    )
    assert shaded.sum() > 30
    assert (found != shaded).sum() <= 3  # along a shadow's edge
    assert np.array_equal(project_planes(pose, CAMERA, lumpy, planes=(SUNLIT,)).illuminated[on_body], seen.sunlit)
    shadow = more_planes(pose, CAMERA, lumpy, np.argwhere(on_body)[:, ::-1].astype(float), ("shadow",))["shadow"]
    assert np.array_equal(shadow == 0, seen.sunlit)


def test_a_sphere_of_triangles_is_the_sphere(tmp_path):
    sphere = Target(name="ball", naif_id=1, radii_km=RADII)
    mesh = sphere_mesh(120)
    shaped = sphere.with_shape(write_obj(Mesh(mesh.vertices_km * 12.0, mesh.faces), tmp_path / "ball.obj"))
    ours, exact = (project_planes(pose_of(), CAMERA, t, planes=ANGLES) for t in (shaped, sphere))
    assert (ours.on_body != exact.on_body).sum() <= 3
    both = ours.on_body & exact.on_body & (exact.emission < 60)
    facet_deg = 180 / 120
    for name, bar in {"latitude": 0.02, "incidence": facet_deg, "emission": facet_deg, "phase": 1e-3}.items():
        off = np.abs(ours[name] - exact[name])[both].max()
        print(f"{len(mesh.faces)} triangles, emission below 60 deg: {name} within {off:.4f} deg, the bar is {bar}")
        assert off < bar


def test_shape_models_that_cannot_be_used_are_refused(tmp_path):
    target = Target(name="ball", naif_id=1, radii_km=RADII)
    with pytest.raises(RefusedError, match="cannot be read"):
        target.with_shape(tmp_path / "none.obj")
    (tmp_path / "half.bds").write_bytes(b"DAS/DSK half a file")
    with pytest.raises(RefusedError, match=r"half\.bds"):
        read_mesh(tmp_path / "half.bds")
    (tmp_path / "mesh.stl").write_text("solid")
    with pytest.raises(RefusedError, match="is of no known kind"):
        read_mesh(tmp_path / "mesh.stl")
    metres = sphere_mesh(4)
    path = write_obj(Mesh(metres.vertices_km * 12000.0, metres.faces), tmp_path / "metres.obj")
    with pytest.raises(RefusedError, match=r"reaches 12000 km.*kilometres"):
        mesh_of(target.with_shape(path))
    dsk = write_dsk(lumpy_mesh(8), tmp_path / "other.bds")
    with pytest.raises(RefusedError, match=r"no plates .* of body 1"):
        read_mesh(dsk, 1)
    beside = pose_of().replaced(target_from_spacecraft_km=pose_of().camera_from_j2000[0] * 18000.0)
    with pytest.raises(RefusedError, match="not in front of"):
        project_planes(beside, CAMERA, target.with_shape(write_obj(lumpy_mesh(8), tmp_path / "l.obj")))


def test_places_of_a_shape_model_are_seen_or_hidden_by_its_hills(lumpy):
    """Pixels and places belong together both ways; brute force says where another part of the body is in front."""
    rng, pose = np.random.default_rng(4), pose_of()
    planes = project_planes(pose, CAMERA, lumpy, planes=("latitude", "longitude", "emission"))
    ys, xs = np.nonzero(planes.emission < 75)
    chosen = rng.integers(0, len(ys), 150)
    xy = np.column_stack([xs[chosen], ys[chosen]])
    at = [planes[name][xy[:, 1], xy[:, 0]] for name in ("latitude", "longitude")]
    found = pixels_of_places(pose, CAMERA, lumpy, *at)
    same = np.abs(found - xy).max(axis=1) < 1e-5
    assert same.mean() > 0.95  # a few lie below an overhang or on an edge

    latitude, longitude = np.degrees(np.arcsin(rng.uniform(-1, 1, 150))), rng.uniform(0, 360, 150)
    found, points = (
        pixels_of_places(pose, CAMERA, lumpy, latitude, longitude),
        outermost_points(mesh_of(lumpy), latitude, longitude),
    )
    np.testing.assert_allclose(latitude_longitude(points), [latitude, longitude], atol=1e-9)
    hidden = hidden_from_sun(mesh_of(lumpy), points, pose.spacecraft_in_body_km)
    assert 20 < np.count_nonzero(hidden) < 130
    assert (np.isnan(found[:, 0]) == hidden).mean() > 0.97  # rounding decides along outlines
