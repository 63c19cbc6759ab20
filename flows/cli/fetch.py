"""planetpose fetch CATALOG"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from catalog.fetch import Outcome


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(fetch)


def fetch(
    catalog: Annotated[
        str, typer.Argument(help="An image list: a name of the catalog, or a file.", show_default=False)
    ],
    only: Annotated[
        list[str] | None, typer.Option(help="Products alone that match this pattern (C16*); repeat.")
    ] = None,
    what: Annotated[
        list[str] | None, typer.Option(help="images, labels, kernels or maps; repeat. Default: all.")
    ] = None,
    mirror: Annotated[
        str | None, typer.Option(help="URL or folder in place of all archives (PLANETPOSE_MIRROR).")
    ] = None,
    dest: Annotated[Path | None, typer.Option(help="Folder of fetched files (PLANETPOSE_ARCHIVE).")] = None,
    attempts: Annotated[int, typer.Option(min=1, max=20, help="Attempts per file.")] = 4,
    stall_s: Annotated[float, typer.Option(min=0.1, help="Silence that ends an attempt.")] = 30.0,
    requests_per_s: Annotated[float, typer.Option(min=0.01, help="To one host.")] = 4.0,
    largest_mb: Annotated[float, typer.Option(min=0.001, help="Largest file that is fetched.")] = 2000.0,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print what would be fetched, and fetch nothing.")] = False,
    json: Annotated[bool, typer.Option("--json", help="One JSON object per file, then the summary.")] = False,
) -> None:
    """Get the images, labels, kernels and maps of a list; exit status 1 when a file could not be had."""
    from catalog.fetch import FetchSettings, planned_items
    from catalog.fetch.plan import KINDS
    from catalog.fetch.settings import default_mirror
    from catalog.lists import load_image_list
    from catalog.settings import archive_folder
    from flows.cli.output import clean_stdout, write_json
    from flows.fetch import fetch_items, summary_of

    kinds = tuple(what or KINDS)
    if unknown := set(kinds) - set(KINDS):
        raise typer.BadParameter(f"{', '.join(sorted(unknown))}: choose of {', '.join(KINDS)}", param_hint="--what")
    image_list = load_image_list(catalog)
    wanted = image_list.only(tuple(only)) if only else image_list
    if not wanted.entries:
        raise typer.BadParameter(f"no product of {catalog} matches", param_hint="--only")
    items = planned_items(wanted, mirror or default_mirror(), kinds)
    archive = dest or archive_folder()
    if dry_run:
        for item in items:
            print(f"{item.source} -> {archive / item.path}")
        return
    settings = FetchSettings(
        attempts=attempts, stall_timeout_s=stall_s, requests_per_s=requests_per_s, largest_bytes=int(largest_mb * 1e6)
    )
    with clean_stdout() as answer:
        outcomes = fetch_items(
            items,
            archive,
            settings,
            lambda o: write_json(answer, o.to_dict()) if json else print(one_line(o), file=answer),
        )
        found = summary_of(outcomes)
        if json:
            write_json(answer, {"summary": found})
        else:
            print(
                f"{found['files']} files: {found['fetched']} fetched ({found['bytes_fetched'] / 1e6:.1f} MB), "
                f"{found['present']} there already, {found['failed']} failed; {found['unchecked']} have no checksum to "
                f"compare with; in {archive}",
                file=answer,
            )
    raise typer.Exit(1 if found["failed"] else 0)


def one_line(outcome: "Outcome") -> str:
    """An outcome for people."""
    end = f": {outcome.reason}" if outcome.reason else ""
    return f"{outcome.status:8s} {outcome.item.location}{end}"
