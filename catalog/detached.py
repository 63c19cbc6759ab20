"""Where the detached label of an image is."""

from pathlib import Path

from catalog.regular_file import is_regular


def label_beside(path: Path) -> Path | None:
    """The label that lies beside an image (same name, .LBL or .lbl); None when there is none."""
    for suffix in (".LBL", ".lbl"):
        beside = path.with_suffix(suffix)
        if beside != path and is_regular(beside):
            return beside
    return None
