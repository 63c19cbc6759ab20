"""planetpose photometry STORE --law NAME --out FOLDER"""

from pathlib import Path
from typing import Annotated

import typer

Limits = tuple[float, float]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(photometry)


def photometry(
    store: Annotated[Path, typer.Argument(help="A store, or one product's folder.", exists=True, file_okay=False)],
    law: Annotated[str, typer.Option(help="lunar-lambert or hapke.")] = "lunar-lambert",
    latitude: Annotated[Limits, typer.Option(help="South and north limit.")] = (-90.0, 90.0),
    longitude: Annotated[Limits, typer.Option(help="West and east limit, east positive; may run through 0.")] = (
        0.0,
        360.0,
    ),
    regions: Annotated[
        Path | None, typer.Option(help="CSV file of regions instead: region, south, north, west, east.")
    ] = None,
    max_incidence_deg: Annotated[float, typer.Option(min=0, max=90)] = 75.0,
    max_emission_deg: Annotated[float, typer.Option(min=0, max=90)] = 75.0,
    hold: Annotated[
        list[str] | None, typer.Option(metavar="NAME=VALUE", help="A parameter that is not solved; repeat for more.")
    ] = None,
    calibration_percent: Annotated[
        float, typer.Option(min=0, help="1-sigma of the images' calibration against each other; 0: it is exact.")
    ] = 5.0,
    units_per_if: Annotated[
        float | None,
        typer.Option(
            min=1e-12, help="Hapke: image units per I/F; without it w comes from the brightness' shape alone."
        ),
    ] = None,
    albedo_map: Annotated[
        bool, typer.Option("--albedo-map", help="Divide out the base map that the products were made with.")
    ] = False,
    doubtful: Annotated[bool, typer.Option("--doubtful", help="Doubtful images too.")] = False,
    bootstrap: Annotated[
        int, typer.Option(min=0, help="Uncertainties from that many fits to ground drawn anew; 0: from the covariance.")
    ] = 0,
    max_pixels: Annotated[int, typer.Option(min=100, help="Pixels per image; of more every k-th is used.")] = 5_000,
    out: Annotated[Path, typer.Option(help="Folder for tables and figures.")] = Path("photometry"),
    json: Annotated[bool, typer.Option("--json", help="One JSON object per region on stdout.")] = False,
) -> None:
    """Fit a phase function to a region's pixels in all images of a store."""
    import sys

    from flows.cli.output import clean_stdout, log_to_stderr, write_json
    from flows.photometry import fit_store
    from tasks.export.pixels import Selection
    from tasks.photometry.files import in_json, write_photometry
    from tasks.photometry.fit import FitSettings
    from tasks.photometry.laws import LAWS
    from tasks.photometry.regions import PhotometrySettings, read_regions

    if law not in LAWS:
        raise typer.BadParameter(f"known are {', '.join(LAWS)}", param_hint="--law")
    log_to_stderr()
    selection = Selection(latitude, longitude, max_incidence_deg, max_emission_deg)
    fit = FitSettings(calibration_percent / 100, units_per_if, held_values(hold or []), bootstrap)
    settings = PhotometrySettings(law, selection, doubtful, albedo_map, max_pixels, fit)
    with clean_stdout() as answer:
        results = fit_store(store, settings, read_regions(regions, selection) if regions else ())
        paths = write_photometry(results, law, out)
        for result in results:
            content = in_json(result, law)
            if json:
                write_json(answer, content)
                continue
            print(f"{result.name}: {content['reason'] or content['uncertainty_from']}", file=answer)
            for each in content["parameters"]:
                sigma = each["how"] if each["sigma"] is None else f"+- {each['sigma']:.3g}"
                print(f"  {each['name']:20} {each['value']:.5g} {sigma} {each['unit']}".rstrip(), file=answer)
        if not json:
            print("\n".join(str(path) for path in paths), file=answer)
        for product, reason in dict(pair for result in results for pair in result.left_out).items():
            print(f"{product}: left out: {reason}", file=sys.stderr)
    sys.exit(1 if any(result.fit is None or result.left_out for result in results) else 0)


def held_values(given: list[str]) -> dict[str, float]:
    """NAME=VALUE pairs; anything else is wrong usage."""
    held = {}
    for text in given:
        name, _, value = text.partition("=")
        try:
            held[name.strip()] = float(value)
        except ValueError as error:
            raise typer.BadParameter(f"{text} is not NAME=VALUE", param_hint="--hold") from error
    return held
