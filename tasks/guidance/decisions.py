"""Decisions about one image: a file of JSON in the store, `.guidance/PRODUCT.json`, that only grows.

A decision says who, when and why; undone ones stay and are marked. What helps the correction (`options`) is read by
`planetpose reprocess`, so that a later run makes the same product. Masks and start poses lie beside it.
"""

import getpass
import json
import os
import re
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

from catalog.errors import RefusedError
from catalog.plain_files import own_json
from catalog.reasons import Reason
from catalog.regular_file import read_regular_text
from catalog.safe_name import is_safe_product_name
from catalog.times import now_utc
from tasks.atomic import file_put_in_place, locked

GUIDANCE = ".guidance"
ACTIONS = ("accept", "reject", "note", "help")
REVIEWS = {"accept": "accepted", "reject": "rejected"}
# What a `help` may hold: the fields of a request that it fills, and the profile's name.
OPTIONS = ("start_offset_px", "resume", "mask", "hold", "profile")
LONGEST_TEXT = 4000
DAMAGE = (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError)


@dataclass(frozen=True)
class Decision:
    """who, when (UTC), why: in the user's words. options: of a `help`, how the correction is to be helped; file names
    are relative to the folder of guidance. undone: when it was taken back."""

    action: str
    who: str
    when: str
    why: str = ""
    options: dict[str, Any] = field(default_factory=dict)
    undone: str | None = None

    def __post_init__(self) -> None:
        if self.action not in ACTIONS:
            raise ValueError(f"no action {self.action!r}; known are {', '.join(ACTIONS)}")
        unknown = set(self.options) - set(OPTIONS)
        if unknown:
            raise ValueError(f"unknown options {sorted(unknown)}; known are {', '.join(OPTIONS)}")


def guidance_file(store: Path, product: str) -> Path:
    """Where the decisions about a product are. Raises RefusedError for what is no name of a product."""
    if not is_safe_product_name(product):
        raise RefusedError(Reason.PRODUCT_MISSING, f"{product!r} is no name of a product.", "Give one of the store.")
    return Path(store) / GUIDANCE / f"{product}.json"


def decisions_of(store: Path, product: str) -> list[Decision]:
    """All decisions about a product, the oldest first; none where there is no file. Raises RefusedError when the file
    is damaged."""
    path = guidance_file(store, product)
    try:
        content = own_json(read_regular_text(path))
        return [Decision(**entry) for entry in content["decisions"]]
    except FileNotFoundError:
        return []
    except DAMAGE as error:
        fault = f"{path} cannot be read ({type(error).__name__}: {error})."
        raise RefusedError(Reason.PRODUCT_UNREADABLE, fault, "Mend the file, or move it away.") from error


def decide(
    store: Path, product: str, action: str, why: str = "", options: dict[str, Any] | None = None, who: str | None = None
) -> Decision:
    """Add a decision and return it. Raises ValueError for an unknown action or option, RefusedError as `decisions_of`,
    OSError where the store cannot be written to."""
    made = Decision(action, (who or user_name())[:LONGEST_TEXT], now_utc(), why[:LONGEST_TEXT], dict(options or {}))
    _changed(store, product, lambda found: [*found, made])
    return made


def undo(store: Path, product: str) -> Decision | None:
    """Take the latest decision that stands back, and return it; None where none stands."""
    taken: list[Decision] = []

    def without_latest(found: list[Decision]) -> list[Decision]:
        standing = [index for index, each in enumerate(found) if each.undone is None]
        if standing:
            found[standing[-1]] = replace(found[standing[-1]], undone=now_utc())
            taken.append(found[standing[-1]])
        return found

    _changed(store, product, without_latest)
    return taken[0] if taken else None


def _changed(store: Path, product: str, change: Any) -> None:
    path = guidance_file(store, product)
    path.parent.mkdir(exist_ok=True)
    with (path.parent / ".lock").open("a") as lock, locked(lock):
        decisions = change(decisions_of(store, product))
        content = {"product": product, "decisions": [asdict(each) for each in decisions]}
        with file_put_in_place(path) as temporary:
            temporary.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")


def review_of(decisions: list[Decision]) -> tuple[str, str]:
    """(`accepted`, `rejected` or nothing; the latest note) of what stands."""
    standing = [each for each in decisions if each.undone is None]
    reviews = [REVIEWS[each.action] for each in standing if each.action in REVIEWS]
    notes = [each.why for each in standing if each.why and each.action != "help"]
    return reviews[-1] if reviews else "", notes[-1] if notes else ""


def help_in(store: Path, product: str) -> dict[str, Any]:
    """The options of the latest `help` that stands, with the paths of its files; nothing where none does. Raises
    RefusedError as `decisions_of`."""
    standing = [each for each in decisions_of(store, product) if each.action == "help" and each.undone is None]
    if not standing:
        return {}
    folder, options = Path(store) / GUIDANCE, dict(standing[-1].options)
    for name in ("mask", "resume"):
        if options.get(name):
            options[name] = _inside(folder, str(options[name]))
    return options


def _inside(folder: Path, name: str) -> Path:
    """A file of the folder of guidance. Raises RefusedError for one of elsewhere: the store may be a stranger's."""
    if not re.fullmatch(r"[^/\\]+", name) or name in (".", ".."):
        raise RefusedError(Reason.PRODUCT_ELSEWHERE, f"{name!r} is no file in {folder}.", "Mend the guidance.")
    return folder / name


def all_reviews(store: Path) -> dict[str, tuple[str, str]]:
    """`review_of` by product, for products that have decisions; damaged files are passed over."""
    found = {}
    try:
        names = sorted(os.listdir(Path(store) / GUIDANCE))
    except OSError:
        return {}
    for name in names:
        if name.endswith(".json") and not name.startswith("."):
            try:
                found[name.removesuffix(".json")] = review_of(decisions_of(store, name.removesuffix(".json")))
            except RefusedError:
                continue
    return found


def user_name() -> str:
    """Who decides, as the system knows them."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return "unknown"
