"""planetpose catalog list | show | check | add"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from catalog.lists import ImageList

Name = Annotated[str, typer.Argument(help="A list of the catalog, or a CSV, TOML or Parquet file.", show_default=False)]
AsJson = Annotated[bool, typer.Option("--json", help="As one JSON object.")]
Archive = Annotated[Path | None, typer.Option(help="Folder of fetched files (default: PLANETPOSE_ARCHIVE).")]


def register(app: typer.Typer) -> None:
    """Add the command group."""
    group = typer.Typer(help="Image lists.", no_args_is_help=True)
    group.command(name="list")(list_)
    group.command()(show)
    group.command()(check)
    group.command()(add)
    app.add_typer(group, name="catalog")


def list_(json: AsJson = False) -> None:
    """Print the names of the lists in the catalog."""
    from catalog.lists import known_lists, load_image_list

    lists = {name: load_image_list(path) for name, path in known_lists().items()}
    if json:
        print_json({name: {"title": found.title, "images": len(found.entries)} for name, found in lists.items()})
        return
    for name, found in lists.items():
        print(f"{name:20s} {len(found.entries):6d}  {found.title}")


def show(name: Name, json: AsJson = False) -> None:
    """Print a list: its images, its sources, and what is not verified."""
    from catalog.lists import load_image_list

    found = load_image_list(name)
    if json:
        print_json(found.model_dump(mode="json", exclude_defaults=True))
        return
    print(f"{found.name}: {found.title or found.file} ({len(found.entries)} images)")
    for entry in found.entries:
        columns = (entry.camera or "?", entry.target or "?", (entry.utc or "")[:19], entry.image)
        print(f"{entry.product:24s} {columns[0]:18s} {columns[1]:10s} {columns[2]:19s}  {columns[3]}")
    for heading in ("sources", "missing"):
        for line in getattr(found, heading):
            print(f"{heading}: {line}")


def check(name: Name, archive: Archive = None, json: AsJson = False) -> None:
    """Check rows, files, checksums and duplicates of a list; exit status 1 if there is a fault."""
    from catalog.lists import find_list
    from catalog.lists.adding import check_list

    checked = check_list(find_list(name), archive)
    images, faults, waiting = len(checked.image_list.entries), checked.faults, checked.not_fetched
    if json:
        print_json({"list": name, "images": images, "faults": faults, "not_fetched": waiting})
    else:
        for fault in faults:
            print(fault)
        print(f"{name}: {images} sound rows, {len(faults)} faults, {len(waiting)} files not fetched yet")
    raise typer.Exit(1 if faults else 0)


def add(
    sources: Annotated[
        list[str], typer.Argument(help="Folders of images, or labels of PDS3 indices: paths, URLs or ARCHIVE:path.")
    ],
    to: Annotated[Path, typer.Option(help="The list; a new file if it does not exist.")] = Path("images.csv"),
    target: Annotated[str | None, typer.Option(help="Only images of this target.")] = None,
    camera: Annotated[str | None, typer.Option(help="Only images by this camera.")] = None,
    base: Annotated[
        str | None, typer.Option(help="Location of the paths in an index, such as pds-rings:volumes/VGISS_5xxx.")
    ] = None,
    kernels: Annotated[list[str] | None, typer.Option(help="A kernel set or location for all of them.")] = None,
    mirror: Annotated[str | None, typer.Option(help="URL or folder in place of all archives.")] = None,
    json: AsJson = False,
) -> None:
    """Add the images of folders or PDS3 indices to a list; duplicates by product, file and content are refused."""
    from catalog.lists.adding import Wanted, add_to_list

    places = [local_source(source, mirror) for source in sources]
    added = add_to_list(places, to, Wanted(target, camera, base, tuple(kernels or ())))
    if json:
        print_json({"list": str(to), "added": added.count, "faults": added.faults, "no_images": added.passed_over})
    else:
        for fault in added.faults:
            print(f"not added: {fault}")
        print(summary(added.image_list, added.count, len(added.faults), added.passed_over, to))
    raise typer.Exit(1 if added.faults else 0)


def local_source(source: str, mirror: str | None) -> Path:
    """A source on this disk; an index in an archive is fetched. An address that is none is wrong usage."""
    from catalog.lists.location import parse_location

    try:
        remote = parse_location(source).url is not None
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="SOURCES") from error
    if not remote:
        return Path(source)
    from catalog.fetch import FetchSettings
    from catalog.fetch.many import fetched_index
    from catalog.fetch.settings import default_mirror
    from catalog.settings import archive_folder

    return fetched_index(source, archive_folder(), FetchSettings(), mirror or default_mirror())


def summary(found: "ImageList", count: int, faults: int, passed_over: int, to: Path) -> str:
    """One line for a person."""
    return f"{to}: {count} images added, {len(found.entries)} in all; {faults} refused; {passed_over} other files"


def print_json(content: Any) -> None:
    """One JSON value on one line."""
    import json

    print(json.dumps(content, default=str))
