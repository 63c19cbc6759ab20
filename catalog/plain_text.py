"""Text for people and for JSON, whatever the name of a file is made of."""

import os


def printable(text: str) -> str:
    """`text` with everything escaped that is no printable character: control characters, marks that turn the direction
    of writing, and bytes of file names that are no UTF-8 (`\\xff`)."""
    if text.isprintable():
        return text
    return "".join(character if character.isprintable() else _escaped(character) for character in text)


def shown_path(path: "os.PathLike[str] | str") -> str:
    """A path as `printable` text; it names the same file unless something had to be escaped."""
    return printable(os.fspath(path))


def is_text(path: "os.PathLike[str] | str") -> bool:
    """Whether a path is text at all: the system allows any bytes, and those that are no UTF-8 cannot be written into
    JSON, tables or logs."""
    return not any("\udc80" <= character <= "\udcff" for character in os.fspath(path))


def _escaped(character: str) -> str:
    if "\udc80" <= character <= "\udcff":
        return f"\\x{ord(character) - 0xDC00:02x}"
    return character.encode("unicode_escape").decode("ascii")
