"""What the corrections share: what they are given, and their result as a record keeps it."""

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any, Self, TypeVar

from pydantic import BaseModel, Field

from catalog.pose import Pose
from tasks.correction import FORMAL, Correction
from tasks.fields import Amounts, Content, Json, PlainAmounts, PlainJson, PoseField
from tasks.priors import PriorSettings
from tasks.scene_inputs import SceneFiles, SceneInputs
from tasks.stars.separate import StarOrientation
from tasks.step import Changed, StepType
from tasks.work import Work


@dataclass(frozen=True)
class Known:
    """All that is known of an image before a correction; each takes what its inputs name.

    pose: what the steps so far ended with; predicted: the metadata's, pose_sources: where its parts come from.
    attitude_prior_deg: 1-sigma of the predicted orientation, None where nothing is known of it. search_frame: whether
    the target may be anywhere in the frame. markings_match: False where an attitude step found markings in the image
    that are not the map's. image_moved: whether the image was displaced by what the disk showed of its distortion.
    own_priors: of the predicted pose, None for those of its sources; priors: whichever hold.
    """

    scene: SceneInputs
    pose: Pose
    predicted: Pose
    pose_sources: dict[str, str]
    attitude_prior_deg: float | None
    search_frame: bool = True
    markings_match: bool = True
    image_moved: bool = False
    own_priors: PriorSettings | None = None
    priors: PriorSettings = field(default_factory=PriorSettings)

    def separated(self, stars: StarOrientation | None) -> Self:
        """The same with the camera as the stars have it, and the target moved in its place; itself without stars."""
        return self if stars is None else replace(self, pose=stars.separated(self.pose, self.predicted))


class CorrectionInputs(Content):
    """Base of a correction's inputs: fields of `Known`, and `settings`, whose model each correction names."""

    scene: SceneInputs
    pose: PoseField

    @classmethod
    def of(cls, known: Known, settings: BaseModel) -> Self:
        """The inputs of a correction with `settings`."""
        named = {each.name for each in fields(known)} & set(cls.model_fields)
        return cls.model_validate({"settings": settings, **{name: getattr(known, name) for name in named}})


class CorrectionResult(Content):
    """A Correction, see there, as a record keeps it. image_moved: the step also left a better image, which belongs to
    its pose, in its folder. markings_match: whether the markings in the image are the map's; None where the step
    did not look."""

    pose: PoseField
    changed: PlainAmounts
    uncertainty: PlainAmounts = Field(default_factory=dict)
    evidence: PlainJson = Field(default_factory=dict)
    converged: bool = True
    image_moved: bool = False
    markings_match: bool | None = None

    @property
    def doubt(self) -> str | None:
        """Why the correction is doubtful, as `code: fault. Remedy.`; None when nothing speaks against it."""
        return self.evidence.get("doubt") or None

    @property
    def formal(self) -> Amounts:
        """1-sigma by the scatter of the residuals alone, or what is stated where nobody stated that."""
        formal: Json | None = self.evidence.get(FORMAL)
        return formal or self.uncertainty

    def to_dict(self) -> Json:
        """What a product says of it: all but the pose, as plain JSON."""
        return self.model_dump(mode="json", exclude={"pose"})


C = TypeVar("C", bound=CorrectionInputs)
CorrectionStep = StepType[Any, SceneFiles, CorrectionResult]


def correction_inputs(step: CorrectionStep, known: Known, settings: BaseModel) -> CorrectionInputs:
    """What a correction is given of all that is known."""
    model: type[CorrectionInputs] = step.inputs
    return model.of(known, settings)


def correction_step(
    name: str,
    body: Callable[[C, SceneFiles, Work], CorrectionResult],
    settings: type[BaseModel],
    changes: frozenset[Changed],
    parameters: frozenset[str] = frozenset(),
) -> StepType[C, SceneFiles, CorrectionResult]:
    """The type of a correction's step, see `StepType`."""
    labels = {"scene.basemap": "base map"}
    return StepType(name, body, CorrectionResult, settings, changes, parameters, labels)


def recorded(correction: Correction, image_moved: bool = False, markings_match: bool | None = None) -> CorrectionResult:
    """A Correction as its record keeps it."""
    return CorrectionResult(
        pose=correction.pose,
        changed=correction.changed,
        uncertainty=correction.uncertainty,
        evidence=correction.evidence,
        converged=correction.converged,
        image_moved=image_moved,
        markings_match=markings_match,
    )
