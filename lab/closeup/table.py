"""The benchmark's figures as text."""

from typing import Any

Row = dict[str, Any]


def one_line(row: Row) -> str:
    """A match as soon as it is done."""
    where = f"{row['seed']} {row['kind']}: {row['camera']}, {row['target']}, {row['span_radii']:.2f} radii"
    if "error_map_px" not in row:
        return f"{where}: {row['status']} ({row['reason']})"
    return (
        f"{where}: {row['status']}, {row['agreeing']} of {row['tried']} patches, false alarm {row['false_alarm']:.0e}, "
        f"error {row['error_map_px']:.2f} map px"
    )


def markdown(figures: Row) -> str:
    """Tables of all figures."""
    error, sigmas = figures["error_map_px"], figures["error_in_sigmas"]
    lines = [
        "| frames | ok | within 0.5 map px | doubtful | not found | ok and off by 3 sigma |",
        "| --- | --- | --- | --- | --- | --- |",
        f"| {figures['frames']} | {figures['ok']} | {figures['solved']} | {figures['doubtful']} | "
        f"{figures['not_found']} | {len(figures['ok_far_off'])} |",
        "",
    ]
    if error:
        lines += [
            "| error of ok ones | median | 95 % | worst |",
            "| --- | --- | --- | --- |",
            f"| map pixels | {error['median']:.3f} | {error['95%']:.3f} | {error['worst']:.3f} |",
            f"| of the stated | {sigmas['median']:.2f} | {sigmas['95%']:.2f} | {sigmas['worst']:.2f} |",
            "",
        ]
    lines += ["| body | frames | within 0.5 map px |", "| --- | --- | --- |"]
    lines += [f"| {name} | {group['frames']} | {group['solved']} |" for name, group in figures["groups"].items()]
    if figures["wrong_maps"]:
        below = figures["wrong_below"]
        lines += [
            "",
            f"| wrong maps | ok | doubtful | {' | '.join(f'P < {limit}' for limit in below)} |",
            f"| --- | --- | --- | {' | '.join('---' for _ in below)} |",
            f"| {figures['wrong_maps']} | {figures['wrong_ok']} | {figures['wrong_doubtful']} | "
            f"{' | '.join(str(count) for count in below.values())} |",
        ]
    return "\n".join(lines)
