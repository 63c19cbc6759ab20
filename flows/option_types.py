"""Kinds of options that several commands have, and how their text is read."""

from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, Field

from catalog.lists.location import address_in
from flows.image_options import Cli


def comma_list(given: Any) -> Any:
    """`a, b` as a list."""
    return [part.strip() for part in given.split(",")] if isinstance(given, str) else given


def absolute(path: Path) -> Path:
    """The path that means the same in every process; an address stays one."""
    return path if address_in(path) else path.expanduser().absolute()


def name_or_file(text: str) -> str:
    """A name of the catalog as it is, a file with its absolute path."""
    return str(Path(text).absolute()) if Path(text).is_file() else text


def folder_of_products(path: Path) -> Path:
    """The path as it is. Raises ValueError for the address of an object store, which is no folder."""
    if str(path).startswith("s3:/"):
        raise ValueError("an object store is not read here; give the folder that it was published from, or a copy.")
    return path


Absolute = Annotated[Path, AfterValidator(absolute)]
Folder = Annotated[Path, AfterValidator(folder_of_products)]
NameOrFile = Annotated[str, AfterValidator(name_or_file)]
Paths = Annotated[tuple[Folder, ...], Cli(argument=True), Field(description="Products' folders, or stores.")]
OneStore = Annotated[Folder, Cli(argument=True, folder=True)]
Store = Annotated[str, Field(description="Folder for the products, or s3://bucket/prefix.")]
