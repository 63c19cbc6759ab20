"""The middle of an exposure out of everything that a label says of its time.

Labels say it several times over: start, stop, middle, read-out, duration. What most of them agree on is taken; what
contradicts it is named; where nothing agrees no time is taken at all.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from catalog.times import DayOnlyError, et_from_time, et_from_utc, utc_from_et

Place = Literal["start", "middle", "end", "near"]
SHIFT: dict[Place, float] = {"start": 0.5, "middle": 0.0, "end": -0.5, "near": 0.0}
RANK: dict[Place, int] = {"middle": 0, "start": 1, "end": 2, "near": 3}
AGREE_S = 3.0
"""Times of one exposure may differ by that: labels round to seconds, and some count 2 s of read-out."""
NEAR_S = 60.0
"""A read-out time (the slowest read-out of Voyager takes 48 s times its scan rate of 1) lies that near the exposure."""
SAME_LENGTH_S = 1.0
MAX_EXPOSURE_S = 7200.0
"""The longest exposures of cameras of planets take half an hour."""
FIRST_YEAR, LAST_YEAR = 1957, 2150
NOBODY_THERE = "no camera was in space then"
UNIX_ZERO = -946727958.816  # 1970-01-01T00:00:00 UTC: a clock that was never set
UNKNOWN = {"", "N/A", "NA", "UNK", "UNKNOWN", "NULL", "NONE", "TBD", "-", "--", "---", "NOT APPLICABLE"}


@dataclass(frozen=True)
class TimeClaim:
    """One statement of a label. keyword, value: as written. place: what the time is of; `near` for a read-out, which
    lies close to the exposure only. et: TDB seconds past J2000; None when it is no time of an exposure, `fault` says
    why. day_et: midnight of a day without a time of day."""

    keyword: str
    value: str
    place: Place
    et: float | None = None
    fault: str = ""
    day_et: float | None = None

    def __str__(self) -> str:
        return f"{self.keyword} = {self.value}"


@dataclass(frozen=True)
class ExposureTime:
    """et: the middle, TDB seconds past J2000, or None. contradictions: what contradicts it, a sentence each. fault: why
    there is no time although the label speaks of it. source: the keywords that agree on the middle."""

    et: float | None = None
    contradictions: tuple[str, ...] = ()
    fault: str = ""
    source: str = ""


UNKNOWN_TIME = ExposureTime()


def claim(keyword: str, value: str | None, place: Place, scale: str = "utc", later_s: float = 0.0) -> list[TimeClaim]:
    """The statement that a keyword makes, [] where it says that nothing is known. later_s: added to the time."""
    if value is None or value.strip().upper() in UNKNOWN:
        return []
    text = value.strip()
    if text[:4].isdecimal() and not FIRST_YEAR <= int(text[:4]) < LAST_YEAR:
        return [TimeClaim(keyword, text, place, fault=NOBODY_THERE)]
    try:
        et = et_from_time(text, scale)
    except DayOnlyError:
        try:
            day_et = et_from_utc(f"{text}T00:00:00")
        except ValueError:
            return [TimeClaim(keyword, text, place, fault="it is no time")]
        return [TimeClaim(keyword, text, place, fault="it is a day without a time of day", day_et=day_et)]
    except (ValueError, OverflowError):
        return [TimeClaim(keyword, text, place, fault="it is no time")]
    return [checked(TimeClaim(keyword, text, place, et + later_s))]


def checked(stated: TimeClaim) -> TimeClaim:
    """The statement, with a fault where no camera can have been exposed then."""
    if stated.et is None:
        return stated
    if not et_of_year(FIRST_YEAR) <= stated.et < et_of_year(LAST_YEAR):
        return TimeClaim(stated.keyword, stated.value, stated.place, fault=NOBODY_THERE)
    if abs(stated.et - UNIX_ZERO) < 1.0:
        return TimeClaim(stated.keyword, stated.value, stated.place, fault="it is the zero of a clock that was not set")
    return stated


def et_of_year(year: int) -> float:
    """TDB seconds past J2000 of a year's beginning, to a day."""
    return (year - 2000) * 365.25 * 86400.0


def exposure_time(
    claims: Iterable[TimeClaim], lengths_s: Mapping[str, float | None], gaps_count: bool = False
) -> ExposureTime:
    """The middle that most of the statements agree on.

    lengths_s: exposure times by keyword, seconds. gaps_count: start and stop may be of several exposures with gaps
    between them (FITS), so that their middle stands whatever the exposure time is.
    """
    claims = list(claims)
    sound = sorted((c for c in claims if c.et is not None), key=lambda c: RANK[c.place])
    unsound = [c for c in claims if c.et is None]
    if not sound:
        return ExposureTime(fault="; ".join(f"{c}: {c.fault}" for c in unsound))
    known = {k: v for k, v in lengths_s.items() if v is not None and 0 <= v <= MAX_EXPOSURE_S}
    answers = [
        _answer(sound, anchor, length, known, gaps_count) for anchor, length in _trials(sound, known, gaps_count)
    ]
    best = max((answer.votes, len(answer.agreeing)) for answer in answers)
    leading = [answer for answer in answers if (answer.votes, len(answer.agreeing)) == best]
    first = leading[0]
    if len(leading) > 1 and _spread(answers) <= NEAR_S:  # no gross error: the middle of start and stop, if there is one
        first = next((answer for answer in answers if len(answer.agreeing) > 1), first)
    elif _spread(leading) > AGREE_S:
        stated = "; ".join([*map(str, claims), *(f"{k} = {v:g} s" for k, v in known.items())])
        return ExposureTime(fault=f"its times contradict each other: {stated}")
    source = " and ".join(stated.keyword for stated in first.agreeing)
    return ExposureTime(first.middle_et, _contradictions(first, claims, known, gaps_count), source=source)


def _spread(answers: "list[_Answer]") -> float:
    middles = [answer.middle_et for answer in answers]
    return max(middles) - min(middles)


@dataclass(frozen=True)
class _Answer:
    middle_et: float
    length_s: float
    agreeing: tuple[TimeClaim, ...]
    votes: int


def _trials(sound: list[TimeClaim], known: Mapping[str, float], gaps_count: bool) -> list[tuple[TimeClaim, float]]:
    """Every statement that could be right with every exposure time that could be."""
    starts, ends = ([c.et for c in sound if c.place == place and c.et is not None] for place in ("start", "end"))
    spans = [end - start for start in starts for end in ends if 0 <= end - start <= MAX_EXPOSURE_S]
    lengths = spans or [*known.values()] if gaps_count else [*known.values(), *spans]
    return [(anchor, length) for length in dict.fromkeys(lengths or [0.0]) for anchor in sound]


def _answer(
    sound: list[TimeClaim], anchor: TimeClaim, length_s: float, known: Mapping[str, float], gaps_count: bool
) -> _Answer:
    middle = _middle(anchor, length_s)
    agreeing = tuple(c for c in sound if _agrees(c, middle, length_s))
    votes = len(agreeing) + sum(_same_length(value, length_s, gaps_count) for value in known.values())
    if length_s not in known.values():
        votes -= 1  # start and stop agree with their own difference
    pair = [[_et(c) for c in agreeing if c.place == place] for place in ("start", "end")]
    if anchor.place in ("start", "end") and all(pair):
        middle = (pair[0][0] + pair[1][0]) / 2
    return _Answer(middle, length_s, agreeing, votes)


def _et(stated: TimeClaim) -> float:
    return float("nan") if stated.et is None else stated.et


def _middle(stated: TimeClaim, length_s: float) -> float:
    return _et(stated) + SHIFT[stated.place] * length_s


def _agrees(stated: TimeClaim, middle_et: float, length_s: float) -> bool:
    allowed = NEAR_S + length_s if stated.place == "near" else AGREE_S
    return abs(_middle(stated, length_s) - middle_et) <= allowed


def _same_length(value: float, length_s: float, gaps_count: bool) -> bool:
    shorter = gaps_count and value <= length_s + SAME_LENGTH_S
    return shorter or abs(value - length_s) <= SAME_LENGTH_S + 0.01 * length_s


def _contradictions(
    answer: _Answer, claims: list[TimeClaim], known: Mapping[str, float], gaps_count: bool
) -> tuple[str, ...]:
    used = f"the label's other times are used, the middle is {utc_from_et(answer.middle_et)}"
    found = []
    for stated in claims:
        if stated.day_et is not None and -43200 < answer.middle_et - stated.day_et < 129600:
            continue  # the day is right
        if stated.et is None:
            found.append(f"the label says {stated}: {stated.fault}; {used}")
        elif stated not in answer.agreeing:
            found.append(f"the label says {stated}, which contradicts {_listed(answer.agreeing)}; {used}")
    found += [
        f"the label says {keyword} = {value:g} s, which contradicts {_listed(answer.agreeing)}; {used}"
        for keyword, value in known.items()
        if len(answer.agreeing) > 1 and not _same_length(value, answer.length_s, gaps_count)
    ]
    return tuple(found)


def _listed(claims: Iterable[TimeClaim]) -> str:
    return " and ".join(map(str, claims))
