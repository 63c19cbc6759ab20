"""PDS4 labels (PDS4 Information Model 1.16): of the FITS file of backplanes, and of maps.

The order of the elements is that of the schema PDS4_PDS_1G00; identifiers are place holders in the form that the
schema wants, which an archive replaces.
"""

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from catalog.target import Target
from catalog.times import utc_from_et
from tasks.atomic import file_put_in_place
from tasks.export.fits import write_backplanes
from tasks.export.source import Source
from tasks.export.stac import target_class

if TYPE_CHECKING:
    from tasks.export.map_image import MapImage

PDS = "http://pds.nasa.gov/pds4/pds/v1"
DISPLAY = "http://pds.nasa.gov/pds4/disp/v1"
SCHEMA_INSTANCE = "http://www.w3.org/2001/XMLSchema-instance"
MODEL_VERSION = "1.16.0.0"
SCHEMAS = {PDS: "https://pds.nasa.gov/pds4/pds/v1/PDS4_PDS_1G00",
           DISPLAY: "https://pds.nasa.gov/pds4/disp/v1/PDS4_DISP_1G00_1500"}  # fmt: skip
# FITS samples (BITPIX) as the schema names them; FITS is big-endian.
DATA_TYPES = {8: "UnsignedByte", 16: "SignedMSB2", 32: "SignedMSB4", 64: "SignedMSB8",
              -32: "IEEE754MSBSingle", -64: "IEEE754MSBDouble"}  # fmt: skip
TARGET_TYPES = {"dwarf_planet": "Dwarf Planet", "comet": "Comet", "asteroid": "Asteroid", "planet": "Planet",
                "satellite": "Satellite"}  # fmt: skip
UNKNOWN = "unknown values are NaN"  # no special constant: GDAL would take its bits for another number
MOST_CHARACTERS = 150
WHOLE_TURN_GAP_DEG = 10.0  # a map with no wider gap in its longitudes runs all around


def write_pds4(source: Source, path: Path) -> Path:
    """Write the FITS file of backplanes and beside it, at `path`, its PDS4 label; return `path`. Every plane is an
    Array_2D_Image whose local identifier is its name in lower case; line 1 is the top of the picture."""
    data = write_backplanes(source, path.with_suffix(".fits"))
    root, discipline = _product(source, "Image and backplanes")
    area = _child(root, "File_Area_Observational")
    file = _child(area, "File")
    _child(file, "file_name", data.name)
    _child(file, "file_size", str(data.stat().st_size), unit="byte")
    for name, header, info in _hdus(data):
        _display_settings(discipline, name)
        _add_hdu(area, name, header, info)
    _write(root, path)
    return path


def write_pds4_map(source: Source, mapped: "MapImage", path: Path) -> Path:
    """Write a map as an uncompressed GeoTIFF, one band per layer, with, at `path`, its PDS4 label, whose cartography
    (class cart:Cartography) GDAL writes; return `path`."""
    import rasterio

    from tasks.export.geotiff import map_profile

    what = f"Map ({mapped.grid.projection.name}; bands {', '.join(mapped.layers)}; angles in degrees; {UNKNOWN})"
    root, discipline = _product(source, what)
    _display_settings(discipline, "image")
    with TemporaryDirectory(prefix=".pds4", dir=path.parent) as folder, _as_template(root, Path(folder)) as template:
        made = Path(folder) / path.name
        profile = map_profile(mapped) | {"driver": "PDS4", "nodata": None}
        options = {"IMAGE_FORMAT": "GEOTIFF", "TEMPLATE": str(template), "INTERLEAVE": "BSQ"}
        options["BOUNDING_DEGREES"] = ",".join(f"{degrees:.6f}" for degrees in bounding_degrees(mapped))
        with rasterio.open(made, "w", **profile, **options) as file:
            for band, values in enumerate(mapped.layers.values(), start=1):
                file.write(values.astype(np.float32, copy=False), band)
        for each in (made.with_suffix(".tif"), made):
            with file_put_in_place(path.with_name(each.name)) as temporary:
                each.replace(temporary)
    return path


def bounding_degrees(mapped: "MapImage") -> tuple[float, float, float, float]:
    """West, south, east and north limit of what a map shows, degrees; a west limit beyond an east one, where 0 E lies
    between, becomes negative."""
    shown = np.isfinite(mapped.layers["emission"])
    latitude, longitude = mapped.grid.projection.latitude_longitude(*np.meshgrid(mapped.grid.x_m(), mapped.grid.y_m()))
    south, north = float(latitude[shown].min()), float(latitude[shown].max())
    ordered = np.unique(longitude[shown])
    gaps = np.diff(ordered, append=ordered[0] + 360.0)
    widest = int(np.argmax(gaps))
    if gaps[widest] < WHOLE_TURN_GAP_DEG:
        return 0.0, south, 360.0, north
    west, east = float(ordered[(widest + 1) % len(ordered)]), float(ordered[widest])
    return (west - 360.0 if west > east else west), south, east, north


def _product(source: Source, what: str) -> tuple[Element, Element]:
    """The label's root without its files, and its Discipline_Area."""
    root = Element(f"{{{PDS}}}Product_Observational")
    places = " ".join(f"{space} {schema}.xsd" for space, schema in SCHEMAS.items())
    root.set(f"{{{SCHEMA_INSTANCE}}}schemaLocation", places)
    identification = _child(root, "Identification_Area")
    _child(identification, "logical_identifier", f"urn:nasa:pds:planetpose:exported:{_word(file_stem(source.product))}")
    _child(identification, "version_id", "1.0")
    _child(identification, "title", f"{what}: {source.target.name} by {source.camera.name}, {source.product}")
    _child(identification, "information_model_version", MODEL_VERSION)
    _child(identification, "product_class", "Product_Observational")
    area = _child(root, "Observation_Area")
    comment = "Geometry corrected by comparison with a simulation; latitudes planetocentric, longitudes east positive."
    _child(area, "comment", comment)
    _add_times(_child(area, "Time_Coordinates"), source)
    summary = _child(area, "Primary_Result_Summary")
    _child(summary, "purpose", "Science")
    _child(summary, "processing_level", "Derived")
    _add_context(area, source)
    return root, _child(area, "Discipline_Area")


def _add_times(area: Element, source: Source) -> None:
    """Begin and end of the exposure; where its length is unknown, its middle for both."""
    image = json.loads(source.attributes.get("provenance", "{}")).get("image") or {}
    half_s = float(image.get("exposure_s") or 0.0) / 2
    for name, et in (("start_date_time", source.pose.et - half_s), ("stop_date_time", source.pose.et + half_s)):
        _child(area, name, utc_from_et(et).removesuffix("Z")[:23] + "Z")


def _add_context(area: Element, source: Source) -> None:
    """Mission, spacecraft, camera and target."""
    mission = source.camera.mission or source.camera.name
    investigation = _child(area, "Investigation_Area")
    _child(investigation, "name", mission)
    _child(investigation, "type", "Mission")
    _add_reference(investigation, f"investigation:mission.{_word(mission)}", "data_to_investigation")
    system = _child(area, "Observing_System")
    host, _, instrument = (source.camera.label_names or (f"{mission}/{source.camera.name}",))[0].partition("/")
    for name, kind in ((host, "Spacecraft"), (instrument, "Instrument")):
        component = _child(system, "Observing_System_Component")
        _child(component, "name", name)
        _child(component, "type", kind)
    target = _child(area, "Target_Identification")
    kind = target_type(source.target)
    _child(target, "name", source.target.name.capitalize())
    _child(target, "type", kind)
    _add_reference(target, f"target:{_word(kind)}.{_word(source.target.name)}", "data_to_target")


def target_type(target: Target) -> str:
    """The body's class in the words of the Information Model."""
    return TARGET_TYPES[target_class(target)]


def _add_reference(parent: Element, context: str, kind: str) -> None:
    reference = _child(parent, "Internal_Reference")
    _child(reference, "lid_reference", f"urn:nasa:pds:context:{context}")
    _child(reference, "reference_type", kind)


def _display_settings(discipline: Element, name: str) -> None:
    settings = SubElement(discipline, f"{{{DISPLAY}}}Display_Settings")
    reference = _child(settings, "Local_Internal_Reference")
    _child(reference, "local_identifier_reference", name)
    _child(reference, "local_reference_type", "display_settings_to_array")
    direction = SubElement(settings, f"{{{DISPLAY}}}Display_Direction")
    for tag, text in (
        ("horizontal_display_axis", "Sample"),
        ("horizontal_display_direction", "Left to Right"),
        ("vertical_display_axis", "Line"),
        ("vertical_display_direction", "Top to Bottom"),
    ):
        SubElement(direction, f"{{{DISPLAY}}}{tag}").text = text


def _hdus(data: Path) -> Iterator[tuple[str, Any, dict[str, int]]]:
    """Name, header and place in the file of every image of a FITS file."""
    from astropy.io import fits

    with fits.open(data, do_not_scale_image_data=True) as hdus:
        for hdu in hdus:
            yield (hdu.name.lower() if hdu.ver and hdu.name != "PRIMARY" else "image"), hdu.header, hdu.fileinfo()


def _add_hdu(area: Element, name: str, header: Any, info: dict[str, int]) -> None:
    """A FITS header and the array after it."""
    block = _child(area, "Header")
    _child(block, "local_identifier", f"header_{name}")
    _child(block, "offset", str(info["hdrLoc"]), unit="byte")
    _child(block, "object_length", str(info["datLoc"] - info["hdrLoc"]), unit="byte")
    _child(block, "parsing_standard_id", "FITS 3.0")
    array = _child(area, "Array_2D_Image")
    _child(array, "local_identifier", name)
    _child(array, "offset", str(info["datLoc"]), unit="byte")
    _child(array, "axes", "2")
    _child(array, "axis_index_order", "Last Index Fastest")
    lines = [] if name == "image" else [str(line) for line in header.get("COMMENT", ())]
    _child(array, "description", "; ".join([*lines, *([UNKNOWN] if header["BITPIX"] < 0 else [])]))
    element = _child(array, "Element_Array")
    _child(element, "data_type", DATA_TYPES[header["BITPIX"]])
    if header.get("BUNIT"):
        _child(element, "unit", header["BUNIT"])
    if header.get("BZERO") or header.get("BSCALE"):
        _child(element, "scaling_factor", f"{header.get('BSCALE', 1.0):g}")
        _child(element, "value_offset", f"{header.get('BZERO', 0.0):g}")
    for number, (axis, key) in enumerate((("Line", "NAXIS2"), ("Sample", "NAXIS1")), start=1):
        each = _child(array, "Axis_Array")
        _child(each, "axis_name", axis)
        _child(each, "elements", str(header[key]))
        _child(each, "sequence_number", str(number))


def _child(parent: Element, tag: str, text: str = "", unit: str = "") -> Element:
    """A new element of the common namespace. Its text is bounded printable ASCII."""
    child = SubElement(parent, f"{{{PDS}}}{tag}", {"unit": unit} if unit else {})
    limit = MOST_CHARACTERS if tag in ("title", "name", "file_name") else None
    child.text = "".join(c if c.isascii() and c.isprintable() else "_" for c in text)[:limit] or None
    return child


def file_stem(product: str) -> str:
    """The product's name as far as the schema lets a file have it; where letters are lost, with a digest of the name
    that keeps it apart from others."""
    plain = re.sub(r"[^A-Za-z0-9._-]", "_", product)
    return plain if plain == product else f"{plain}_{sha256(product.encode()).hexdigest()[:8]}"


def _word(text: str) -> str:
    """A part of an identifier."""
    return re.sub(r"[^a-z0-9._-]", "_", text.lower())[:MOST_CHARACTERS]


@contextmanager
def _as_template(root: Element, folder: Path) -> Iterator[Path]:
    """The label as a file that GDAL completes."""
    template = folder / "template.xml"
    _write(root, template)
    yield template


def _write(root: Element, path: Path) -> None:
    ElementTree.register_namespace("", PDS)
    ElementTree.register_namespace("disp", DISPLAY)
    ElementTree.register_namespace("xsi", SCHEMA_INSTANCE)
    ElementTree.indent(root)
    rules = "".join(
        f'<?xml-model href="{schema}.sch" schematypens="http://purl.oclc.org/dsdl/schematron"?>\n'
        for schema in SCHEMAS.values()
    )
    body = ElementTree.tostring(root, encoding="unicode")
    with file_put_in_place(path) as temporary:
        temporary.write_text(f'<?xml version="1.0" encoding="UTF-8"?>\n{rules}{body}\n', encoding="utf-8")
