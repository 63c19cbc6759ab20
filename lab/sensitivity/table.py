"""The rows as a page of the documentation."""

from collections.abc import Sequence

from lab.sensitivity.run import Row

# Less than this moves nothing: share of a sigma, and of a stated sigma.
NOTHING = 0.01

HEAD = """# Sensitivity of the joint step to its thresholds

Made by `planetpose sensitivity`: every threshold of the joint step ([settings](/reference/settings.md)), halved and
doubled, one at a time, on scenes of the honesty benchmark, which an independent ray caster renders.
*moved*: the largest change of centre, limb or orientation of any image, in stated sigmas. *stated*: the largest change
of a stated sigma of these. *RMS*: of the errors of centre and limb of all images, px. *z*: RMS of all errors over
stated sigmas (1 where they are right). *doubts*: doubtful results. *verdicts*: images that are doubtful or failed where
they were not, or the reverse.
"""
PART = """
## {title}

{count} scenes ({names}). As the settings are: RMS {rms:.4f} px, z {z:.2f}, {doubts} doubts.

"""
COLUMNS = (
    "| threshold | default | times | moved, sigma | stated | RMS, px | z | doubts | verdicts |\n" + "|---" * 9 + "|\n"
)


def page(parts: Sequence[tuple[str, Sequence[Row], Sequence[str]]]) -> str:
    """Markdown, of each part (title, rows, names of the scenes) a table of the thresholds that decide something on its
    scenes, by how much, and a list of the rest."""
    return HEAD + "".join(part_of(*part) for part in parts)


def idle(rows: Sequence[Row]) -> list[str]:
    """Names of the thresholds that decide nothing, of rows whose first is of the settings as they are."""
    weight = weights(rows)
    return sorted(name for name in weight if weight[name] < NOTHING)


def weights(rows: Sequence[Row]) -> dict[str, float]:
    """By threshold, the largest of all its changes."""
    found: dict[str, float] = {}
    for row in rows[1:]:
        found[row.name] = max(found.get(row.name, 0.0), row.weight)
    return found


def part_of(title: str, rows: Sequence[Row], names: Sequence[str]) -> str:
    """One part of the page."""
    plain, *others = rows
    weight, none = weights(rows), idle(rows)
    deciding = sorted(set(weight) - set(none), key=lambda name: -weight[name])
    text = PART.format(
        title=title, count=len(names), names=", ".join(names), rms=plain.rms_px, z=plain.rms_z, doubts=plain.doubts
    )
    text += COLUMNS + "".join(line(row) for name in deciding for row in others if row.name == name)
    if none:
        listed = ", ".join(f"`{name}`" for name in none)
        text += (
            f"\nOn these scenes neither half nor twice of {listed} moves centre, limb or orientation, or changes a "
            f"stated sigma, by {NOTHING:.0%}, or changes a verdict: what they guard against does not occur in them.\n"
        )
    return text


def line(row: Row) -> str:
    """One row of the table."""
    default = ", ".join(f"{each:g}" for each in row.default) if isinstance(row.default, tuple) else f"{row.default:g}"
    failed = f", {row.failed} failed" if row.failed else ""
    return (
        f"| `{row.name}` | {default} | {row.factor:g} | {abs(row.moved_sigmas):.3f} | {row.widened:+.1%} "
        f"| {row.rms_px:.4f} | {row.rms_z:.2f} | {row.doubts}{failed} | {row.verdicts} |\n"
    )
