"""planetpose export PATH... --format NAME --out FOLDER"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from flows.export import Exported

Degrees = float | None
LATITUDES, LONGITUDES = (-90.0, 90.0), (0.0, 360.0)


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(export)


def export(
    paths: Annotated[list[Path], typer.Argument(help="Products' folders, or stores.", show_default=False)],
    format: Annotated[
        list[str],
        typer.Option(
            "--format", "-f", help="fits, geotiff, cog, zarr-map, stac, csv, parquet, isd, isis-cube; repeat for more."
        ),
    ],
    out: Annotated[Path, typer.Option(help="Folder that files are written into.")] = Path("export"),
    projection: Annotated[
        str, typer.Option(help="Maps: equirectangular, orthographic or polar-stereographic.")
    ] = "equirectangular",
    resolution_km: Annotated[
        float | None, typer.Option("--resolution-km", "--resolution", help="Maps: km per pixel; default: the image's.")
    ] = None,
    central_longitude_deg: Annotated[
        Degrees, typer.Option(help="Maps: middle of an equirectangular one, lower meridian of a polar one.")
    ] = None,
    kernel: Annotated[str, typer.Option(help="Maps: nearest, bilinear or cubic.")] = "bilinear",
    max_emission_deg: Annotated[
        Degrees, typer.Option(min=0, max=90, help="Maps and tables: no farther to the limb; default 85 and 90.")
    ] = None,
    max_incidence_deg: Annotated[float, typer.Option(min=0, max=180, help="Tables.")] = 90.0,
    latitude: Annotated[tuple[float, float], typer.Option(help="Tables: south and north limit.")] = LATITUDES,
    longitude: Annotated[
        tuple[float, float], typer.Option(help="Tables: west and east limit, east positive; may run through 0.")
    ] = LONGITUDES,
    every_flag: Annotated[bool, typer.Option("--every-flag", help="Tables: flagged pixels on the body too.")] = False,
    json: Annotated[bool, typer.Option("--json", help="One JSON object per product on stdout.")] = False,
) -> None:
    """Export products for other tools: backplanes, maps, catalog items, tables of pixels."""
    import sys

    from catalog.errors import RefusedError
    from flows.cli.output import clean_stdout, write_json
    from flows.export import export_products
    from tasks.export.pixels import Selection
    from tasks.export.settings import ExportSettings
    from tasks.publish.check import products_in

    emission = {} if max_emission_deg is None else {"max_emission_deg": max_emission_deg}
    selection = Selection(latitude, longitude, max_incidence_deg=max_incidence_deg, every_flag=every_flag, **emission)
    formats = tuple(dict.fromkeys(format))
    try:
        settings = ExportSettings(
            formats, projection, resolution_km, central_longitude_deg, kernel, selection=selection, **emission
        )
    except RefusedError as error:
        raise typer.BadParameter(str(error), param_hint=f"--{error.code.removesuffix('-unknown')}") from error
    folders = [folder for path in paths for folder in products_in(path)]
    with clean_stdout() as answer:

        def tell(result: "Exported") -> None:
            if json:
                write_json(answer, result.to_dict())
            else:
                lines = [str(path) for path in result.files.values()]
                lines += [f"{result.product}: {result.reason}"] if result.reason else []
                print("\n".join(lines), file=answer, flush=True)

        results = export_products(folders, settings, out, tell)
    sys.exit(1 if any(result.reason for result in results) else 0)
