"""planetpose correct FILE..."""

import os
import sys
from json import dumps
from typing import TYPE_CHECKING, Any

import typer

from catalog.unchanged import Answer, keep
from flows.cli.options import Json, Quiet, Server, add_command, refuse_useless_kernels, wrong_usage
from flows.options import CorrectOptions

if TYPE_CHECKING:
    from flows.request import Request
    from tasks.profile import Profile


def register(app: typer.Typer) -> None:
    """Add the command."""
    add_command(app, CorrectOptions, correct)


def correct(options: CorrectOptions, server: Server = None, json: Json = False, quiet: Quiet = False) -> None:
    """Correct images, print a line or a JSON object for each, and end with the exit status."""
    from flows.cli.output import clean_stdout, end_process, log_to_stderr
    from flows.progress import reporter
    from flows.requests import requests_of_files
    from flows.result import exit_status, tally
    from flows.run import run_requests
    from local_server.prefect_settings import server_choice

    said = Answer().listening()
    usable_profile(options.profile, None, quiet, said)
    with wrong_usage("--store"):
        requests = requests_of_files(options)
    refuse_useless_kernels(options.kernels)
    log_to_stderr()

    def tell(result: dict[str, Any]) -> None:
        warn(result, said)
        said.say(dumps(result, allow_nan=False) if json else one_line(result), answer)

    workers = options.workers or min(len(requests), os.cpu_count() or 1)
    with clean_stdout() as answer, reporter(len(requests), requests[0].profile.passes * 3 + 5, quiet) as shown:
        results = run_requests(requests, server_choice(server), workers, shown, tell, options=options)
    if not quiet and (len(results) > 1 or results[0]["status"] == "doubtful"):
        said.say(tally(results))
    said.status = exit_status(results)
    keep_unchanged(said, requests, results)
    end_process(said.status)


def keep_unchanged(said: Answer, requests: "list[Request]", results: list[dict[str, Any]]) -> None:
    """Keep the answer for the same command where nothing was to be done and all is on this machine."""
    from catalog.plugins import GROUPS, plugins_of
    from flows.guided import REQUESTS
    from tasks.guidance.decisions import guidance_file

    worked = "prefect" in sys.modules or any(request.publish_to or request.addresses for request in requests)
    if not worked and all(result["cube"] for result in results) and not any(map(plugins_of, GROUPS)):
        files = [path for request in requests for path in (*request.kernel_paths, *request.named_files())]
        files += [path for request in requests for path in (request.image, request.image.parent)]
        files += [guidance_file(request.store, request.product) for request in requests]
        products = [request.product_folder for request in requests]
        keep(said, files, products, [request.store / REQUESTS for request in requests])


def usable_profile(
    name: str, max_passes: int | None = None, quiet: bool = False, said: Answer | None = None
) -> "Profile":
    """The profile; an unknown or invalid one is wrong usage. What one of the user's changes is said on
    stderr, unless `quiet`."""
    from tasks.profile import find_profile
    from tasks.profile.layers import in_words

    with wrong_usage("--profile"):
        profile = find_profile(name)
    if profile.origin and not quiet:
        (said or Answer()).say(f"planetpose: {in_words(profile.name, profile.origin)}")
    return profile.model_copy(update={"passes": max_passes}) if max_passes else profile


def warn(result: dict[str, Any], said: Answer) -> None:
    """One line on stderr for each thing that the label says otherwise than the user, or that is odd about the file, and
    where a failed image's picture and what was tried are."""
    sentences = [*result["guidance"]["overruled"], *result["warnings"]]
    if result["tried"]:
        sentences.append(f"see {result['overlay']} and {result['tried']}")
    for sentence in sentences:
        said.say(f"planetpose: {result['product']}: {sentence}")


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
