"""Damage real files by the thousand and have each read: who refuses, reads, crashes, hangs."""

import tempfile
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from catalog.detached import label_beside
from catalog.errors import RefusedError
from catalog.lists.scan import looks_like_an_image
from catalog.reasons import Reason
from lab.fuzz.damage import DAMAGES
from lab.fuzz.reader_process import ReaderProcess

OUTCOMES = ("refused", "read", "crash", "hang")
MEMORY_BYTES = 3_000_000_000
TIMEOUT_S = 60.0


@dataclass(frozen=True)
class Original:
    """An undamaged image and the detached label beside it; of a label that was named, the file with the pixels."""

    path: Path
    label: Path | None


@dataclass(frozen=True)
class Damaged:
    """One damaged file: which image, what was done to it (or to its label), where it lies."""

    original: Original
    damage: str
    path: Path


@dataclass
class Findings:
    """Outcomes by damage and by image; of those read, what differs from the original; the worst of all."""

    by_damage: dict[str, Counter[str]] = field(default_factory=lambda: defaultdict(Counter))
    by_image: dict[str, Counter[str]] = field(default_factory=lambda: defaultdict(Counter))
    changed: Counter[str] = field(default_factory=Counter)
    bad: list[dict[str, Any]] = field(default_factory=list)
    slowest_s: float = 0.0
    peak_mb: int = 0

    @property
    def total(self) -> Counter[str]:
        """Outcomes of all files."""
        return sum(self.by_damage.values(), Counter())

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "files": self.total.total(),
            "total": dict(self.total),
            "by_damage": {name: dict(counts) for name, counts in self.by_damage.items()},
            "by_image": {name: dict(counts) for name, counts in self.by_image.items()},
            "read_with": dict(self.changed),
            "slowest_s": round(self.slowest_s, 3),
            "peak_mb": self.peak_mb,
            "bad": self.bad,
        }


def originals_in(folder: Path) -> list[Original]:
    """Every image below `folder`. Raises RefusedError when there is none."""
    found = []
    for path in sorted(folder.rglob("*")):
        if looks_like_an_image(path):
            found.append(Original(path, label_beside(path)))
    if not found:
        raise RefusedError(Reason.NO_IMAGES, f"{folder} holds no image.", "Give the folder of real files (--folder).")
    return found


def damaged_files(originals: list[Original], count: int, seed: int, folder: Path) -> Iterator[Damaged]:
    """`count` damaged files one by one, each in place of the one before; images and damages take turns."""
    names = list(DAMAGES)
    for number in range(count):
        random = np.random.default_rng([seed, number])
        original = originals[number % len(originals)]
        damage = names[(number // len(originals)) % len(names)]
        content, label = original.path.read_bytes(), original.label
        path, beside = folder / f"damaged{number}{original.path.suffix}", None
        if label is not None:  # the two know each other by their names
            path, beside = folder / original.path.name, folder / label.name
        if label is not None and beside is not None and random.random() < 0.2:
            beside.write_bytes(DAMAGES[damage](label.read_bytes(), random))
        else:
            content = DAMAGES[damage](content, random)
            if label is not None and beside is not None:
                beside.write_bytes(label.read_bytes())
        path.write_bytes(content)
        yield Damaged(original, damage, path)
        path.unlink()
        if beside is not None:
            beside.unlink()


def fuzz_readers(
    originals: list[Original], count: int, seed: int, tell: Callable[[int], None] = lambda _: None
) -> Findings:
    """Read `count` damaged files in a bounded process: 60 s and 3 GB of address space each. Originals that are no
    images themselves (tables) are left out."""
    findings = Findings()
    with tempfile.TemporaryDirectory() as folder, ReaderProcess(TIMEOUT_S, MEMORY_BYTES) as reader:
        sound = {original.path: reader.ask(original.path) for original in originals}
        readable = [original for original in originals if sound[original.path]["outcome"] == "read"]
        for number, damaged in enumerate(damaged_files(readable, count, seed, Path(folder)), 1):
            answer = reader.ask(damaged.path)
            note(findings, damaged, answer, sound[damaged.original.path])
            tell(number)
    return findings


def note(findings: Findings, damaged: Damaged, answer: dict[str, Any], sound: dict[str, Any]) -> None:
    """Count one answer."""
    outcome = answer["outcome"]
    findings.by_damage[damaged.damage][outcome] += 1
    findings.by_image[damaged.original.path.name][outcome] += 1
    findings.slowest_s = max(findings.slowest_s, answer["seconds"])
    findings.peak_mb = max(findings.peak_mb, answer.get("peak_mb", 0))
    if outcome == "read":
        differs = [what for what in ("pixels", "metadata") if answer[what] != sound.get(what)]
        findings.changed[" and ".join(differs) + " changed" if differs else "nothing changed"] += 1
    elif outcome != "refused":
        what = {"image": damaged.original.path.name, "damage": damaged.damage, "file": damaged.path.name}
        findings.bad.append({**what, **answer})


def table(findings: Findings) -> str:
    """The findings as lines for a person."""
    columns = [*OUTCOMES, *sorted(set(findings.total) - set(OUTCOMES))]
    lines = [f"{'':28s}" + "".join(f"{name:>9s}" for name in columns)]
    for rows in (findings.by_damage, findings.by_image, {"all": findings.total}):
        lines += [f"{name[:27]:28s}" + "".join(f"{counts[c]:9d}" for c in columns) for name, counts in rows.items()]
        lines.append("")
    read = ", ".join(f"{what} {count}" for what, count in findings.changed.most_common())
    lines.append(f"of those read: {read}")
    lines.append(f"slowest {findings.slowest_s:.2f} s, memory at most {findings.peak_mb} MB")
    lines += [f"BAD {bad['image']}, {bad['damage']}: {bad['outcome']}: {bad['reason'][-600:]}" for bad in findings.bad]
    return "\n".join(lines)
