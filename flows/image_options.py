"""What may be given for an image beside what its file says, and what all models of options share.

A field's description, bounds and default are the command line's and those of Prefect's page; `Cli` adds what only a
command line needs. Nothing heavy is imported here, so that `--help` comes at once.
"""

from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, FiniteFloat

Limits = tuple[FiniteFloat, FiniteFloat]
Text = str | None
File = Path | None


@dataclass(frozen=True)
class Cli:
    """How the command line spells a field. names: of the option, where they are not the field's; argument: it has no
    name; metavar: in the help; text: its value is one text; folder: it must be a folder that is there."""

    names: tuple[str, ...] = ()
    argument: bool = False
    metavar: str | None = None
    text: bool = False
    folder: bool = False


def opt(default: Any = None, *, description: str, **bounds: Any) -> Any:
    """A field with its help; `...` for one that must be given."""
    return Field(default, description=description, **bounds)


def two_numbers(given: Any) -> Any:
    """`DX,DY` as two numbers. Raises ValueError for a text that is something else."""
    if not isinstance(given, str):
        return given
    try:
        x, y = (float(part) for part in given.split(","))
    except ValueError as error:
        raise ValueError(f"{given!r} is not two numbers.") from error
    if not isfinite(x) or not isfinite(y):
        raise ValueError(f"{given!r} is not finite.")
    return x, y


def known_flip(name: str | None) -> str | None:
    """The name of a way to flip a picture. Raises ValueError for another."""
    from catalog.flips import PLACES

    if name is not None and name not in PLACES:
        raise ValueError(f"{name!r} is none of {', '.join(PLACES)}.")
    return name


def four_numbers(given: Any) -> Any:
    """`X,Y,W,H` as whole numbers. Raises ValueError for a text that is something else, or no part of a detector."""
    if not isinstance(given, str):
        return given
    try:
        x, y, width, height = (int(part) for part in given.split(","))
    except ValueError as error:
        raise ValueError(f"{given!r} is not four whole numbers.") from error
    if min(x, y) < 0 or min(width, height) < 1:
        raise ValueError(f"{given!r} is no part of a detector.")
    return x, y, width, height


class Options(BaseModel):
    """What every command's options are: frozen, and no others."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=True, defer_build=True)


class ImageOptions(Options):
    """What may be given for an image, beside what its file says."""

    camera: Text = opt(description="Camera name, FILE.toml, kernels:NAME, isd:FILE or isis:FILE; overrides the label.")
    target: Text = opt(description="Target name, or FILE.toml; overrides the label.")
    pose_file: Annotated[File, Cli(("--pose",))] = opt(
        description="Pose file (JSON); it overrides kernels and label. Or image: find the pose in the image."
    )
    basemap: Annotated[File, Cli(("--map",))] = opt(
        description="Base map: an equirectangular picture of the whole body; or none."
    )
    map_left_edge_deg: float = opt(0.0, ge=-360, le=360, description="East longitude of the map's left edge.")
    body: tuple[str, ...] = opt(
        (), description="Another body in the frame; repeat for more; or none. Default: all that kernels cover."
    )
    shape: File = opt(description="Shape model in km, for the planes: DSK kernel, OBJ or PLY.")
    start_offset_px: Annotated[
        Limits | None, BeforeValidator(two_numbers), Cli(("--start-offset",), metavar="DX,DY", text=True)
    ] = opt(description="Pixels to add to the predicted centre; the frame is then not searched.")
    mask: File = opt(description="Picture of the size of the raw image; pixels that are not 0 are not used.")
    flip: Annotated[Text, AfterValidator(known_flip), Cli(metavar="HOW")] = opt(
        description="The picture is mirrored or turned: x, y, rot90, rot180, ... (see docs)."
    )
    plane: Text = opt(description="Plane of a file with several planes: its number, from 1, or its name.")
    summing: int | None = opt(ge=1, le=32, description="Number of detector pixels along each side of an image pixel.")
    window: Annotated[
        tuple[int, int, int, int] | None, BeforeValidator(four_numbers), Cli(metavar="X,Y,W,H", text=True)
    ] = opt(description="Part of the detector in the file, in detector pixels from 0.")
    stars: Text = opt(
        description="Measure the camera's orientation from stars of this catalog: gaia, hipparcos, or a file."
    )
    resume: File = opt(description="Product folder, result.json or store to start from.")
