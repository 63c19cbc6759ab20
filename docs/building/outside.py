"""Documents that lie outside this folder, taken into a page."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r"\[([^\]]+)\]\((?!https?:|#)([^)]+)\)")


def text_of(name: str) -> str:
    """The document's text without its title; links to files of the project become their names. A document that is not
    there gives nothing."""
    path = ROOT / name
    if not path.is_file():
        return ""
    _, _, text = path.read_text(encoding="utf-8").partition("\n")
    return LINK.sub(lambda found: f"{found[1]} (`{found[2]}`)" if found[1] != found[2] else f"`{found[2]}`", text)
