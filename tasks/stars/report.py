"""What a search for stars found, as plain JSON and as a table for people."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.plain_text import printable
from catalog.stars.table import ra_dec_deg
from catalog.times import utc_from_et
from tasks.stars.field import StarField
from tasks.stars.image import StarImage
from tasks.stars.orientation import focal_length_factor
from tasks.stars.sources import STAR
from tasks.stars.together import solved_text

Json = dict[str, Any]
Array = NDArray[np.float64]


EMPTY: Json = {
    "stars": 0,
    "rms_px": None,
    "boresight_ra_deg": None,
    "boresight_dec_deg": None,
    "camera_from_j2000": None,
    "uncertainty": None,
    "false_alarm_probability": None,
    "reason": None,
    "focal_length_factor": None,
    "region": None,
    "matches": [],
    "unidentified": [],
}


def nothing_known(image: str, reason: str) -> Json:
    """The result of an image that could not be looked at."""
    return {"image": image, **EMPTY, "reason": reason}


def in_json(found: StarImage) -> Json:
    """The result of one image. Without a lock `stars` is 0, the orientation is null and `reason` says why."""
    field, lock, observer = found.field, found.field.lock, found.observer
    content = EMPTY | {
        "false_alarm_probability": field.false_alarm,
        "reason": field.reason,
        "camera": found.camera.name,
        "utc": None if observer.et is None else utc_from_et(observer.et),
        "catalog": field.catalog,
        "distortion": field.model.name,
        "proper_motion": observer.et is not None,
        "aberration": observer.velocity_km_s is not None,
        "detections": field.strong,
        "star_image_px": [round(float(each), 3) for each in star_image_px(field.sources.shape_px2)],
        "unidentified": unidentified(field),
        "missing": list(found.missing),
        "warnings": list(found.warnings),
    }
    if lock is not None:
        orientation = lock.matched.orientation
        ra, dec = ra_dec_deg(orientation.camera_from_j2000[2])
        content |= {
            "stars": len(lock.matched.star),
            "rms_px": orientation.rms_px,
            "boresight_ra_deg": float(ra),
            "boresight_dec_deg": float(dec),
            "camera_from_j2000": orientation.camera_from_j2000.tolist(),
            "uncertainty": uncertainty(found),
            "focal_length_factor": scale(found),
            "region": lock.kind,
            "matches": matches(field, found),
        }
    return {"image": printable(found.path.name), **content}


def star_image_px(shape_px2: Array) -> Array:
    """Widths (2,), 1-sigma, of star images across and along their longer axis."""
    return np.asarray(np.sqrt(np.linalg.eigvalsh(shape_px2)))


def uncertainty(found: StarImage) -> Json:
    """1-sigma of the orientation: of the boresight in pixels and degrees, of the roll, and the covariance of small
    rotations about the camera's x, y and z axes in square degrees."""
    lock = found.field.lock
    if lock is None:
        return {}
    orientation, focal_px = lock.matched.orientation, found.camera.focal_length_px
    about_x, about_y, about_z = np.sqrt(np.diag(orientation.covariance_deg2))
    return {
        "boresight_px": [float(np.radians(about_y) * focal_px), float(np.radians(about_x) * focal_px)],
        "boresight_deg": [float(about_y), float(about_x)],
        "roll_deg": float(about_z),
        "covariance_deg2": orientation.covariance_deg2.tolist(),
        "extra_sigma_px": orientation.extra_sigma_px,
    }


def scale(found: StarImage) -> Json | None:
    """Factor of the camera's focal length that the stars ask for, and its 1-sigma; None with too few stars."""
    field, lock = found.field, found.field.lock
    if lock is None:
        return None
    seen, star = lock.matched.detection, lock.matched.star
    solved = focal_length_factor(
        found.camera, lock.matched.orientation, lock.directions[star], field.xy_px[seen], field.sigma_px[seen]
    )
    return None if solved is None else {"value": solved[0], "sigma": solved[1]}


def matches(field: StarField, found: StarImage) -> list[Json]:
    """Every identified star; `used` for those that the orientation is fitted to, the others are too faint for it."""
    lock = field.lock
    if lock is None or field.faint is None:
        return []
    detection = np.concatenate([lock.matched.detection, field.faint[0]])
    star = np.concatenate([lock.matched.star, field.faint[1]])
    turned = lock.matched.orientation.camera_from_j2000
    residual = field.xy_px[detection] - found.camera.project(lock.directions[star] @ turned.T)
    apparent, count = ra_dec_deg(lock.directions), len(lock.matched.star)
    return [
        {
            "star": str(lock.table.ident[s]),
            "x_px": float(field.xy_px[d, 0]),
            "y_px": float(field.xy_px[d, 1]),
            "image_x_px": float(field.sources.xy_px[d, 0]),
            "image_y_px": float(field.sources.xy_px[d, 1]),
            "sigma_px": float(field.sigma_px[d]),
            "ra_deg": float(apparent[s, 0]),
            "dec_deg": float(apparent[s, 1]),
            "magnitude": None if np.isnan(lock.table.magnitude[s]) else float(lock.table.magnitude[s]),
            "residual_x_px": float(residual[i, 0]),
            "residual_y_px": float(residual[i, 1]),
            "signal_to_noise": float(field.sources.signal_to_noise[d]),
            "used": i < count,
        }
        for i, (d, s) in enumerate(zip(detection, star, strict=True))
    ]


def unidentified(field: StarField) -> list[Json]:
    """Star images that stand out and are no star of the catalog, the brightest first."""
    strong = np.arange(field.strong)
    used = np.zeros(0, int) if field.lock is None else field.lock.matched.detection
    others = np.setdiff1d(strong[field.sources.kind[strong] == STAR], used)
    return [
        {
            "x_px": float(field.xy_px[d, 0]),
            "y_px": float(field.xy_px[d, 1]),
            "signal_to_noise": float(field.sources.signal_to_noise[d]),
        }
        for d in others
    ]


def as_text(content: Json) -> str:
    """The same for people."""
    if "solved" in content:
        return solved_text(content)
    if "camera" not in content:
        return f"{content['image']}: {content['reason']}"
    if not content["stars"]:
        return f"{content['image']}: no stars identified: {content['reason']}"
    head = f"{content['image']}: {content['camera']}"
    sigma = content["uncertainty"]
    lines = [
        f"{head}: {content['stars']} stars, rms {content['rms_px']:.2f} px, "
        f"boresight RA {content['boresight_ra_deg']:.5f} Dec {content['boresight_dec_deg']:.5f} deg "
        f"(+- {max(sigma['boresight_px']):.2f} px), roll +- {sigma['roll_deg']:.3f} deg; "
        f"false alarm {content['false_alarm_probability']:.0e}"
    ]
    for each in content["matches"]:
        magnitude = "    " if each["magnitude"] is None else f"{each['magnitude']:5.2f}"
        lines.append(
            f"  {each['star']:28} {magnitude} at ({each['x_px']:8.2f}, {each['y_px']:8.2f}) "
            f"off ({each['residual_x_px']:+.2f}, {each['residual_y_px']:+.2f}) px, S/N {each['signal_to_noise']:.1f}"
            + ("" if each["used"] else ", too faint to count")
        )
    return "\n".join(lines)
