"""Modules of the user that have the name of one of our packages."""

from collections.abc import Iterator, Mapping


class HiddenModuleWarning(UserWarning):
    """A module of the user cannot be imported beside planetpose, whose package has the same name."""


def warnings_of(put_aside: Mapping[str, str], hidden: Mapping[str, str]) -> Iterator[str]:
    """A sentence for each, with a remedy. put_aside: name and file of modules that were imported before planetpose was;
    hidden: of those on the path that would be found without it."""
    for name, file in put_aside.items():
        yield (
            f"{file} was imported as {name!r} before planetpose, which has a package of this name: what you imported "
            f"stays as it is, but from now on `import {name}` gives planetpose's. {_remedy(name)}"
        )
    for name, file in hidden.items():
        if name not in put_aside:
            yield f"{file} is hidden: `import {name}` gives planetpose's package of this name. {_remedy(name)}"


def _remedy(name: str) -> str:
    return (
        f"Rename the file or put it into a package of your own, for example my_project/{name}.py; or use planetpose in "
        "a process of its own (the command `planetpose`), which is not affected."
    )
