"""Single facts of the program, so that no page can tell them wrong."""

from collections.abc import Callable

from building.commands import all_commands
from tasks.profile import known_profiles


def text_of(name: str) -> str:
    """The fact of this name. Raises KeyError when there is none."""
    return FACTS[name]()


def default_profile() -> str:
    """Which profile is used when nothing is said."""
    default = profile_by_default()
    others = " and ".join(f"`{name}`" for name in known_profiles() if name != default)
    return f"The default profile is `{default}`; `--profile` takes {others}, or a file of your own."


def profile_by_default() -> str:
    """Its name, as the command has it."""
    return str(next(option.default for option in all_commands()["correct"].params if option.name == "profile"))


FACTS: dict[str, Callable[[], str]] = {"default-profile": default_profile}
