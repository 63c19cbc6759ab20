"""planetpose at PRODUCT X,Y... | --place LAT,LON"""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from tasks.position.position import Position

QUANTITIES = (
    ("incidence", "incidence_deg", ".4f", "deg"),
    ("emission", "emission_deg", ".4f", "deg"),
    ("phase", "phase_deg", ".4f", "deg"),
    ("range", "range_km", ",.3f", "km"),
)


def register(app: typer.Typer) -> None:
    """Add the command."""
    # A position may begin with a minus, as an option does.
    app.command(context_settings={"ignore_unknown_options": True})(at)


def at(
    product: Annotated[
        Path,
        typer.Argument(
            metavar="PRODUCT", help="A product's folder, as written by `planetpose correct`.", show_default=False
        ),
    ],
    pixels: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="X,Y",
            help="One or more pixels X,Y of the image, from 0; integers are pixel centres.",
            show_default=False,
        ),
    ] = None,
    place: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LAT,LON",
            help="A place: 12.5N,271E or -12.5,271 (planetocentric latitude, east longitude); repeat for more.",
        ),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="One JSON object per position on stdout.")] = False,
) -> None:
    """Print what is at a pixel (latitude, longitude, angles, range), or the pixel of a place, with 1-sigma."""
    from catalog.errors import WrongOptionError
    from flows.cli.output import clean_stdout, write_json
    from tasks.position.model import read_position_model
    from tasks.position.position import positions_of_pixels, positions_of_places
    from tasks.position.spelling import read_pixel, read_place

    try:
        xy, places = [read_pixel(text) for text in pixels or ()], [read_place(text) for text in place or ()]
    except WrongOptionError as error:
        hint = "--place" if error.option == "place" else "X,Y"
        raise typer.BadParameter(str(error), param_hint=hint) from error
    if not xy and not places:
        raise typer.BadParameter("give pixels, as 219.3,120.7, or --place LAT,LON", param_hint="X,Y")
    with clean_stdout() as answer:
        model = read_position_model(product)
        found = positions_of_pixels(model, xy) if xy else []
        found += positions_of_places(model, *zip(*places, strict=True)) if places else []
        for position in found:
            if json:
                write_json(answer, position.to_dict())
            else:
                print(in_words(position), file=answer)
        if model.uncertainty is None:
            print("planetpose: the product states no uncertainty of its pose: no sigmas.", file=sys.stderr)


def in_words(position: "Position") -> str:
    """A position for people, in two lines."""
    head = f"pixel {_pair(position, 'x_px', 'y_px', '.3f', 'px')}  " if position.x_px is not None else ""
    if position.latitude_deg is not None and position.longitude_deg is not None:
        north = f"{abs(position.latitude_deg):.4f} {'S' if position.latitude_deg < 0 else 'N'}"
        head += f"latitude {north}{_sigma(position, 'latitude_deg', '.4f')}, "
        head += f"longitude {position.longitude_deg:.4f} E{_sigma(position, 'longitude_deg', '.4f')} deg"
    remark = position.remark or ("visible, in daylight" if position.visible else "")
    lines = [f"{head.rstrip()}: {remark}" if remark else head.rstrip()]
    angles = []
    for name, key, digits, unit in QUANTITIES:
        value = getattr(position, key)
        if value is not None:
            angles.append(f"{name} {value:{digits}}{_sigma(position, key, digits)} {unit}")
    lines += [f"  {', '.join(angles)}"] if angles else []
    if position.flags is not None:
        value = "unknown" if position.value is None else f"{position.value:.6g}"
        lines.append(f"  nearest pixel: value {value}, flags: {', '.join(position.flags) or 'none'}")
    return "\n".join(lines)


def _pair(position: "Position", first: str, second: str, digits: str, unit: str) -> str:
    values = (f"{getattr(position, key):{digits}}{_sigma(position, key, digits)}" for key in (first, second))
    return f"({', '.join(values)}) {unit}"


def _sigma(position: "Position", key: str, digits: str) -> str:
    sigma = position.sigmas.get(key)
    return "" if sigma is None else f" +- {sigma:{digits}}"
