"""The cached step: read an image file's metadata, and name its camera and target."""

from pydantic import Field

from catalog.camera import find_camera
from catalog.conditions import temperature_of_label
from catalog.errors import RefusedError
from catalog.image_mode import FULL_FRAME
from catalog.observation import Frame
from catalog.reasons import Reason
from tasks.fields import CameraField, Content, Json
from tasks.image_file import ImageFiles, ImageInputs, frame_of
from tasks.plain import plain
from tasks.step import StepType
from tasks.work import Work

MAX_LABEL_VALUES = 2000


class IngestInputs(Content):
    """What the result depends on. camera: the user's, or the content of all cameras whose names labels may bear.
    target_names: content of the catalog's target files, whose spellings labels are compared with."""

    image: ImageInputs
    camera: CameraField | str
    target_names: str
    product: str


class IngestResult(Content):
    """What the file says of itself. et: mid-exposure, None when unknown. undistorted: the frame is already in the
    camera's undistorted geometry. overruled: what the label says otherwise than the user. warnings: a sentence
    each. mode: summing and window, in words. sources: where each value came from."""

    product: str
    sha256: str
    format: str
    camera: CameraField
    target_name: str
    et: float | None
    exposure_s: float | None
    filter: str | None
    undistorted: bool
    label: Json
    overruled: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    mode: str = str(FULL_FRAME)
    sources: dict[str, str] = Field(default_factory=dict)


def run(inputs: IngestInputs, files: ImageFiles, _: Work) -> IngestResult:
    """What the image's file says of itself, its camera and its target; pixels stay in the file.

    Raises RefusedError when camera or target stay unknown."""
    frame = frame_of(inputs.image, files)
    if frame.camera is None:
        if frame.label.get("SCANTYPE") == "TDI":
            raise RefusedError(
                Reason.CAMERA_UNKNOWN,
                f"image {frame.path}: SCANTYPE = TDI: its lines were exposed one after the other while the spacecraft "
                "turned, and no camera of one moment, whatever --camera names, has its geometry.",
                "Give a frame of a framing detector (of New Horizons: LORRI, or MVIC's framing array), or correct the "
                "scan with a line-scan model, such as ISIS has.",
            )
        why = f", and {frame.unclear['camera']}" if "camera" in frame.unclear else ""
        raise RefusedError(
            Reason.CAMERA_UNKNOWN,
            f"image {frame.path}: its label names no camera of the catalog{why}.",
            "Give --camera NAME (see `planetpose cameras`), FILE.toml, kernels:NAME or isd:FILE.json.",
        )
    if frame.target is None:
        fault = frame.unclear.get("target", "its label names no target")
        raise RefusedError(
            Reason.TARGET_UNKNOWN,
            f"image {frame.path}: {fault}.",
            "Say which body is meant: --target NAME or FILE.toml.",
        )
    camera = find_camera(str(files.camera or frame.camera)).at(frame.filter, temperature_of_label(frame.label))
    return IngestResult(
        product=frame.product,
        sha256=frame.sha256,
        format=frame.format,
        camera=camera.summed(frame.mode.summing),
        target_name=frame.target,
        et=frame.et,
        exposure_s=frame.exposure_s,
        filter=frame.filter,
        undistorted=frame.undistorted,
        label=printable_label(frame),
        overruled=frame.overruled,
        warnings=frame.warnings,
        mode=str(frame.mode),
        sources=frame.sources,
    )


def printable_label(frame: Frame) -> Json:
    """The label as plain values; what JSON cannot hold becomes text."""
    label: Json = {}
    for key, value in list(frame.label.items())[:MAX_LABEL_VALUES]:
        try:
            label[str(key)] = plain(value)
        except TypeError:
            label[str(key)] = str(value)
    return label


STEP = StepType(
    "ingest",
    run,
    IngestResult,
    labels={
        "image.sha256": "image",
        "image.label": "label",
        "image.target": "target",
        "image.flip": "flip",
        "image.reader": "reader",
        "image.plane": "plane",
        "image.summing": "summing",
        "image.window": "window",
        "camera": "camera",
        "target_names": "catalog: targets",
    },
)
