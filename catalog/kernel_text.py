"""Text kernels and meta-kernels as they were meant: SPICE itself passes over much of them without a word.

Lost in silence are: the last line without a line's end; what follows a `\\BEGINDATA` that is not in small letters;
variables in small letters, which nothing asks for; and what stands beyond the 132nd character of a line (NAIF's Kernel
Required Reading). Here they count: such a kernel is furnished as a copy. A kernel that holds nothing is refused.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from catalog.digest import sha256_of_file
from catalog.errors import RefusedError
from catalog.reasons import Reason
from catalog.regular_file import open_regular, read_regular

MAX_LINE = 132  # characters of a line that SPICE reads
MAX_PATH = 255  # characters of a file's name that SPICE takes
MAX_TEXT_BYTES = 50_000_000
BEGIN_DATA, BEGIN_TEXT = "\\begindata", "\\begintext"
BINARY = (b"DAF/", b"DAS/", b"NAIF/")
ID_WORD = re.compile(rb"(?:KPL|DAF|DAS)/(\w+)")
# Possessive throughout: a damaged text must not be tried in every way that it could be cut.
STRING = r"'(?:[^'\n]|'')*+'"
STATEMENT = re.compile(
    rf"(?<![^\s=(),'+])(?P<name>[^\s=(),'+]++)[ \t]*+(?P<operator>\+?=)\s*+"
    rf"(?P<value>\((?:[^()']|{STRING})*+(?P<end>\)|\Z)|{STRING}|[^\s(),']++)"
)
TOKEN = re.compile(rf"{STRING}|[^\s(),']++")
TO_LOAD, SYMBOLS, VALUES = "KERNELS_TO_LOAD", "PATH_SYMBOLS", "PATH_VALUES"
REMEDY = "Fetch the kernel again, or mend it in a text editor."


@dataclass(frozen=True)
class Statement:
    """One assignment of a text kernel: `name` in capitals, `=` or `+=`, and its values as written (strings quoted)."""

    name: str
    operator: str
    values: tuple[str, ...]

    def lines(self) -> Iterable[str]:
        """The assignment in lines that SPICE reads whole."""
        return (f"{self.name} {self.operator} (", *self.values, ")")


@dataclass(frozen=True)
class TextKernel:
    """The assignments of a text kernel. as_spice_reads: whether SPICE takes the same from the file itself."""

    statements: tuple[Statement, ...]
    as_spice_reads: bool

    @property
    def is_meta(self) -> bool:
        """Whether it names other kernels."""
        return any(statement.name == TO_LOAD for statement in self.statements)

    @property
    def own(self) -> tuple[Statement, ...]:
        """What it says beside the names of other kernels."""
        return tuple(s for s in self.statements if s.name not in (TO_LOAD, SYMBOLS, VALUES))

    def strings(self, name: str) -> list[str]:
        """The strings of a variable; one that ends with + goes on in the next, as none may exceed 80 characters."""
        found: list[str] = []
        goes_on = False
        for statement in self.statements:
            if statement.name != name:
                continue
            if statement.operator == "=":
                found, goes_on = [], False
            for value in statement.values:
                text = value.strip("'").replace("''", "'").rstrip()
                part = text.removesuffix("+")
                found[-1:] = [found[-1] + part] if goes_on else [*found[-1:], part]
                goes_on = text.endswith("+")
        return found


def id_word(path: Path) -> str:
    """What a kernel's first bytes say it is (`pck`, `mk`, `spk` ...), "" where they do not."""
    match = ID_WORD.match(_head(path))
    return match[1].decode("ascii").lower() if match else ""


def is_binary(path: Path) -> bool:
    """Whether a file is one of SPICE's binary formats."""
    return _head(path).startswith(BINARY)


def _head(path: Path) -> bytes:
    with open_regular(path) as file:
        return file.read(32).removeprefix(b"\xef\xbb\xbf").lstrip()


def read_text_kernel(path: Path) -> TextKernel:
    """The assignments of a text kernel; remembered while its content stays the same. Raises RefusedError, naming the
    file and the fault, for one that is no text, is cut off, or holds no assignment."""
    return _read(path, sha256_of_file(path))


@lru_cache(maxsize=256)
def _read(path: Path, sha256: str) -> TextKernel:  # noqa: ARG001 - a key
    text = _text(path)
    lines = re.split(r"\r\n|\n|\r", text)
    data = _data([line.strip().lower() if _is_control(line) else line for line in lines])
    statements = _statements(path, data)
    if not statements:
        raise _fault(path, _why_empty(lines))
    as_spice = _data([line[:MAX_LINE] for line in lines[:-1]])  # the last one has no end
    found = _found(as_spice)
    same = [(s.name, s.operator, s.values) for s in statements] == found
    return TextKernel(statements, same)


def _text(path: Path) -> str:
    if path.stat().st_size > MAX_TEXT_BYTES:
        raise _fault(path, f"has {path.stat().st_size} bytes and is no binary SPICE file")
    content = read_regular(path)
    if content.startswith((b"DAFETF", b"DASETF")):
        raise _fault(path, "is in SPICE's transfer format", "Convert it with NAIF's program `tobin`.")
    if content.startswith((b"\xff\xfe", b"\xfe\xff")) or b"\0" in content:
        raise _fault(path, "is neither a binary SPICE file nor plain text", "Fetch it again, or save it as ASCII.")
    return content.decode("latin-1").removeprefix("\xef\xbb\xbf").replace("\t", " ").replace("\x1a", " ")


def _fault(path: Path, fault: str, remedy: str = REMEDY) -> RefusedError:
    return RefusedError(Reason.KERNEL_UNREADABLE, f"kernel {path} {fault}.", remedy)


def _is_control(line: str) -> bool:
    return line.strip().lower() in (BEGIN_DATA, BEGIN_TEXT)


def _data(lines: Iterable[str]) -> str:
    """What stands between `\\begindata` and `\\begintext`, each in small letters on a line of its own."""
    found, in_data = [], False
    for line in lines:
        if line.strip() in (BEGIN_DATA, BEGIN_TEXT):
            in_data = line.strip() == BEGIN_DATA
        elif in_data:
            found.append(line)
    return "\n".join(found) + "\n"


def _found(data: str) -> list[tuple[str, str, tuple[str, ...]]]:
    return [
        (match["name"], match["operator"], tuple(TOKEN.findall(match["value"]))) for match in STATEMENT.finditer(data)
    ]


def _statements(path: Path, data: str) -> tuple[Statement, ...]:
    matches = list(STATEMENT.finditer(data))
    for match in matches:
        if match["value"].startswith("(") and match["end"] != ")":
            raise _fault(path, f"is cut off: its values of {match['name']} have no closing bracket")
        longest = max((len(token) for token in TOKEN.findall(match["value"])), default=0)
        if longest > MAX_LINE:
            raise _fault(path, f"gives {match['name']} a value of {longest} characters, SPICE reads {MAX_LINE}")
    return tuple(Statement(name.upper(), operator, values) for name, operator, values in _found(data))


def _why_empty(lines: list[str]) -> str:
    for number, line in enumerate(lines, 1):
        word = line.strip().lower()
        if word.startswith(BEGIN_DATA):
            return f"holds no data: line {number} ({line.strip()[:40]!r}) " + (
                "is followed by no assignment" if word == BEGIN_DATA else f"must be {BEGIN_DATA} and nothing else"
            )
    return f"is neither a binary SPICE file nor a text with {BEGIN_DATA}"


def members_of(path: Path, kernel: TextKernel) -> list[Path]:
    """The files that a meta-kernel names, in its order: relative ones are looked for in the working folder, as SPICE
    does, and then beside the meta-kernel. Raises RefusedError for one that is not there."""
    symbols = dict(zip(kernel.strings(SYMBOLS), kernel.strings(VALUES), strict=False))
    texts = [_as_file_name(text) for text in kernel.strings(TO_LOAD)]
    places = {text: _member(path, text, symbols) for text in dict.fromkeys(texts)}
    return [places[text] for text in texts]


def _member(path: Path, text: str, symbols: dict[str, str]) -> Path:
    whole = text
    for symbol in sorted(symbols, key=len, reverse=True):
        whole = whole.replace(f"${symbol}", _as_file_name(symbols[symbol]))
    found = _looked_for([Path(whole), path.parent / whole, path.resolve().parent / whole])
    if found is None:
        why = f"{whole} is not there" if "$" not in whole else f"{whole} has a symbol that {SYMBOLS} does not give"
        raise RefusedError(
            Reason.KERNEL_UNREADABLE,
            f"meta-kernel {path} names {text!r}: {why}.",
            "Correct its path: absolute, or relative to the working folder or to the meta-kernel.",
        )
    return found


def _as_file_name(text: str) -> str:
    """A string of a kernel, whose bytes were taken one by one, as the UTF-8 text that it is; as it stands otherwise."""
    try:
        return text.encode("latin-1").decode("utf-8")
    except UnicodeError:
        return text


def _looked_for(candidates: list[Path]) -> Path | None:
    """The first regular file; else the first that is there at all, for whoever opens it to say what it is."""
    there = [candidate for candidate in candidates if _is_there(candidate)]
    return next((candidate for candidate in there if candidate.is_file()), there[0] if there else None)


def _is_there(path: Path) -> bool:
    """Whether something has that name; a name that no file can have (too long) is not there."""
    try:
        path.lstat()
    except (OSError, ValueError):
        return False
    return path.name != ""
