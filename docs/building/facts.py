"""Single facts of the program, so that no page can tell them wrong."""

from collections.abc import Callable

from flows.profile import DEFAULT_PROFILE, known_profiles


def text_of(name: str) -> str:
    """The fact of this name. Raises KeyError when there is none."""
    return FACTS[name]()


def default_profile() -> str:
    """Which profile is used when nothing is said."""
    others = " and ".join(f"`{name}`" for name in known_profiles() if name != DEFAULT_PROFILE)
    return f"The default profile is `{DEFAULT_PROFILE}`; `--profile` takes {others}, or a file of your own."


FACTS: dict[str, Callable[[], str]] = {"default-profile": default_profile}
