"""planetpose reprocess LIST --store STORE"""

from typing import Annotated, TextIO

import typer

from flows.cli.options import Json, Quiet, Server, add_command, refuse_useless_kernels, wrong_usage
from flows.options import ReprocessOptions

LogJson = Annotated[bool, typer.Option("--log-json", help="Progress and log as JSON lines on stderr.")]


def register(app: typer.Typer) -> None:
    """Add the command."""
    add_command(app, ReprocessOptions, reprocess)


def reprocess(
    options: ReprocessOptions,
    server: Server = None,
    json: Json = False,
    log_json: LogJson = False,
    quiet: Quiet = False,
) -> None:
    """Do what has to be done of a list, print the run's summary, and end with the exit status."""
    from flows.cli.correct import usable_profile
    from flows.cli.output import clean_stdout, end_process, log_to_stderr, write_json
    from flows.progress import json_reporter, reporter
    from flows.run import run_reprocess
    from local_server.prefect_settings import server_choice
    from tasks.objectstore.places import usable_place_of
    from tasks.run_tally import in_words

    with wrong_usage("--store"):
        usable_place_of(options.store)
    usable_profile(options.profile, None, quiet)
    refuse_useless_kernels(options.kernels)
    if not log_json:
        log_to_stderr()
    with clean_stdout() as answer:
        if options.dry_run:
            print_plan(options, answer, json)
            return
        summary = run_reprocess(
            options,
            server_choice(server),
            lambda images: json_reporter() if log_json else reporter(images, quiet=quiet),
        )
        if json:
            write_json(answer, summary)
        else:
            print(f"{in_words(summary)}; {summary.get('table', 'no table')}", file=answer, flush=True)
    end_process(0 if summary["status"]["refused"] + summary["status"]["failed"] == 0 else 1)


def print_plan(options: ReprocessOptions, stream: TextIO, json: bool) -> None:
    """Print what would be done, and why."""
    from flows.cli.output import write_json
    from flows.reprocessing.planning import Planned
    from flows.reprocessing.run import planned

    found = Planned()
    for plan in planned(options)[1]:
        found.add(plan)
        if json:
            write_json(stream, {"product": plan.request.product, "do": plan.do, "why": plan.why})
        elif plan.do:
            print(f"{plan.request.product}: {plan.why}", file=stream)
    if not json:
        print(found.in_words(), file=stream)
