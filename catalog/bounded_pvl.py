"""pvl, kept from what damaged labels make it do: loop for ever, exhaust the stack, or take minutes."""

import re
import warnings
from collections.abc import Generator
from typing import Any

MAX_LABEL_BYTES = 100_000
MAX_STATEMENTS = 2000  # the parser takes about half a millisecond for each
MAX_DEPTH = 20
MAX_ITEMS = 10_000
MAX_DASHES_AT_LINE_ENDS = 100  # continued words, which the parser tries in many ways
MOVES_PER_BYTE = 5  # between parser and lexer; sound labels need 0.1 to 0.7
AGGREGATION = re.compile(r"^\s*(END_)?(OBJECT|GROUP)\s*(=|$)", re.MULTILINE | re.IGNORECASE)
PARSER_FAULTS = (ValueError, TypeError, LookupError, ArithmeticError, RecursionError, StopIteration)
"""What pvl raises for damaged labels, beside errors of its own."""


class BoundedTokens(Generator[Any, Any, None]):
    """The lexer's tokens, until the parser has taken so many that it must be going in circles."""

    def __init__(self, tokens: Generator[Any, Any, None], content: str) -> None:
        self._tokens, self._content = tokens, content
        self._moves_left = MOVES_PER_BYTE * len(content) + 1000

    def send(self, value: Any) -> Any:
        """The next token, or `value` given back. Raises pvl's LexerError, which its parser lets through."""
        from pvl.exceptions import LexerError

        self._moves_left -= 1
        if self._moves_left < 0:
            raise LexerError("the parser goes in circles", self._content, 0, "")
        return self._tokens.send(value)

    def throw(self, *fault: Any) -> Any:
        """Raise a fault where the lexer is."""
        return self._tokens.throw(*fault)


def load_pvl(content: str, times: int = 1) -> Any:
    """The parsed label, a multi-mapping. times: for labels that may be that much longer than an image's (of indices).
    Raises ValueError when the text is no sound label, or larger or deeper nested than they are."""
    check_size(content, times)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pvl warns of its own deprecated class whenever it is imported
        import pvl
        import pvl.exceptions
        from pvl.lexer import lexer
        from pvl.parser import OmniParser

    def bounded(text: str, **options: Any) -> BoundedTokens:
        return BoundedTokens(lexer(text, **options), text)

    try:
        return pvl.loads(content, parser=OmniParser(lexer_fn=bounded))
    except (pvl.exceptions.ParseError, pvl.exceptions.QuantityError, *PARSER_FAULTS) as error:
        raise ValueError(f"no sound label ({error})") from error


def check_size(content: str, times: int = 1) -> None:
    """Raise ValueError for a text that would keep the parser busy for more than seconds, or exhaust its stack."""
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
            raise ValueError(f"no sound label of an image: {found} {what}, at most {allowed} are read")


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
