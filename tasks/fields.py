"""Types of the fields of what steps are given and what they return, with their plain JSON."""

from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, PlainSerializer

from catalog.camera import Camera
from catalog.pose import Pose
from tasks.plain import plain

# Plain JSON whose content only the step that makes it knows: labels, evidence, histories.
Json = dict[str, Any]
# A correction's amounts or their 1-sigma, under keys such as `offset_px`; None where it is not determined,
# or has no value: a target behind the camera was at no pixel before.
Amounts = dict[str, float | list[float | None] | None]
PlainJson = Annotated[Json, BeforeValidator(plain)]
PlainAmounts = Annotated[Amounts, BeforeValidator(plain)]
PoseField = Annotated[
    Pose,
    BeforeValidator(lambda value: Pose.from_dict(value) if isinstance(value, dict) else value),
    PlainSerializer(Pose.to_dict),
]
# A key holds what the camera's file says, so that a new default of a new setting redoes nothing.
CameraField = Annotated[Camera, PlainSerializer(lambda camera: camera.model_dump(mode="json", exclude_unset=True))]


class Content(BaseModel):
    """Base of what steps are given and return: frozen, and without fields that nobody declared."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", arbitrary_types_allowed=True, ser_json_inf_nan="constants"
    )  # what is not finite is an error where it is written, not a null
