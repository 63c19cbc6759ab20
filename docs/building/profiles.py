"""The profiles that come with the program."""

from building.markdown import block
from flows.profile import DEFAULT_PROFILE, known_profiles


def page(_: str = "") -> str:
    """Every profile's file, word for word."""
    parts = []
    for name, path in known_profiles().items():
        default = " (the default)" if name == DEFAULT_PROFILE else ""
        parts += [f"## `{name}`{default}\n", block(path.read_text(encoding="utf-8"), "toml")]
    return "\n".join(parts)
