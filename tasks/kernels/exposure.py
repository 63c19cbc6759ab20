"""What a kernel set is made of: one corrected exposure, read from its product or given."""

import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from catalog.camera import Camera, camera_from_dict
from catalog.errors import RefusedError
from catalog.plain_files import own_json
from catalog.pose import Pose
from catalog.reasons import Reason
from catalog.regular_file import read_regular_text
from catalog.target import Target
from tasks.project.sight import LIGHT_KM_PER_S
from tasks.publish.contained import DAMAGE, refuse_what_is_elsewhere
from tasks.publish.names import CUBE

GROUP = f"{CUBE}/zarr.json"
UNKNOWN_EXPOSURE_S = 1.0  # coverage when nobody knows the exposure time
Vector = NDArray[np.float64]


@dataclass(frozen=True)
class Exposure:
    """One image: its corrected pose, and where it came from (plain JSON, for the kernels' comments)."""

    product: str
    camera: Camera
    target: Target
    pose: Pose
    exposure_s: float = UNKNOWN_EXPOSURE_S
    origin: dict[str, Any] = field(default_factory=dict)

    @property
    def moving(self) -> bool:
        """Whether the velocities of spacecraft and target are known."""
        return self.pose.spacecraft_velocity_km_s is not None

    @property
    def velocities_km_s(self) -> tuple[Vector, Vector]:
        """Of spacecraft and target relative to the solar system's barycentre; both at rest when nobody knows them."""
        spacecraft, target = self.pose.spacecraft_velocity_km_s, self.pose.target_velocity_km_s
        rest = np.zeros(3)
        return rest if spacecraft is None else spacecraft, rest if target is None else target

    @property
    def light_time_s(self) -> float:
        """From the target's centre to the spacecraft."""
        return self.pose.range_km / LIGHT_KM_PER_S

    @property
    def emission_et(self) -> float:
        """When the light left the target's centre, TDB seconds past J2000."""
        return self.pose.et - self.light_time_s

    @property
    def true_target_from_spacecraft_km(self) -> Vector:
        """The pose's apparent vector without stellar aberration (3,): from the spacecraft at the exposure to where the
        target was when the light left it."""
        return without_aberration(self.pose.target_from_spacecraft_km, self.velocities_km_s[0])

    @property
    def true_sun_from_target_km(self) -> Vector:
        """The pose's Sun without stellar aberration (3,)."""
        return without_aberration(self.pose.sun_from_target_km, self.velocities_km_s[1])


def without_aberration(apparent_km: Vector, observer_velocity_km_s: Vector) -> Vector:
    """The vector that SPICE's STELAB turns into `apparent_km` (3,) for an observer of that velocity."""
    length = np.linalg.norm(apparent_km)
    direction = apparent_km / length - observer_velocity_km_s / LIGHT_KM_PER_S
    return np.asarray(direction * (length / np.linalg.norm(direction)), dtype=np.float64)


def read_exposure(folder: Path) -> Exposure:
    """The exposure of a product folder. Raises RefusedError when it holds no readable cube."""
    path = Path(folder) / GROUP
    refuse_what_is_elsewhere(Path(folder))
    try:
        attributes = own_json(read_regular_text(path))["attributes"]
        nested = {key: own_json(attributes[key]) for key in ("provenance", "settings", "pose_after")}
        camera = camera_from_dict(own_json(attributes["camera_model"]), f"of the cube in {folder}")
        target = Target.model_validate(own_json(attributes["target_model"]))
        target = target.model_copy(update={"shape": None})  # kernels hold radii; a shape model is a DSK of its own
        pose = Pose.from_dict(nested["pose_after"])
    except DAMAGE as error:
        raise RefusedError(
            Reason.PRODUCT_UNREADABLE,
            f"{path} is not the metadata of a cube ({type(error).__name__}: {error}).",
            "Give a product's folder, or a store, as written by `planetpose correct`.",
        ) from error
    image = nested["provenance"].get("image", {})
    return Exposure(
        product=attributes["product"],
        camera=camera,
        target=target,
        pose=pose,
        exposure_s=float(image.get("exposure_s") or UNKNOWN_EXPOSURE_S),
        origin=_origin(attributes, nested),
    )


def _origin(attributes: dict[str, Any], nested: dict[str, Any]) -> dict[str, Any]:
    settings = json.dumps(nested["settings"], sort_keys=True)
    provenance = nested["provenance"]
    return {
        "image_sha256": provenance.get("image", {}).get("sha256"),
        "written_by": attributes.get("source"),
        "history": attributes.get("history"),
        "uncertainty": _without_matrix(own_json(attributes.get("uncertainty", "{}"))),
        "kernels": [_name_of(kernel) for kernel in provenance.get("kernels", [])],
        "initial_pose": provenance.get("initial_pose", {}).get("sources"),
        "settings_sha256": hashlib.sha256(settings.encode()).hexdigest(),
        "profile": nested["settings"].get("name"),
    }


def _without_matrix(uncertainty: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in uncertainty.items() if key not in ("covariance", "parameters")}


def _name_of(kernel: Any) -> Any:
    return kernel.get("name") if isinstance(kernel, dict) else kernel[0]
