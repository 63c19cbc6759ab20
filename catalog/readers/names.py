"""From the spellings found in labels to the catalog's names of cameras and targets."""

import re
from collections.abc import Iterable, Mapping
from itertools import product
from typing import Any

from catalog.camera import Camera, known_cameras
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
NAIF_KEYS = ("NAIFID", "NAIF_INSTRUMENT_ID", "NAIF_IK_CODE")
NAIF = "NAIF "  # in front of an instrument's id, among the names
INSTRUMENT_KEYS = ("INSTRUMENT_ID", "INSTRUMENT_NAME", "SENSOR", "INSTRUME", "INSTRU")
SHORTEST_CUT_OFF = 6  # characters: labels have room for 8 to 12
RINGS = re.compile(r"(?:([jsun])|(.+?))[ _-]*rings?|rings?[ _]of[ _](.+)")
PLANET_LETTERS = {"j": "jupiter", "s": "saturn", "u": "uranus", "n": "neptune"}  # in Voyager's labels
NO_TARGET = {
    "",
    "N/A",
    "UNK",
    "UNKNOWN",
    "NULL",
    "NONE",
    "SKY",
    "DARK",
    "CAL",
    "CALIBRATION",
    "STAR",
    "STARS",
    "---",
    "?",
    "N-A",
    "NOT APPLICABLE",
    "OTHER",
    "SYSTEM",
    "DUST",
    "DARK SKY",
    "CAL LAMPS",
    "PLAQUE",
    "NON SCIENCE",
}
# The number of a minor planet, bare or in brackets, or of a comet, before its name; what is in brackets behind it.
NUMBERED = re.compile(r"(?:(?:\d+ ?)?[pdc]/|\(?\d+\)?[ _]*)(?=[a-z])")
IN_BRACKETS = re.compile(r" *\([^)]*\)?$")


def instrument_names(label: Mapping[str, Any]) -> tuple[str, ...]:
    """Every upper-case "HOST/INSTRUMENT" that the label's keywords make (`HOST_KEYS` by `INSTRUMENT_KEYS`), and the
    instrument's id of NAIF."""
    hosts, instruments = (
        [str(label[key]).strip().upper() for key in keys if isinstance(label.get(key), str) and label[key].strip()]
        for keys in (HOST_KEYS, INSTRUMENT_KEYS)
    )
    ids = [f"{NAIF}{label[key]}" for key in NAIF_KEYS if type(label.get(key)) is int]
    return tuple(dict.fromkeys([*(f"{host}/{instrument}" for host, instrument in product(hosts, instruments)), *ids]))


def camera_of_names(names: Iterable[str], size_px: tuple[int, int] | None = None) -> str | None:
    """The catalog camera one of whose `label_names` is among `names`, in any case; runs of blanks, hyphens and
    underscores count as one blank. size_px: (nx, ny) of the picture, which chooses between cameras of one name, as
    those of a detector and of the frames that its archive makes square."""
    found = {_normal(name) for name in names}
    cameras = [camera for camera in known_cameras().values() if found & _names_of(camera)]
    fitting = [camera for camera in cameras if size_px is not None and camera.detector_size_px == size_px]
    return next((camera.name for camera in (*fitting, *cameras)), None)


def _names_of(camera: Camera) -> set[str]:
    ids = () if camera.naif_instrument_id is None else (f"{NAIF}{camera.naif_instrument_id}",)
    return {_normal(name) for name in (*camera.label_names, *ids)}


def _normal(name: str) -> str:
    return re.sub(r"[\s_-]+", " ", name.strip().upper())


def target_of_label(name: Any) -> str | None:
    """Catalog name of the label's target; the lower-case spelling itself when the catalog does not have the body."""
    text = re.sub(r"[\s_]+", " ", str(name if name is not None else "").strip(" \t\r\n'\"*?!"))
    if text.upper() in NO_TARGET:
        return None
    return _full_name(_planet_of_rings(text.lower()))


def _planet_of_rings(name: str) -> str:
    """The planet of a label that names its rings (S RINGS, RINGS OF SATURN); other names as they are."""
    match = RINGS.fullmatch(name)
    if match is None:
        return name
    letter, before, after = match.groups()
    return PLANET_LETTERS[letter] if letter else str(before or after)


def targets_of_label(value: Any) -> tuple[str, ...]:
    """Catalog names of all targets that a label's value names: a word, a sequence, a set, or words with commas. A
    planet's rings mean the planet where nothing else is named."""
    parts = [part for item in items(value) for part in ([item] if _is_one_name(item) else re.split(r"[,;]", str(item)))]
    words = [str(part).strip(" ()'\"{}") for part in parts if part is not None]
    bodies = [word for word in words if not RINGS.fullmatch(word.lower()) and target_of_label(word) is not None]
    named = (target_of_label(word) for word in bodies or words)
    return tuple(dict.fromkeys(name for name in named if name is not None))


def sole_target(names: Iterable[str]) -> str | None:
    """The only one of a label's targets, or the only one of several that the catalog knows."""
    all_names = list(names)
    known = [name for name in all_names if name in target_names()] if len(all_names) > 1 else all_names
    return known[0] if len(known) == 1 else None


def _is_one_name(item: Any) -> bool:
    return item is None or str(item).strip().lower() in target_names()


def _full_name(name: str) -> str:
    """Catalog name of a spelling; labels cut names off where their room ends (ENCELADU of Voyager)."""
    names = target_names()
    bare = IN_BRACKETS.sub("", name).rstrip(" ._")
    known = (names[each] for each in (name, bare, NUMBERED.sub("", bare, count=1)) if each in names)
    if (found := next(known, None)) is not None:
        return found
    if len(name) < SHORTEST_CUT_OFF:
        return name
    meant = {target for spelling, target in names.items() if spelling.startswith(name)}
    return meant.pop() if len(meant) == 1 else name
