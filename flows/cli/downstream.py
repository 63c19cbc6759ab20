"""planetpose adjust, check, control, export, photometry, stars and others: the commands on lists and stores."""

import sys
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from flows.cli.options import Json, Quiet, add_command, refuse_useless_kernels, wrong_usage
from flows.map_options import ControlOptions, ImproveMapOptions, MosaicOptions, PhotometryOptions
from flows.options import (
    AdjustOptions,
    CheckOptions,
    ExportOptions,
    FetchOptions,
    KernelsOptions,
    Options,
    ReportOptions,
)
from flows.star_options import AstrometryOptions, StarsOptions

if TYPE_CHECKING:
    from flows.commands import Row

DryRun = Annotated[bool, typer.Option("--dry-run", help="Print what would be fetched, and fetch nothing.")]
OnlyFaults = Annotated[bool, typer.Option("--quiet", "-q", help="Only products with faults.")]


def register(app: typer.Typer) -> None:
    """Add the commands."""
    models: dict[str, type[Options]] = {
        "adjust": AdjustOptions,
        "control": ControlOptions,
        "export": ExportOptions,
        "improve-map": ImproveMapOptions,
        "mosaic": MosaicOptions,
        "photometry": PhotometryOptions,
    }
    for name, model in models.items():
        add_command(app, model, partial(answer_with_json, name), name)
    add_command(app, CheckOptions, check)
    add_command(app, FetchOptions, fetch)
    add_command(app, KernelsOptions, kernels)
    add_command(app, ReportOptions, report)
    add_command(app, StarsOptions, stars)
    add_command(app, AstrometryOptions, astrometry)


def answer_with_json(command: str, options: Options, json: Json = False) -> None:
    """A command of `flows.commands` that has no other options for the terminal."""
    answer(command.replace("-", "_"), options, json)


def check(options: CheckOptions, json: Json = False, quiet: OnlyFaults = False) -> None:
    """See `flows.commands.check`."""
    answer("check", options, json, quiet and not json)


def fetch(options: FetchOptions, dry_run: DryRun = False, json: Json = False) -> None:
    """See `flows.commands.fetch`."""
    if not dry_run:
        answer("fetch", options, json)
    from flows.commands import items_of

    with wrong_usage():
        items, archive = items_of(options)
    for item in items:
        print(f"{item.source} -> {archive / item.path}")


def astrometry(options: AstrometryOptions, json: Json = False) -> None:
    """See `flows.commands.astrometry`."""
    refuse_useless_kernels(options.kernels)
    answer("astrometry", options, json)


def kernels(options: KernelsOptions, json: Json = False) -> None:
    """See `flows.commands.kernels`."""
    refuse_useless_kernels(options.kernels)
    answer("kernels", options, json)


def stars(options: StarsOptions, json: Json = False) -> None:
    """See `flows.commands.stars`."""
    refuse_useless_kernels(options.kernels)
    answer("stars", options, json)


def report(options: ReportOptions, quiet: Quiet = False) -> None:
    """See `flows.commands.report`."""
    answer("report", options, json=False, quiet=quiet)


def answer(command: str, options: Options, json: bool, quiet: bool = False) -> None:
    """Do a command, print its rows, and end with exit status 0 when all is well."""
    from flows import commands
    from flows.cli.output import clean_stdout, log_to_stderr, write_json

    log_to_stderr()
    good = True
    with clean_stdout() as stream:

        def show(row: "Row") -> None:
            nonlocal good
            good = good and row.good
            if quiet and row.minor:
                return
            if row.aside:
                print(row.text, file=sys.stderr, flush=True)
            elif json and row.content is not None:
                write_json(stream, row.content)
            elif not json and row.text:
                print(row.text, file=stream, flush=True)

        with wrong_usage():
            getattr(commands, command)(options, show)
    sys.exit(0 if good else 1)
