"""PDS3 labels, parsed by pvl: detached (.LBL beside the image) or in the head of the file."""

import re
import warnings
from datetime import date, datetime
from pathlib import Path
from typing import Any

MAX_LABEL_BYTES = 100_000
MAX_STATEMENTS = 2000  # the parser takes about half a millisecond for each
MAX_DEPTH = 20
MAX_ITEMS = 10_000
MAX_DASHES_AT_LINE_ENDS = 100  # continued words, which the parser tries in many ways
PARSER_FAULTS = (ValueError, TypeError, LookupError, ArithmeticError, RecursionError, StopIteration)
"""What pvl raises for damaged labels, beside its own errors."""

AGGREGATION = re.compile(r"^\s*(END_)?(OBJECT|GROUP)\s*(=|$)", re.MULTILINE | re.IGNORECASE)


def detached_label(path: Path) -> dict[str, Any]:
    """The keywords of the label that lies beside an image (same name, .LBL or .lbl), {} when there is none.

    A label that cannot be parsed does not stop an image that carries its own: its fault is kept as PDS_LABEL_FAULT.
    """
    for suffix in (".LBL", ".lbl"):
        beside = path.with_suffix(suffix)
        if beside != path and beside.is_file() and beside.stat().st_size <= MAX_LABEL_BYTES:
            try:
                return parse_label(beside.read_bytes().decode("latin-1"))
            except ValueError as error:
                return {"PDS_LABEL_FAULT": f"{beside.name}: {error}"}
    return {}


def parse_label(content: str) -> dict[str, Any]:
    """The label's top-level keywords: times as ISO text, quantities as their number (times in seconds), the rest as is.

    Raises ValueError when the text is no PDS3 label, or larger or deeper nested than any image's.
    """
    check_size_of_label(content)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pvl warns of its own deprecated class whenever it is imported
        import pvl
        from pvl.exceptions import LexerError, ParseError, QuantityError

    try:
        module = pvl.loads(content)
    except (LexerError, ParseError, QuantityError, *PARSER_FAULTS) as error:
        raise ValueError(f"no PDS3 label ({error})") from error
    return {str(key): _plain(value) for key, value in module.items() if not hasattr(value, "items")}


def check_size_of_label(content: str, times: int = 1) -> None:
    """Raise ValueError for a text that would keep the parser busy for more than seconds, or exhaust its stack. times:
    for labels that may be that much longer, such as those of indices."""
    bare = re.sub(r'"[^"]*"', '""', content)
    counts = {
        "bytes": (len(content), MAX_LABEL_BYTES * times),
        "statements": (bare.count("=") + len(AGGREGATION.findall(bare)), MAX_STATEMENTS * times),
        "items": (bare.count(","), MAX_ITEMS),
        "words continued on the next line": (len(re.findall(r"-[ \t]*[\r\n]", bare)), MAX_DASHES_AT_LINE_ENDS),
        "nested brackets or objects": (_depth(bare), MAX_DEPTH),
    }
    for what, (found, allowed) in counts.items():
        if found > allowed:
            raise ValueError(f"no PDS3 label of an image: {found} {what}, at most {allowed} are read")


def _depth(bare: str) -> int:
    """The deepest nesting of brackets, or of OBJECT and GROUP, counting those that are never closed."""
    deepest = depth = 0
    for match in re.finditer(r"[({<]|[)}>]", bare):
        depth = max(depth + (1 if match.group() in "({<" else -1), 0)
        deepest = max(deepest, depth)
    level = outermost = 0
    for match in AGGREGATION.finditer(bare):
        level = max(level + (-1 if match.group(1) else 1), 0)
        outermost = max(outermost, level)
    return max(deepest, outermost)


def _plain(value: Any) -> Any:
    units = getattr(value, "units", None)
    if units is not None:
        milliseconds = str(units).upper() in ("MS", "MSEC", "MILLISECOND", "MILLISECONDS")
        return value.value / 1000 if milliseconds and isinstance(value.value, (int, float)) else value.value
    if isinstance(value, datetime):
        return value.replace(tzinfo=None).isoformat()
    return value.isoformat() if isinstance(value, date) else value
