"""planetpose correct FILE..."""

import os
import sys
from typing import TYPE_CHECKING, Any

import typer

from flows.cli.options import Json, Quiet, Server, add_command, refuse_useless_kernels, wrong_usage
from flows.options import CorrectOptions

if TYPE_CHECKING:
    from tasks.profile import Profile


def register(app: typer.Typer) -> None:
    """Add the command."""
    add_command(app, CorrectOptions, correct)


def correct(options: CorrectOptions, server: Server = None, json: Json = False, quiet: Quiet = False) -> None:
    """Correct images, print a line or a JSON object for each, and end with the exit status."""
    from flows.cli.output import clean_stdout, end_process, log_to_stderr, write_json
    from flows.progress import reporter
    from flows.requests import requests_of_files
    from flows.result import exit_status, tally
    from flows.run import run_requests
    from local_server.prefect_settings import server_choice

    usable_profile(options.profile, None, quiet)
    with wrong_usage("--store"):
        requests = requests_of_files(options)
    refuse_useless_kernels(options.kernels)
    log_to_stderr()

    def tell(result: dict[str, Any]) -> None:
        warn(result)
        if json:
            write_json(answer, result)
        else:
            print(one_line(result), file=answer, flush=True)

    workers = options.workers or min(len(requests), os.cpu_count() or 1)
    with clean_stdout() as answer, reporter(len(requests), requests[0].profile.passes * 3 + 5, quiet) as shown:
        results = run_requests(requests, server_choice(server), workers, shown, tell, options=options)
    if not quiet and (len(results) > 1 or results[0]["status"] == "doubtful"):
        print(tally(results), file=sys.stderr)
    end_process(exit_status(results))


def usable_profile(name_or_file: str, max_passes: int | None = None, quiet: bool = False) -> "Profile":
    """The profile; an unknown or invalid one is wrong usage. What one of the user's changes is said on
    stderr, unless `quiet`."""
    from tasks.profile import find_profile
    from tasks.profile.layers import in_words

    with wrong_usage("--profile"):
        profile = find_profile(name_or_file)
    if profile.origin and not quiet:
        print(f"planetpose: {in_words(profile.name, profile.origin)}", file=sys.stderr, flush=True)
    return profile.model_copy(update={"passes": max_passes}) if max_passes else profile


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
