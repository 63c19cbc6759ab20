"""planetpose reprocess LIST --store STORE"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from flows.cli.server_option import Server

if TYPE_CHECKING:
    from flows.reprocessing.settings import Settings

Text = str | None
Number = float | None


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(reprocess)


def reprocess(
    images: Annotated[
        str,
        typer.Argument(help="Image list: a name of the catalog, or a CSV, TOML or Parquet file.", show_default=False),
    ],
    store: Annotated[str, typer.Option(help="Folder that products are published in, or s3://bucket/prefix.")] = "out",
    profile: Annotated[Text, typer.Option(help="Which bricks: a name, or FILE.toml.")] = None,
    only: Annotated[list[str] | None, typer.Option(help="Products like this (C16*); repeat for more.")] = None,
    kernels: Annotated[
        list[Path] | None, typer.Option(help="SPICE kernels for images whose list names none; repeat for more.")
    ] = None,
    workers: Annotated[int, typer.Option(min=0, help="Images at a time; 0: one per processor.")] = 0,
    runner: Annotated[
        str, typer.Option(help="Where images are done: threads (this machine), dask, or dask:ADDRESS of a scheduler.")
    ] = "threads",
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Only tell what would be done, and why.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Also images that are unchanged; cached steps stay.")] = False,
    again: Annotated[bool, typer.Option("--again", help="Also images that were refused or failed before.")] = False,
    verify: Annotated[bool, typer.Option("--verify", help="Compare every product with its checksums.")] = False,
    image_timeout_s: Annotated[float, typer.Option(min=0.1, help="Seconds that one image may take.")] = 1800.0,
    image_memory_mb: Annotated[float, typer.Option(min=50, help="Memory that one image may take.")] = 6000.0,
    retries: Annotated[int, typer.Option(min=0, max=20, help="After faults that can pass.")] = 2,
    retry_delay_s: Annotated[float, typer.Option(min=0, help="Before the first; each further one is tripled.")] = 10.0,
    most_failed_percent: Annotated[
        float, typer.Option(min=0, max=100, help="More failed images make the flow fail and raise the alarm.")
    ] = 5.0,
    fetch: Annotated[bool, typer.Option("--fetch", help="First get what the list names and is not there.")] = False,
    archive: Annotated[Path | None, typer.Option(help="Folder of fetched files (default: PLANETPOSE_ARCHIVE).")] = None,
    cache_limit_gb: Annotated[Number, typer.Option(min=0, help="Prune the cache of steps to this size.")] = None,
    cache_days: Annotated[Number, typer.Option(min=0, help="Prune what was not used for so long.")] = None,
    server: Server = None,
    json: Annotated[bool, typer.Option("--json", help="The run's summary as one JSON object on stdout.")] = False,
    log_json: Annotated[bool, typer.Option("--log-json", help="Progress and log as JSON lines on stderr.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress on stderr.")] = False,
) -> None:
    """Correct the images of a list that are new or whose inputs, settings, kernels or code changed."""
    from functools import partial

    from flows.cli.correct import usable_kernels, usable_profile, writable
    from flows.cli.output import clean_stdout, end_process, log_to_stderr, write_json
    from flows.prefect_settings import server_choice
    from flows.reprocessing.command import run_reprocess
    from flows.reprocessing.parameters import settings_of
    from flows.reprocessing.tally import in_words
    from flows.reprocessing.telling import telling

    writable(store)
    if profile:
        usable_profile(profile, None, quiet)
    usable_kernels(kernels or [])
    settings = settings_of(
        images=images,
        store=store,
        profile=profile,
        only=only,
        kernels=kernels,
        workers=workers,
        runner=runner,
        force=force,
        again=again,
        verify=verify,
        image_timeout_s=image_timeout_s,
        image_memory_mb=image_memory_mb,
        retries=retries,
        retry_delay_s=retry_delay_s,
        most_failed_percent=most_failed_percent,
        fetch=fetch,
        archive=archive,
        cache_limit_gb=cache_limit_gb,
        cache_days=cache_days,
    )
    if not log_json:
        log_to_stderr()
    with clean_stdout() as answer:
        if dry_run:
            tell_plan(settings, answer, json)
            return
        summary = run_reprocess(settings, server_choice(server), partial(telling, quiet=quiet, as_json=log_json))
        if json:
            write_json(answer, summary)
        else:
            print(f"{in_words(summary)}; {summary.get('table', 'no table')}", file=answer, flush=True)
    end_process(0 if summary["status"]["refused"] + summary["status"]["failed"] == 0 else 1)


def tell_plan(settings: "Settings", answer: object, json: bool) -> None:
    """Print what would be done, and why."""
    from typing import TextIO, cast

    from flows.cli.output import write_json
    from flows.reprocessing.planning import plans_in_words
    from flows.reprocessing.run import planned

    stream = cast(TextIO, answer)
    _, plans = planned(settings)
    for plan in plans:
        if json:
            write_json(stream, {"product": plan.request.product, "do": plan.do, "why": plan.why})
        elif plan.do:
            print(f"{plan.request.product}: {plan.why}", file=stream)
    if not json:
        print(plans_in_words(plans), file=stream)
