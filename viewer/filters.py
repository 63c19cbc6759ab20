"""Filters of the table of images, as people type them: `sigma > 0.1`, `status = doubtful and camera ~ voyager`.

A comparison is a column, one of `> >= < <= = != ~ !~` and a number or text (`~`: contains); a bare word is looked for
in all texts. Comparisons are joined by `and` (or nothing), `or`, `not` and parentheses. What is unknown fits no
comparison.
`tasks/report/filter.js` has the same grammar, for pages without a server.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from catalog.errors import WrongOptionError

if TYPE_CHECKING:
    import pandas as pd

Mask = NDArray[np.bool_]
TOKEN = re.compile(r"""\s*(?:(>=|<=|!=|==|!~|[><=~()])|"([^"]*)"|'([^']*)'|([^\s()<>=!~"']+))""")
OPERATORS = (">", ">=", "<", "<=", "=", "==", "!=", "~", "!~")
WORDS = {"and", "or", "not"}
# Short names of columns, for people.
ALIASES = {
    "sigma": "sigma_px",
    "offset": "offset_px",
    "verdict": "status",
    "limb": "limb_rms_px",
    "phase": "phase_deg",
    "range": "range_km",
    "resolution": "resolution_km",
    "radius": "radius_px",
    "turn": "attitude_deg",
    "similarity": "similarity_after",
    "time": "utc",
}
LONGEST = 2000
DEEPEST = 50


@dataclass(frozen=True)
class Token:
    """One word of a filter. quoted: it is text, whatever it looks like."""

    text: str
    quoted: bool = False

    @property
    def keyword(self) -> str:
        """`and`, `or`, `not` or a parenthesis; empty for others."""
        lower = self.text.lower()
        return lower if not self.quoted and (lower in WORDS or lower in "()") else ""


def filtered(table: "pd.DataFrame", text: str) -> Mask:
    """Which rows (n,) of the table fit. Raises WrongOptionError that says what is wrong with the text."""
    tokens = tokens_of(text)
    if not tokens:
        return np.ones(len(table), dtype=np.bool_)
    parser = _Parser(tokens, table)
    mask = parser.alternatives(0)
    if parser.rest:
        raise wrong(f"{parser.rest[0].text!r} is not expected here.")
    return mask


def tokens_of(text: str) -> list[Token]:
    """Words of a filter. Raises WrongOptionError."""
    if len(text) > LONGEST:
        raise wrong(f"it is longer than {LONGEST} characters.")
    tokens, at, text = [], 0, text.rstrip()
    while at < len(text):
        found = TOKEN.match(text, at)
        if not found:
            raise wrong(f"{text[at:].strip()!r} cannot be read.")
        quoted = found[2] if found[2] is not None else found[3]
        tokens.append(Token(quoted, True) if quoted is not None else Token(found[1] or found[4]))
        at = found.end()
    return tokens


def wrong(fault: str) -> WrongOptionError:
    """The refusal of a filter."""
    remedy = "Write for example: sigma > 0.1 and status = doubtful, or words to look for."
    return WrongOptionError("filter", f"the filter: {fault}", remedy)


class _Parser:
    """Recursive descent; each method takes tokens from `rest` and returns a mask."""

    def __init__(self, tokens: list[Token], table: "pd.DataFrame") -> None:
        self.rest, self.table = tokens, table

    def alternatives(self, depth: int) -> Mask:
        if depth > DEEPEST:
            raise wrong("it has too many parentheses.")
        mask = self.together(depth)
        while self.rest and self.rest[0].keyword == "or":
            self.rest.pop(0)
            mask = mask | self.together(depth)
        return mask

    def together(self, depth: int) -> Mask:
        mask = self.single(depth)
        while self.rest and self.rest[0].keyword not in ("or", ")"):
            if self.rest[0].keyword == "and":
                self.rest.pop(0)
            mask = mask & self.single(depth)
        return mask

    def single(self, depth: int) -> Mask:
        if not self.rest:
            raise wrong("it ends where something is expected.")
        token = self.rest.pop(0)
        if token.keyword == "not":
            return ~self.single(depth + 1) if depth < DEEPEST else self.alternatives(depth + 1)
        if token.keyword == "(":
            mask = self.alternatives(depth + 1)
            if not self.rest or self.rest.pop(0).keyword != ")":
                raise wrong("a parenthesis is not closed.")
            return mask
        if token.keyword or (token.text in OPERATORS and not token.quoted):
            raise wrong(f"{token.text!r} is not expected here.")
        if self.rest and self.rest[0].text in OPERATORS and not self.rest[0].quoted:
            operator = self.rest.pop(0).text
            if not self.rest or self.rest[0].keyword or (self.rest[0].text in OPERATORS and not self.rest[0].quoted):
                raise wrong(f"{token.text} {operator} lacks a value.")
            return compared(self.table, token.text, operator, self.rest.pop(0).text)
        return anywhere(self.table, token.text)


def anywhere(table: "pd.DataFrame", word: str) -> Mask:
    """Rows that have the word in any text."""
    mask = np.zeros(len(table), dtype=np.bool_)
    for name in texts_of(table):
        mask |= contains(table, name, word)
    return mask


def texts_of(table: "pd.DataFrame") -> list[str]:
    """Names of the columns that hold text."""
    return [str(name) for name in table.columns if not is_number(table, str(name)) and name not in ("utc", "stamp")]


def is_number(table: "pd.DataFrame", name: str) -> bool:
    """Whether a column holds numbers."""
    return table[name].dtype.kind in "fiub" or str(table[name].dtype) == "Int64"


def compared(table: "pd.DataFrame", name: str, operator: str, value: str) -> Mask:
    """Rows whose column fits. Raises WrongOptionError for an unknown column, and for text where a number is needed."""
    column = ALIASES.get(name.lower(), name.lower())
    if column not in table.columns:
        raise wrong(f"there is no column {name!r}; known are {', '.join((*ALIASES, *map(str, table.columns)))}.")
    if column == "utc":
        return _compared_time(table, operator, value)
    if operator in ("~", "!~"):
        found = contains(table, column, value)
        return found if operator == "~" else ~found
    if is_number(table, column):
        try:
            number = float(value)
        except ValueError as error:
            raise wrong(f"{name} is a number, {value!r} is none.") from error
        values = table[column].to_numpy(dtype=np.float64, na_value=np.nan)
        return _COMPARE[operator](values, number) & np.isfinite(values)
    return _compared_text(table, column, operator, value)


def contains(table: "pd.DataFrame", column: str, word: str) -> Mask:
    """Rows whose column has `word` in it, in any case."""
    series = table[column]
    if str(series.dtype) == "category":
        fits = series.cat.categories.astype(str).str.contains(word, case=False, regex=False)
        return _by_category(series, fits)
    found = series.astype("str").str.contains(word, case=False, regex=False)
    return np.asarray(found.fillna(False), dtype=np.bool_)


def _compared_text(table: "pd.DataFrame", column: str, operator: str, value: str) -> Mask:
    series, wanted = table[column], value.lower()
    if str(series.dtype) == "category":
        fits = np.array([_COMPARE[operator](str(each).lower(), wanted) for each in series.cat.categories], dtype=bool)
        return _by_category(series, fits)
    known = np.asarray(series.notna(), dtype=np.bool_)
    lower = series.astype("str").str.lower().fillna("").to_numpy(dtype=object)
    return np.asarray(_COMPARE[operator](lower, wanted), dtype=np.bool_) & known


def _by_category(series: Any, fits: Any) -> Mask:
    codes = series.cat.codes.to_numpy()
    return np.where(codes >= 0, np.append(np.asarray(fits, dtype=np.bool_), False)[codes], False)


def _compared_time(table: "pd.DataFrame", operator: str, value: str) -> Mask:
    """A date alone means its beginning; `~` looks into the text."""
    import pandas as pd

    if operator in ("~", "!~"):
        found = table["utc"].dt.strftime("%Y-%m-%dT%H:%M:%S").fillna("").str.contains(value, regex=False)
        return np.asarray(found if operator == "~" else ~found, dtype=np.bool_)
    try:
        moment = pd.to_datetime(value, utc=True)
    except (ValueError, OverflowError) as error:
        raise wrong(f"{value!r} is no time; write 1979-03-04 or 1979-03-04T19:22:59.") from error
    known = np.asarray(table["utc"].notna(), dtype=np.bool_)
    return np.asarray(_COMPARE[operator](table["utc"], moment), dtype=np.bool_) & known


_COMPARE: Mapping[str, Callable[[Any, Any], Any]] = {
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    "=": lambda a, b: a == b,
    "==": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
}
