"""From the spellings found in labels to the catalog's names of cameras and targets."""

import re
from collections.abc import Iterable, Mapping
from itertools import product
from typing import Any

from catalog.camera import known_cameras
from catalog.readers.label_values import items
from catalog.target import target_names

HOST_KEYS = (
    "INSTRUMENT_HOST_NAME",
    "INSTRUMENT_HOST_ID",
    "SPACECRAFT_NAME",
    "MISSION_NAME",
    "MISSION",
    "HOSTNAME",
    "TELESCOP",
)
INSTRUMENT_KEYS = ("INSTRUMENT_ID", "INSTRUMENT_NAME", "SENSOR", "INSTRUME", "INSTRU")
CUT_OFF_LENGTH = 8
NO_TARGET = {"", "N/A", "UNK", "UNKNOWN", "NULL", "NONE", "SKY", "DARK", "CAL", "CALIBRATION", "STAR", "---"}


def instrument_names(label: Mapping[str, Any]) -> tuple[str, ...]:
    """Every upper-case "HOST/INSTRUMENT" that the label's keywords make (`HOST_KEYS` by `INSTRUMENT_KEYS`)."""
    hosts, instruments = (
        [str(label[key]).strip().upper() for key in keys if isinstance(label.get(key), str) and label[key].strip()]
        for keys in (HOST_KEYS, INSTRUMENT_KEYS)
    )
    return tuple(dict.fromkeys(f"{host}/{instrument}" for host, instrument in product(hosts, instruments)))


def camera_of_names(names: Iterable[str]) -> str | None:
    """The catalog camera one of whose `label_names` is among `names` (upper-case, runs of blanks count as one)."""
    found = {_normal(name) for name in names}
    for camera in known_cameras().values():
        if found & {_normal(name) for name in camera.label_names}:
            return camera.name
    return None


def _normal(name: str) -> str:
    return re.sub(r"\s+", " ", name.strip().upper())


def target_of_label(name: Any) -> str | None:
    """Catalog name of the label's target; the lower-case spelling itself when the catalog does not have the body."""
    text = str(name if name is not None else "").strip()
    if text.upper() in NO_TARGET:
        return None
    return _full_name(text.lower())


def targets_of_label(value: Any) -> tuple[str, ...]:
    """Catalog names of all targets that a label's value names: a word, a sequence, a set, or words with commas."""
    parts = [part for item in items(value) for part in ([item] if _is_one_name(item) else re.split(r"[,;]", str(item)))]
    named = (target_of_label(str(part).strip(" ()'\"{}") if part is not None else None) for part in parts)
    return tuple(dict.fromkeys(name for name in named if name is not None))


def sole_target(names: Iterable[str]) -> str | None:
    """The only one of a label's targets, or the only one of several that the catalog knows."""
    all_names = list(names)
    known = [name for name in all_names if name in target_names()] if len(all_names) > 1 else all_names
    return known[0] if len(known) == 1 else None


def _is_one_name(item: Any) -> bool:
    return item is None or str(item).strip().lower() in target_names()


def _full_name(name: str) -> str:
    """Catalog name of a spelling; Voyager's labels cut names off after eight characters (ENCELADU)."""
    names = target_names()
    if name in names or len(name) != CUT_OFF_LENGTH:
        return names.get(name, name)
    meant = {target for spelling, target in names.items() if spelling.startswith(name)}
    return meant.pop() if len(meant) == 1 else name
