"""planetpose distortion FILE"""

from pathlib import Path
from typing import Annotated, Any, TextIO

import typer

ORDER = ("rmsd_px", "leave_one_out_px", "leave_one_out_median_px", "condition_number")


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(distortion)


def distortion(
    file: Annotated[Path, typer.Argument(help="Image file.", show_default=False)],
    json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
    camera: Annotated[str | None, typer.Option(help="Camera name, or FILE.toml; overrides the label.")] = None,
    out: Annotated[Path, typer.Option(help="Folder for the figures.")] = Path("out/distortion"),
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Write the figures.")] = True,
) -> None:
    """Measure an image's distortion with every method: marks found, errors, figures."""
    from flows.cli.output import clean_stdout, write_json
    from tasks.distortion.report import distortion_report

    with clean_stdout() as answer:
        report = distortion_report(file, out if figures else None, camera)
        if json:
            write_json(answer, report)
        else:
            print_table(report, answer)


def print_table(report: dict[str, Any], stream: TextIO) -> None:
    """The report as lines for a person."""
    print(f"{report['product']}  {report['camera']}  ({report['format']})", file=stream)
    if report["marks_expected"]:
        states = ", ".join(f"{count} {state}" for state, count in report["marks"].items() if state != "found")
        print(f"marks found {report['marks_found']} of {report['marks_expected']} ({states})", file=stream)
    for name, figures in report["methods"].items():
        mark = "*" if name == report["chosen"] else " "
        columns = {key: figures[key] for key in ORDER if figures[key] is not None} or {
            key: value for key, value in figures.items() if value is not None
        }
        print(f"{mark} {name:14s}" + "  ".join(f"{key} {value:.4g}" for key, value in columns.items()), file=stream)
    for key in ("bending", "archive_table", "residual", "residual_after_correction", "seconds"):
        if report.get(key):
            parts = "  ".join(f"{name} {_short(value)}" for name, value in report[key].items())
            print(f"{key.replace('_', ' ')}: {parts}", file=stream)
    print(f"chosen: {report['chosen']}", file=stream)
    for path in report["figures"]:
        print(path, file=stream)


def _short(value: Any) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(_short(part) for part in value) + "]"
    return f"{value:.3g}" if isinstance(value, float) else str(value)
