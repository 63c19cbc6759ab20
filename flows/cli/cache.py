"""planetpose cache size|clear|prune"""

import sys
from pathlib import Path
from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command group."""
    group = typer.Typer(help="Cached results of steps.", no_args_is_help=True)
    group.command()(size)
    group.command()(clear)
    group.command()(prune)
    app.add_typer(group, name="cache")


def size() -> None:
    """Print the cache's folder, and bytes and results per step."""
    from catalog.settings import cache_folder
    from tasks.record import size_bytes

    folder = cache_folder()
    print(folder)
    for step in own_folders(folder):
        count = sum(1 for _ in step.glob("*/*/record.json"))
        print(f"{step.name:12s} {count:8d} results {size_bytes(step) / 1e6:10.1f} MB")


def clear(
    step: Annotated[str | None, typer.Option(help="Only this step (point, range ...).")] = None,
) -> None:
    """Delete cached results; they are computed again when they are needed. Published products stay."""
    from catalog.settings import cache_folder
    from tasks.cache import clear_folders

    found = clear_folders(own_folders(cache_folder()), step)
    if step is not None and not found:
        raise typer.BadParameter(f"there is no cached step {step!r}", param_hint="--step")
    for folder in found:
        print(f"deleted {folder}")


def prune(
    limit_gb: Annotated[
        float | None, typer.Option(min=0, help="Delete old results until the cache has this size.")
    ] = None,
    days: Annotated[float | None, typer.Option(min=0, help="Delete results not used for so many days.")] = None,
) -> None:
    """Delete old results, and temporary files of dead processes. Results that were used in the last six
    hours are kept; so are published products, which need no cache."""
    from catalog.settings import cache_folder
    from tasks.cache import prune as prune_cache
    from tasks.cache import sweep_cache

    if limit_gb is None and days is None:
        raise typer.BadParameter("give --limit-gb, --days or both")
    sweep_cache(cache_folder())
    freed = prune_cache(cache_folder(), limit_gb, days)
    print(f"freed {freed / 1e6:.1f} MB in {cache_folder()}")


def own_folders(cache: Path) -> list[Path]:
    """The folders of steps in the cache; links are left alone, and named."""
    from tasks.cache import step_folders

    found = step_folders(cache)
    for link in (each for each in found if each.is_symlink()):
        print(f"planetpose: {link} is a link; what it leads to is left alone", file=sys.stderr)
    return [each for each in found if not each.is_symlink()]
