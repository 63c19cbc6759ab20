"""planetpose benchmark mosaic, control and improve-map"""

from pathlib import Path
from typing import Annotated

import typer

Json = Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")]
Views = Annotated[int, typer.Option(min=2, max=57, help="How many of the paper's 57 views of Europa.")]


def mosaic(
    views: Views = 57,
    resolution: Annotated[str, typer.Option(help="Resolution of the map, as for `planetpose mosaic`.")] = "4ppd",
    json: Json = False,
) -> None:
    """Mosaics of the paper's views, rendered with a law of another implementation, against the albedo that was planted.

    Albedos: a random one, and another map of Europa than the catalog's where the real mission files (PLANETPOSE_DATA)
    have it. Levels of the images are off by 3 % (1-sigma).
    """
    import tempfile
    import time

    import xarray as xr

    from catalog.basemap import BaseMap
    from catalog.settings import data_folder
    from flows.cli.output import clean_stdout, write_json
    from lab.maps.albedo import blotches, mosaic_figures, other_europa, table
    from lab.simulate.albedo_store import paper_views, write_albedo_store
    from tasks.mosaic.build import build_mosaic
    from tasks.mosaic.settings import MosaicSettings

    data = data_folder()
    europa = other_europa(data / "maps" if data else None)
    maps: dict[str, BaseMap] = {"random": blotches()} | ({"Europa, another map": europa} if europa else {})
    settings = MosaicSettings(
        resolution=resolution,
        calibration_sigma=0.05,
        units_per_if=3000.0,
        max_incidence_deg=70.0,
        max_emission_deg=70.0,
    )
    rows = {}
    with clean_stdout() as answer, tempfile.TemporaryDirectory() as folder:
        for name, albedo in maps.items():
            place = Path(folder) / name.partition(",")[0]
            planted = write_albedo_store(place, paper_views()[:: max(57 // views, 1)][:views], albedo)
            before = time.process_time()
            build_mosaic(place, place.with_suffix(".zarr"), settings)
            seconds = time.process_time() - before
            with xr.open_zarr(place.with_suffix(".zarr")) as dataset:
                rows[name] = {**mosaic_figures(dataset.load(), albedo, planted), "cpu_s": seconds}
        if json:
            write_json(answer, rows)
        else:
            print(table(rows), file=answer)


def control(
    views: Views = 57,
    images: Annotated[int, typer.Option(min=2, help="Of the made network.")] = 500,
    per_image: Annotated[int, typer.Option(min=10, help="Ties of an image of the made network.")] = 50,
    json: Json = False,
) -> None:
    """Bundle adjustments against planted errors: of the paper's views, tied by `planetpose control` in rendered images,
    and of a large made network with 3 % of false ties. Exit status 1 when false ties stay in."""
    from flows.cli.output import clean_stdout, write_json
    from lab.maps.network import measured_network, measured_views

    with clean_stdout() as answer:
        figures = {"views": measured_views(views), "network": measured_network(images, per_image)}
        if json:
            write_json(answer, figures)
        else:
            for name, row in figures.items():
                print(f"{name}: " + ", ".join(f"{key} {value:.4g}" for key, value in row.items()), file=answer)
    raise typer.Exit(1 if figures["network"]["false_rejected"] < 0.95 else 0)


def improve_map(
    archive: Annotated[Path, typer.Argument(help="Folder that `planetpose simulate` wrote.", show_default=False)],
    store: Annotated[Path, typer.Argument(help="Store of its images, corrected.", show_default=False)],
    resolution: Annotated[str, typer.Option(help="Resolution of the map, as for `planetpose improve-map`.")] = "3ppd",
    rounds: Annotated[int, typer.Option(min=1, help="At most.")] = 5,
    json: Json = False,
) -> None:
    """Errors of orientations before and after `planetpose improve-map`, of a simulated archive whose images show
    another map than the catalog's. The store: `planetpose evaluate ARCHIVE --out REPORT` leaves it in
    REPORT/products/joint."""
    from flows.cli.output import clean_stdout, write_json
    from lab.maps.improved import measured_improvement
    from tasks.improve.settings import ImproveSettings
    from tasks.mosaic.settings import MosaicSettings

    mosaic_settings = MosaicSettings(law="lunar-lambert", resolution=resolution, doubtful=True)
    with clean_stdout() as answer:
        figures = dict(measured_improvement(archive, store, ImproveSettings(mosaic=mosaic_settings, rounds=rounds)))
        if json:
            write_json(answer, figures)
        else:
            print(", ".join(f"{key} {value:.4g}" for key, value in figures.items()), file=answer)
