"""The profiles that come with the program."""

from building.facts import profile_by_default
from building.markdown import block
from tasks.profile import known_profiles


def page(_: str = "") -> str:
    """Every profile's file, word for word."""
    parts = []
    for name, path in known_profiles().items():
        default = " (the default)" if name == profile_by_default() else ""
        parts += [f"## `{name}`{default}\n", block(path.read_text(encoding="utf-8"), "toml")]
    return "\n".join(parts)
