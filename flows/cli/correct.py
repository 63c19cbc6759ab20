"""planetpose correct FILE..."""

import os
import sys
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flows.cli.server_option import Server
from flows.defaults import DEFAULT_PROFILE

if TYPE_CHECKING:
    from catalog.flips import Flip
    from flows.places import Place
    from flows.profile import Profile

Files = Annotated[list[Path], typer.Argument(help="Image files.", show_default=False)]
Text = str | None
File = Path | None


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(correct)


def correct(
    files: Files,
    store: Annotated[str, typer.Option(help="Folder that products are published in, or s3://bucket/prefix.")] = "out",
    json: Annotated[bool, typer.Option("--json", help="One JSON object per image on stdout.")] = False,
    product: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Name of the product instead of the file's; once for each file."),
    ] = None,
    camera: Annotated[
        Text, typer.Option(help="Camera name, FILE.toml, kernels:NAME, isd:FILE or isis:FILE; overrides the label.")
    ] = None,
    target: Annotated[Text, typer.Option(help="Target name, or FILE.toml; overrides the label.")] = None,
    pose: Annotated[File, typer.Option(help="Pose file (JSON); overrides kernels and label.")] = None,
    map: Annotated[File, typer.Option(help="Base map: an equirectangular picture of the whole body; or none.")] = None,
    map_left_edge_deg: Annotated[
        float, typer.Option(min=-360, max=360, help="East longitude of the map's left edge.")
    ] = 0.0,
    shape: Annotated[File, typer.Option(help="Shape model in km for the planes: DSK kernel, OBJ or PLY.")] = None,
    kernels: Annotated[
        list[Path] | None, typer.Option(help="SPICE kernel, meta-kernel or folder; repeat for more.")
    ] = None,
    no_kernels: Annotated[bool, typer.Option("--no-kernels", help="Use no kernels, not even default ones.")] = False,
    profile: Annotated[str, typer.Option(help="Which bricks: a name, or FILE.toml.")] = DEFAULT_PROFILE,
    start_offset: Annotated[
        Text, typer.Option(metavar="DX,DY", help="Pixels added to the predicted centre; no search of the frame.")
    ] = None,
    hold: Annotated[
        Text, typer.Option(metavar="GROUPS", help="Do not change: range, attitude, roll, offset, psf (comma list).")
    ] = None,
    mask: Annotated[File, typer.Option(help="Picture of the raw image's size; not 0: do not use the pixel.")] = None,
    flip: Annotated[
        Text,
        typer.Option(metavar="HOW", help="The picture is mirrored or turned: x, y, rot90, rot180, ... (see docs)."),
    ] = None,
    plane: Annotated[Text, typer.Option(help="Of a file with several planes: its number, from 1, or name.")] = None,
    summing: Annotated[
        int | None, typer.Option(min=1, max=32, help="Detector pixels along a side of an image pixel.")
    ] = None,
    window: Annotated[
        Text, typer.Option(metavar="X,Y,W,H", help="Part of the detector in the file, in detector pixels from 0.")
    ] = None,
    resume: Annotated[File, typer.Option(help="Product folder, result.json or store to start from.")] = None,
    max_passes: Annotated[int | None, typer.Option(min=1, max=10, help="Overrides the profile's passes.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Images at a time; default: one per processor.")] = None,
    server: Server = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress on stderr.")] = False,
) -> None:
    """Correct the geometry of images and publish cubes."""
    from flows.cli.output import clean_stdout, end_process, log_to_stderr, write_json
    from flows.prefect_settings import server_choice
    from flows.progress import reporter
    from flows.request import Request
    from flows.result import exit_status, tally
    from flows.run import run_requests

    chosen = holding(usable_profile(profile, max_passes, quiet), hold)
    usable_kernels(kernels or [])
    names = product_names(files, product or [])
    offset_px, how, part, place = two_numbers(start_offset), known_flip(flip), four_numbers(window), writable(store)
    requests = [
        Request(
            image=file,
            product=name,
            store=place.store,
            publish_to=place.publish_to,
            camera=camera,
            target=target,
            pose_file=pose,
            basemap=map,
            map_left_edge_deg=map_left_edge_deg,
            shape=shape,
            kernels=() if no_kernels else tuple(kernels) if kernels else None,
            profile=chosen,
            start_offset_px=offset_px,
            mask=mask,
            flip=how,
            plane=plane,
            summing=summing,
            window=part,
            resume=resume,
        )
        for file, name in zip(files, names, strict=True)
    ]
    log_to_stderr()

    def tell(result: dict[str, Any]) -> None:
        warn(result)
        if json:
            write_json(answer, result)
        else:
            print(one_line(result), file=answer, flush=True)

    with clean_stdout() as answer, reporter(len(files), chosen.passes * 3 + 5, quiet) as told:
        at_a_time = workers or min(len(files), os.cpu_count() or 1)
        results = run_requests(
            requests,
            server_choice(server),
            at_a_time,
            told,
            tell,
        )
    if not quiet and (len(results) > 1 or results[0]["status"] == "doubtful"):
        print(tally(results), file=sys.stderr)
    end_process(exit_status(results))


def product_names(files: list[Path], given: list[str]) -> list[str]:
    """Names of the files' products, those given or those of the files; too few, or no names of folders, are wrong
    usage."""
    from catalog.safe_name import is_safe_product_name, safe_product_name

    if not given:
        return [safe_product_name(file.stem) for file in files]
    if len(given) != len(files):
        raise typer.BadParameter(f"{len(given)} names for {len(files)} files", param_hint="--product")
    for name in given:
        if not is_safe_product_name(name):
            fault = f"{name!r} is no name for a folder in a store; {safe_product_name(name)!r} would be"
            raise typer.BadParameter(fault, param_hint="--product")
    return given


def writable(store: str) -> "Place":
    """Where products go; what cannot be written in is wrong usage."""
    from catalog.errors import RefusedError
    from flows.places import usable_place_of

    try:
        return usable_place_of(store)
    except RefusedError as error:
        raise typer.BadParameter(str(error), param_hint="--store") from error


def usable_kernels(paths: list[Path]) -> None:
    """What holds no kernel is wrong usage."""
    from catalog.errors import RefusedError
    from catalog.regular_file import is_folder, is_regular
    from catalog.spice import refuse_what_holds_no_kernel

    try:
        refuse_what_holds_no_kernel(path for path in paths if is_regular(path) or is_folder(path))
    except RefusedError as error:
        raise typer.BadParameter(str(error), param_hint="--kernels") from error


def usable_profile(name_or_file: str, max_passes: int | None, quiet: bool = False) -> "Profile":
    """The profile; an unknown or invalid one is wrong usage. What one of the user's changes is said on
    stderr, unless `quiet`."""
    from catalog.errors import RefusedError
    from flows.profile import find_profile
    from flows.profile_layers import in_words

    try:
        chosen = find_profile(name_or_file)
    except RefusedError as error:
        raise typer.BadParameter(str(error), param_hint="--profile") from error
    if chosen.origin and not quiet:
        print(f"planetpose: {in_words(chosen.name, chosen.origin)}", file=sys.stderr, flush=True)
    return chosen.model_copy(update={"passes": max_passes}) if max_passes else chosen


def holding(profile: "Profile", hold: str | None) -> "Profile":
    """The profile with the named groups held; an unknown group, or nothing left to correct, is wrong usage."""
    from pydantic import ValidationError

    if hold is None:
        return profile
    try:
        return profile.holding(part.strip() for part in hold.split(","))
    except ValidationError as error:
        faults = "; ".join(fault["msg"] for fault in error.errors())
        raise typer.BadParameter(f"{hold!r}: {faults}.", param_hint="--hold") from error


def two_numbers(text: str | None) -> tuple[float, float] | None:
    """`DX,DY` as numbers; anything else is wrong usage."""
    if text is None:
        return None
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError as error:
        raise typer.BadParameter(f"{text!r} is not two numbers.", param_hint="--start-offset") from error
    if not isfinite(x) or not isfinite(y):
        raise typer.BadParameter(f"{text!r} is not finite.", param_hint="--start-offset")
    return x, y


def four_numbers(text: str | None) -> tuple[int, int, int, int] | None:
    """`X,Y,W,H` as whole numbers; anything else is wrong usage."""
    if text is None:
        return None
    try:
        x, y, width, height = (int(part) for part in text.split(","))
    except ValueError as error:
        raise typer.BadParameter(f"{text!r} is not four whole numbers.", param_hint="--window") from error
    if min(x, y) < 0 or min(width, height) < 1:
        raise typer.BadParameter(f"{text!r} is no part of a detector.", param_hint="--window")
    return x, y, width, height


def known_flip(text: str | None) -> "Flip | None":
    """One of the ways to flip a picture; anything else is wrong usage."""
    from catalog.flips import PLACES

    if text is None or text in PLACES:
        return text
    raise typer.BadParameter(f"{text!r} is none of {', '.join(PLACES)}.", param_hint="--flip")


def warn(result: dict[str, Any]) -> None:
    """One line on stderr for each thing that the label says otherwise than the user, or that is odd about the file, and
    where a failed image's picture and what was tried are."""
    sentences = [*result["guidance"]["overruled"], *result["warnings"]]
    if result["tried"]:
        sentences.append(f"see {result['overlay']} and {result['tried']}")
    for sentence in sentences:
        print(f"planetpose: {result['product']}: {sentence}", file=sys.stderr, flush=True)


def one_line(result: dict[str, Any]) -> str:
    """A result for people."""
    if not result["cube"]:
        return f"{result['product']}: {result['status']}: {result['reason']}"
    offset = "unknown" if result["offset_px"] is None else "({:+.2f}, {:+.2f})".format(*result["offset_px"])
    rms = "unknown" if result["limb_rms_px"] is None else f"{result['limb_rms_px']:.2f}"
    turn = "attitude undetermined"
    if result["attitude_deg"] is not None:
        turn = f"turn {sum(part**2 for part in result['attitude_deg']) ** 0.5:.2f} deg"
    return (
        f"{result['product']}: {result['status']}: {result['target']} by {result['camera']}, offset {offset} px, "
        f"range x {result['range_factor']:.5f}, {turn}, limb rms {rms} px; {result['cube']}"
        + (f"; {result['reason']}" if result["reason"] else "")
    )
