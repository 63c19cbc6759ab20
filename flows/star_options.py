"""What users choose of the commands on stars; as `flows.options`."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator

from flows.image_options import Cli, File, Text, known_flip, opt
from flows.options import KernelOptions, OneStore, comma_list

Solvable = Literal["focal-length", "distortion"]


class StarsOptions(KernelOptions):
    """Identify the stars of images and find the camera's orientation; no target is needed."""

    files: Annotated[tuple[Path, ...], Cli(argument=True)] = opt(..., description="Image files.")
    catalog: str = opt("gaia", description="gaia, hipparcos, or a FITS, VOTable, CSV or Parquet file.")
    columns: Annotated[tuple[str, ...], BeforeValidator(comma_list), Cli(metavar="NAME=COLUMN,...", text=True)] = opt(
        (), description="Columns of the file: ra_deg, dec_deg, magnitude, pm_ra_mas, pm_dec_mas, parallax_mas, ident."
    )
    epoch: float | None = opt(ge=1800, le=2200, description="Julian year of the file's directions; default 2000.")
    near: Annotated[Text, Cli(metavar="TARGET|RA,DEC")] = opt(
        description="The camera looks near this body or direction (degrees), and nowhere else."
    )
    cone_deg: float = opt(10.0, gt=0, le=180, description="Largest distance of the boresight from it, degrees.")
    camera: Text = opt(description="Camera name, FILE.toml, kernels:NAME, isd:FILE or isis:FILE; overrides the label.")
    pose_file: Annotated[File, Cli(("--pose",))] = opt(
        description="Pose file (JSON) whose camera_from_j2000 is the predicted orientation."
    )
    mask: File = opt(description="Picture of the size of the raw image; pixels that are not 0 are not used.")
    flip: Annotated[Text, AfterValidator(known_flip), Cli(metavar="HOW")] = opt(
        description="The picture is mirrored or turned: x, y, rot90, rot180, ... (see docs)."
    )
    plane: Text = opt(description="Plane of a file with several planes: its number, from 1, or its name.")
    summing: int | None = opt(ge=1, le=32, description="Number of detector pixels along each side of an image pixel.")
    solve: Annotated[tuple[Solvable, ...], BeforeValidator(comma_list), Cli(metavar="WHAT,...", text=True)] = opt(
        (), description="Solve from all images of a camera: focal-length, distortion (beside its model)."
    )
    out: File = opt(description="Folder for a JSON file and a picture per image.")


class AstrometryOptions(KernelOptions):
    """Write the positions of a store's bodies relative to the stars: ADES, CSV, VOTable."""

    store: OneStore = opt(..., description="A store, or one product's folder.")
    out: Path = opt(Path("astrometry"), description="Folder for the tables.")
    station: Text = opt(
        min_length=3, max_length=4, description="The spacecraft's MPC code, for ADES; default: a known one, or XXX."
    )
