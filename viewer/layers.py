"""What is drawn over an image beside the target's own curves: other bodies, rings, stars, shifts of the markings."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.pose import Pose
from tasks.bodies.placed import Body, bodies_of, in_frame
from tasks.pictures.flow_vectors import flow_vectors
from tasks.project.curves import limb
from tasks.publish.cube_model import CubeModel, model_of
from viewer.planes import Planes

Places = list[list[float] | None]
DIGITS = 3
LIMB_POINTS, RING_POINTS = 360, 720


def places_on(model: CubeModel, xy: Any) -> Places:
    """Places (n, 2) of the undistorted frame as pixels of the image; None where it has none."""
    places = model.pixels_of(np.asarray(xy, dtype=np.float64).reshape(-1, 2))
    known = np.asarray(np.isfinite(places).all(axis=-1))
    rounded = np.round(np.where(known[:, None], places, 0.0), DIGITS).tolist()
    return [place if there else None for place, there in zip(rounded, known, strict=True)]


def others_of(model: CubeModel, measured: Any) -> list[dict[str, Any]]:
    """Other bodies of the frame: name, limb, edges of rings; and what the result says of where each was measured.
    measured: `bodies` of the result."""
    if not model.pose.bodies and not model.target.rings:
        return []
    stated = {each.get("name"): each for each in measured or () if isinstance(each, dict)}
    bodies = [body for body in bodies_of(model.pose, model.target) if in_frame(body, model.camera)]
    return [
        other_of(model, body, stated.get(body.target.name, {})) for body in bodies if body.place or body.target.rings
    ]


def other_of(model: CubeModel, body: Body, stated: dict[str, Any]) -> dict[str, Any]:
    """One of them."""
    found: dict[str, Any] = {"name": body.target.name, "limb": [], "why_not": stated.get("why_not")}
    if body.place is not None:
        outline = limb(body.pose, model.camera, body.target, LIMB_POINTS).xy_px
        found["limb"] = places_on(model, np.vstack([outline, outline[:1]]))
    found["rings"] = [
        places_on(model, circle(model, body.pose, radius))
        for ring in body.target.rings
        for radius in (ring.inner_km, ring.outer_km)
    ]
    for name in ("predicted_px", "measured_px"):
        found[name] = places_on(model, stated[name])[0] if stated.get(name) else None
    return found


def circle(model: CubeModel, pose: Pose, radius_km: float) -> NDArray[np.float64]:
    """A circle in the body's equator, pixels (n, 2); NaN behind the camera."""
    angle = np.linspace(0, 2 * np.pi, RING_POINTS)
    points = radius_km * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=-1)
    seen = (points @ pose.body_from_j2000 + pose.target_from_spacecraft_km) @ pose.camera_from_j2000.T
    return np.asarray(model.camera.project(seen))


def stars_of(model: CubeModel, stars: Any) -> list[dict[str, Any]]:
    """Star images: where each was measured, and of identified ones name, residual and magnitude. stars: `stars` of the
    result."""
    listed = [*(stars.get("matches") or ()), *(stars.get("unidentified") or ())] if isinstance(stars, dict) else []
    found = [each for each in listed if isinstance(each, dict) and "x_px" in each]
    places = places_on(model, [[each["x_px"], each["y_px"]] for each in found])
    names = ("star", "magnitude", "used", "residual_x_px", "residual_y_px")
    return [{name: each.get(name) for name in names} | {"xy": xy} for each, xy in zip(found, places, strict=True) if xy]


def flow_of(planes: Planes, product: str) -> dict[str, Any]:
    """Shifts of the markings from the simulation of the corrected pose to the image, [[x, y, dx, dy, correlation]] in
    pixels of the image, and what share of the markings matched. Raises PlanetposeError where nothing can be
    compared."""
    scene, model = planes.scene_of(product), model_of(planes.cube(product))
    with planes.simulating:
        vectors = flow_vectors(scene, scene.after)
    ends = [places_on(model, at) for at in (vectors.xy_px, vectors.xy_px + vectors.shift_px)]
    rows = [
        [*start, end[0] - start[0], end[1] - start[1], float(quality)]
        for start, end, quality in zip(*ends, vectors.correlation, strict=True)
        if start and end
    ]
    lengths = [float(np.hypot(row[2], row[3])) for row in rows]
    median = float(np.median(lengths)) if lengths else None
    return {"vectors": rows, "places": vectors.places, "share": vectors.share, "median_px": median}
