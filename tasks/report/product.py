"""What a page says of one image: its row of the index, its result, its provenance."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from catalog.errors import PlanetposeError
from catalog.plain_files import own_json
from catalog.regular_file import read_regular_text
from tasks.publish.names import CUBE, RESULT, SETTINGS

Fact = tuple[str, str]
ATTRIBUTES = ("title", "source", "history", "utc", "pixel_space", "resampling_kernel", "references")
UNKNOWN = "–"


@dataclass
class ImageEntry:
    """One image. row: of the index. facts: what was found, provenance: what it was made from, both as names and texts.
    pictures: file name, heading, caption. missing: pictures that could not be drawn, and why."""

    product: str
    row: dict[str, Any]
    facts: list[Fact] = field(default_factory=list)
    provenance: list[Fact] = field(default_factory=list)
    settings: str = ""
    result: str = ""
    thumbnail: str | None = None
    pictures: list[tuple[str, str, str]] = field(default_factory=list)
    missing: dict[str, str] = field(default_factory=dict)

    @property
    def status(self) -> str:
        """Verdict."""
        return str(self.row["status"])

    @property
    def reason(self) -> str:
        """Why it is not ok; empty when it is."""
        reason = self.row.get("reason")
        return reason if isinstance(reason, str) else ""


def image_entry(folder: Path, row: dict[str, Any]) -> ImageEntry:
    """Gather what `folder` says of its image; what is missing stays empty."""
    result = _text(folder / RESULT)
    entry = ImageEntry(folder.name, row, settings=_text(folder / SETTINGS), result=result)
    entry.facts = facts_of(own_json(result)) if result else []
    entry.provenance = provenance_of(folder)
    return entry


def facts_of(result: dict[str, Any]) -> list[Fact]:
    """The result's main figures with their 1-sigma."""
    sigma = result.get("uncertainty") or {}
    similarity = result.get("similarity") or {}
    seconds = result.get("seconds") or {}
    facts = [
        ("camera", str(result.get("camera") or UNKNOWN)),
        ("target", str(result.get("target") or UNKNOWN)),
        ("middle of the exposure", str(result.get("utc") or UNKNOWN)),
        ("predicted pose from", str(result.get("pose_source") or UNKNOWN)),
        ("profile", str(result.get("profile") or UNKNOWN)),
    ]
    for key, label, digits in (
        ("centre_px", "centre, px", 3),
        ("offset_px", "offset, px", 3),
        ("range_factor", "range factor", 6),
        ("attitude_deg", "turn of the body, deg", 3),
        ("roll_deg", "roll of the camera, deg", 3),
    ):
        facts.append((label, _measured(result.get(key), sigma.get(key), digits)))
    facts.append(
        ("limb rms, px", f"{_number(result.get('limb_rms_px'), 3)} on {result.get('limb_points') or 0} segments")
    )
    before, after = (_number(similarity.get(key), 3) for key in ("before", "after"))
    facts.append(("similarity, before and after", f"{before}, {after}"))
    if seconds:
        facts.append(("seconds", ", ".join(f"{step} {value:.1f}" for step, value in seconds.items())))
    return facts


def provenance_of(folder: Path) -> list[Fact]:
    """The cube's attributes and the flattened provenance in it."""
    from tasks.pictures.product import opened_cube

    try:
        with opened_cube(folder) as cube:
            attributes = dict(cube.attrs)
        nested = own_json(attributes.get("provenance", "{}"))
    except (PlanetposeError, OSError, ValueError) as error:
        return [(CUBE, f"cannot be read: {error}")]
    facts = [(name, str(attributes[name])) for name in ATTRIBUTES if name in attributes]
    return facts + list(_flat("", nested))


def _flat(prefix: str, value: Any) -> list[Fact]:
    """Nested values as dotted names and texts."""
    if isinstance(value, dict):
        return [fact for key, inner in value.items() for fact in _flat(f"{prefix}.{key}" if prefix else key, inner)]
    if isinstance(value, list) and any(isinstance(inner, dict | list) for inner in value):
        return [fact for number, inner in enumerate(value) for fact in _flat(f"{prefix}[{number}]", inner)]
    return [
        (prefix, " ".join(map(str, value)) if isinstance(value, list) else UNKNOWN if value is None else str(value))
    ]


def _measured(value: Any, sigma: Any, digits: int) -> str:
    if value is None:
        return "not determined"
    values = value if isinstance(value, list) else [value]
    sigmas = sigma if isinstance(sigma, list) else [sigma] * len(values)
    return ", ".join(
        _number(v, digits) if s is None else f"{_number(v, digits)} ± {_number(s, digits)}"
        for v, s in zip(values, sigmas, strict=False)
    )


def _number(value: Any, digits: int) -> str:
    return UNKNOWN if value is None else f"{value:.{digits}f}"


def _text(path: Path) -> str:
    """A JSON file's text; empty when there is none, or no JSON in it."""
    try:
        text = read_regular_text(path)
        own_json(text)
    except (OSError, ValueError):
        return ""
    return text
