"""JSON and TOML files that a user gives, read so that whatever is in them ends in plain values or in one ValueError.

The libraries' own parsers exhaust the stack on deep nesting, take NaN, Infinity and 1e999 for numbers, keep the last of
two equal keys in silence, and know no other encoding than the machine's.
"""

import codecs
import json
import math
import re
import tomllib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from catalog.regular_file import read_regular

MAX_DEPTH = 50
"""Of tables and lists in each other; the deepest that this program reads or writes (a profile, a result) has 6."""
TOO_DEEP = f"its tables and lists are nested more than {MAX_DEPTH} deep"
MAX_NUMBER_CHARACTERS, MAX_NUMBER_BITS = 310, 1023  # what a float can hold
MAX_FILE_BYTES = 50_000_000
FOREIGN_MARKS = (  # the longer ones first: UTF-32's begins with UTF-16's
    (codecs.BOM_UTF32_LE, "UTF-32"),
    (codecs.BOM_UTF32_BE, "UTF-32"),
    (codecs.BOM_UTF16_LE, "UTF-16"),
    (codecs.BOM_UTF16_BE, "UTF-16"),
)

QUOTED = re.compile(r"""\"(?:[^"\\\n]|\\.)*+\"|'[^'\n]*+'""")
DOTTED_KEY = re.compile(rf"(?<![\w-])(?:[\w-]++[ \t]*+\.[ \t]*+){{{MAX_DEPTH},}}")
"""tomllib keeps every beginning of a dotted key: a line of 100 000 parts takes all memory."""


def read_json_file(path: Path) -> Any:
    """The content of a JSON file (UTF-8, with or without a byte order mark). Raises OSError when it cannot be read, and
    ValueError, saying what is wrong and where, for anything else than finite plain values of sane size and depth."""
    return parsed_json(text_of_file(path))


def read_toml_file(path: Path, max_bytes: int = MAX_FILE_BYTES) -> dict[str, Any]:
    """The content of a TOML file. Raises OSError and ValueError as `read_json_file` does."""
    return parsed_toml(text_of_file(path, max_bytes))


def parsed_json(text: str) -> Any:
    """The values of a JSON text. Raises ValueError as `read_json_file` does."""

    def parsed() -> Any:
        return json.loads(
            text,
            parse_float=_finite_float,
            parse_int=_whole_number,
            parse_constant=_finite_float,
            object_pairs_hook=_without_duplicates,
        )

    return _shallow(parsed, "JSON")


def own_json(text: str | bytes) -> Any:
    """The values of a JSON text that this program wrote once: quicker than `parsed_json`, and whatever became of it
    meanwhile raises ValueError too."""
    try:
        return json.loads(text)
    except RecursionError as error:
        raise ValueError(TOO_DEEP) from error


def parsed_toml(text: str) -> dict[str, Any]:
    """The tables of a TOML text. Raises ValueError as `read_json_file` does."""
    if DOTTED_KEY.search(QUOTED.sub("quoted", text)):
        raise ValueError(TOO_DEEP)
    found: dict[str, Any] = _shallow(lambda: tomllib.loads(text, parse_float=_finite_float), "TOML")
    return found


def text_of_file(path: Path, max_bytes: int = MAX_FILE_BYTES) -> str:
    """The text of a UTF-8 file. Raises OSError as `read_regular` does, and ValueError for another encoding."""
    content = read_regular(Path(path), max_bytes)
    for mark, name in FOREIGN_MARKS:
        if content.startswith(mark):
            raise ValueError(f"it is {name} text; save it as UTF-8")
    if b"\0" in content:
        raise ValueError("it holds zero bytes, so it is no UTF-8 text; save it as UTF-8")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"it is no UTF-8 text (byte {error.start}: {error.reason}); save it as UTF-8") from error


def _shallow(parse: Callable[[], Any], language: str) -> Any:
    """What `parse` returns, when it is nested at most `MAX_DEPTH` deep."""
    try:
        found = parse()
    except RecursionError as error:
        raise ValueError(TOO_DEEP) from error
    except ValueError as error:  # of the parsers (they name the line) and of the hooks
        raise ValueError(f"it is no sound {language}: {error}") from error
    level: Iterable[Any] = [found]
    for _ in range(MAX_DEPTH + 1):
        level = [inner for outer in level for inner in _inside(outer)]
        if any(isinstance(value, int) and value.bit_length() > MAX_NUMBER_BITS for value in level):
            raise ValueError("it holds a whole number of insane size")
        if not level:
            return found
    raise ValueError(TOO_DEEP)


def _inside(value: Any) -> Iterable[Any]:
    if isinstance(value, dict):
        return value.values()
    return value if isinstance(value, list) else ()


def _finite_float(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{_short(text)} is no finite number")
    return value


def _whole_number(text: str) -> int:
    if len(text) > MAX_NUMBER_CHARACTERS:
        raise ValueError(f"{_short(text)} is no number of sane size")
    return int(text)


def _short(text: str) -> str:
    return text if len(text) <= 30 else f"{text[:20]}... ({len(text)} characters)"


def _without_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in pairs:
        if key in found:
            raise ValueError(f"the key {key!r} is given twice")
        found[key] = value
    return found
