"""The rows as a page of the documentation."""

from collections.abc import Sequence

from lab.sensitivity.run import Row

# Less than this moves nothing: share of a sigma, and of a stated sigma.
NOTHING = 0.01

HEAD = """# Sensitivity of the joint step to its thresholds

Made by `planetpose sensitivity`: every threshold of the joint step ([settings](/reference/settings.md)), halved and
doubled, one at a time, on {count} scenes of the honesty benchmark ({names}), which an independent ray caster renders.
*moved*: the largest change of centre, limb or orientation of any image, in stated sigmas. *stated*: the largest change
of a stated sigma of these. *RMS*: of the errors of centre and limb of all images, px. *z*: RMS of all errors over
stated sigmas (1 where they are right). *doubts*: doubtful results; *verdicts*: images that are doubtful or failed
where they were not, or the reverse. As the settings are: RMS {rms:.4f} px, z {z:.2f}, {doubts} doubts.

"""
COLUMNS = "| threshold | default | times | moved, sigma | stated | RMS, px | z | doubts | verdicts |\n" + "|---" * 9 + "|\n"


def page(rows: Sequence[Row], names: Sequence[str]) -> str:
    """Markdown: a table of those that decide something on these scenes, by how much, and a list of the rest."""
    plain, *others = rows
    by_name: dict[str, list[Row]] = {}
    for row in others:
        by_name.setdefault(row.name, []).append(row)
    weight = {
        name: max(max(abs(row.moved_sigmas), abs(row.widened), row.verdicts) for row in found) for name, found in by_name.items()
    }
    deciding = [name for name in sorted(weight, key=lambda name: -weight[name]) if weight[name] >= NOTHING]
    idle = sorted(name for name in weight if weight[name] < NOTHING)
    text = HEAD.format(count=len(names), names=", ".join(names), rms=plain.rms_px, z=plain.rms_z, doubts=plain.doubts)
    text += COLUMNS + "".join(line(row) for name in deciding for row in by_name[name])
    if idle:
        listed = ", ".join(f"`{name}`" for name in idle)
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
