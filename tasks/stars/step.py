"""The cached step: the stars of an image, which say where its camera looked."""

from dataclasses import dataclass

from pydantic import Field

from catalog.stars.observer import Observer
from catalog.stars.source import Cone
from tasks.fields import CameraField, Content, PlainJson, PoseField
from tasks.image_file import ImageInputs, frame_of
from tasks.stars.field import find_stars
from tasks.stars.image import StarImage, catalog_of
from tasks.stars.report import in_json
from tasks.stars.separate import StarOrientation, orientation_stated
from tasks.stars.settings import StarSettings
from tasks.stars.solve import CONE, PREDICTED, Region, half_diagonal_deg
from tasks.step import StepType
from tasks.undistort import UndistortSettings
from tasks.undistort.saturation import with_plate_flagged
from tasks.undistort.step import UndistortFiles, masked_by_user
from tasks.work import Work


class StarsInputs(Content):
    """What the result depends on; as of the step `undistort`, and: catalog: name of a packaged catalog or content of
    the user's. pose: the predicted one."""

    image: ImageInputs
    camera: CameraField
    undistorted: bool
    undistort: UndistortSettings
    reseau_tables: dict[str, str] = Field(default_factory=dict)
    mask: str | None = None
    catalog: str
    pose: PoseField
    settings: StarSettings = StarSettings()


@dataclass(frozen=True)
class StarsFiles(UndistortFiles):
    """catalog: the user's, a name or a file."""

    catalog: str


class StarsResult(Content):
    """found: what the search found, see `tasks.stars.report`."""

    found: PlainJson

    @property
    def orientation(self) -> StarOrientation | None:
        """The camera's orientation; None without a lock."""
        return orientation_stated(self.found)


def run(inputs: StarsInputs, files: StarsFiles, _: Work) -> StarsResult:
    """The stars near the predicted orientation, else around the target's predicted direction at any roll. No stars are
    a result."""
    frame, camera, pose = frame_of(inputs.image, files), inputs.camera, inputs.pose
    target = pose.target_from_spacecraft_km / pose.range_km
    search = inputs.settings.identification
    regions = [
        Region(PREDICTED, Cone(pose.camera_from_j2000[2], search.predicted_deg), pose.camera_from_j2000),
        Region(CONE, Cone(target, half_diagonal_deg(camera) + search.predicted_deg)),
    ]
    observation = with_plate_flagged(masked_by_user(files.mask, frame))
    observer = Observer(pose.et, pose.spacecraft_velocity_km_s)
    catalog = catalog_of(files.catalog, {}, None)
    found = find_stars(
        observation, camera, catalog, observer, regions, inputs.settings, inputs.undistort, inputs.undistorted
    )
    return StarsResult(found=in_json(StarImage(files.image, camera, observation, observer, found)))


STEP = StepType(
    "stars",
    run,
    StarsResult,
    labels={"mask": "mask", "reseau_tables": "catalog: reseau tables", "catalog": "star catalog"},
)
