"""The label beside an image of another format: what the image's own header leaves open is taken from it."""

from dataclasses import replace
from pathlib import Path
from typing import Any

from catalog.detached import LABEL_SUFFIXES, PDS4_SUFFIXES, label_beside
from catalog.errors import RefusedError
from catalog.readers.keywords import facts_of_keywords, plain_values
from catalog.readers.label_values import plain_label
from catalog.readers.names import camera_of_names
from catalog.readers.pds3_image import keywords_of, parsed_label
from catalog.readers.pds4 import facts_of_xml, parsed_xml
from catalog.readers.reading import Reading


def pixel_file(path: Path) -> Path:
    """The file that a detached label describes; the file itself where it is no label, or its image is not there."""
    other = label_beside(path)
    is_label = other is not None and path.suffix in LABEL_SUFFIXES and other.suffix not in LABEL_SUFFIXES
    return other if other is not None and is_label else path


def completed(reading: Reading, path: Path) -> Reading:
    """The reading, with what its file left open taken from the label beside it, and that label kept for provenance.

    A label that cannot be parsed stops no image that carries its own: its fault is a remark."""
    label = label_beside(path)
    if reading.format in ("pds3", "pds4", "isis2") or label is None or label.suffix not in LABEL_SUFFIXES:
        return reading
    try:
        facts = _facts(path, label)
    except RefusedError as refusal:
        return replace(reading, remarks=(*reading.remarks, f"the label {label.name} is not used: {refusal.fault}"))
    open_facts: dict[str, Any] = {}
    if reading.time.et is None and not reading.time.fault:
        open_facts["time"] = facts["time"]
    if not reading.targets:
        open_facts["targets"] = facts["targets"]
    for key in ("exposure_s", "filter", "gain"):
        if getattr(reading, key) is None:
            open_facts[key] = facts[key]
    if reading.camera is None and camera_of_names(reading.instrument_names) is None:
        open_facts["instrument_names"] = (*reading.instrument_names, *facts["instrument_names"])
    if reading.stated.summing is None and reading.stated.window is None and reading.stated.first is None:
        open_facts["stated"] = facts["stated"]
    origins = {"targets": "target", "instrument_names": "camera", "stated": "mode"}
    taken = [origins.get(key, key) for key in open_facts]
    sources = {what: f"{facts['sources'][what]} in {label.name}" for what in taken if what in facts["sources"]}
    kept = {**facts["label"], **reading.label}
    return replace(reading, **open_facts, sources={**reading.sources, **sources}, label=kept)


def _facts(path: Path, label: Path) -> dict[str, Any]:
    if label.suffix.lower() in PDS4_SUFFIXES:
        return facts_of_xml(parsed_xml(path, label))
    keywords = keywords_of(parsed_label(path, label))
    return {**facts_of_keywords(keywords), "label": plain_label(plain_values(keywords))}
