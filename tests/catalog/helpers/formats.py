"""Small images as ISIS, PDS3 and PDS4 store them, written from their standards, independently of the readers."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

ISIS_TYPES = {"u1": "UnsignedByte", "i2": "SignedWord", "u2": "UnsignedWord", "i4": "SignedInteger", "f4": "Real",
              "f8": "Double"}  # fmt: skip


def isis_cube(
    bands: NDArray[Any], tile: tuple[int, int] | None, base: float = 0.0, multiplier: float = 1.0, more: str = ""
) -> bytes:
    """An ISIS3 cube of bands (bands, lines, samples). more: groups beside Instrument."""
    count, lines, samples = bands.shape
    start = 4096
    layout = "Format = BandSequential" if tile is None else (
        f"Format = Tile\n    TileSamples = {tile[1]}\n    TileLines = {tile[0]}")  # fmt: skip
    order = "Msb" if bands.dtype.str[0] == ">" else "Lsb"
    label = f"""Object = IsisCube
  Object = Core
    StartByte = {start + 1}
    {layout}
    Group = Dimensions
      Samples = {samples}
      Lines   = {lines}
      Bands   = {count}
    End_Group
    Group = Pixels
      Type       = {ISIS_TYPES[bands.dtype.str[1:]]}
      ByteOrder  = {order}
      Base       = {base}
      Multiplier = {multiplier}
    End_Group
  End_Object
  Group = Instrument
    SpacecraftName   = "Galileo Orbiter"
    InstrumentId     = "UNKNOWN CAMERA"
    TargetName       = EUROPA
    StartTime        = 2000-05-22T23:52:05.277
    ExposureDuration = 6.25 <milliseconds>
  End_Group
  Group = BandBin
    FilterName = {"GREEN" if count == 1 else "(" + ", ".join(f"F{n}" for n in range(count)) + ")"}
  End_Group
{more}
End_Object
Object = Label
  Bytes = {start}
End_Object
End
"""
    return label.encode().ljust(start, b"\0") + b"".join(_tiled(band, tile) for band in bands)


def _tiled(band: NDArray[Any], tile: tuple[int, int] | None) -> bytes:
    if tile is None:
        return band.tobytes()
    high, wide = tile
    parts = []
    for top in range(0, band.shape[0], high):
        for left in range(0, band.shape[1], wide):
            part = np.zeros(tile, band.dtype)
            cut = band[top : top + high, left : left + wide]
            part[: cut.shape[0], : cut.shape[1]] = cut
            parts.append(part.tobytes())
    return b"".join(parts)


def pds3_label(
    bands: NDArray[Any], sample_type: str, file: str | None, prefix: int = 0, suffix: int = 0,
    order: str = "BAND_SEQUENTIAL", names: tuple[str, ...] = (), more: str = "",
) -> tuple[bytes, bytes]:  # fmt: skip
    """Label and pixels; with `file` the label is detached and points at it, else it is to be put in front."""
    count, lines, samples = bands.shape
    item = bands.dtype.itemsize
    if order == "BAND_SEQUENTIAL":
        rows = bands.reshape(-1, samples)
    else:
        axes = (1, 0, 2) if order == "LINE_INTERLEAVED" else (1, 2, 0)
        rows = np.ascontiguousarray(bands.transpose(axes)).reshape(lines, -1)
    record = prefix + rows.shape[1] * item + suffix
    body = b"".join(b"p" * prefix + row.tobytes() + b"s" * suffix for row in rows)
    label_records = 0 if file else -(-2000 // record)
    pointer = f'("{file}", 1)' if file else label_records + 1
    storage = f" BANDS = {count}\r\n BAND_STORAGE_TYPE = {order}\r\n" if count > 1 else ""
    storage += f" BAND_NAME = ({', '.join(names)})\r\n" if names else ""
    text = f"""PDS_VERSION_ID = PDS3
RECORD_TYPE = FIXED_LENGTH
RECORD_BYTES = {record}
FILE_RECORDS = {label_records + len(rows)}
^IMAGE = {pointer}
INSTRUMENT_HOST_NAME = "NO SPACECRAFT"
INSTRUMENT_ID = NONE
TARGET_NAME = EUROPA
START_TIME = 2000-05-22T23:52:05.277Z
OBJECT = IMAGE
 LINES = {lines}
 LINE_SAMPLES = {samples}
 SAMPLE_TYPE = {sample_type}
 SAMPLE_BITS = {item * 8}
 LINE_PREFIX_BYTES = {prefix}
 LINE_SUFFIX_BYTES = {suffix}
{storage} {more}
END_OBJECT = IMAGE
END
"""
    content = text.replace("\r\n", "\n").replace("\n", "\r\n").encode()
    return content if file else content.ljust(label_records * record), body


def pds4_label(cube: NDArray[Any], axes: tuple[str, ...], file: str, offset: int = 0) -> str:
    """The label of an array whose axes have these names, the slowest first."""
    size, order = cube.dtype.itemsize, "MSB" if cube.dtype.str[0] == ">" else "LSB"
    if cube.dtype.kind == "f":
        kind = f"IEEE754{order}{'Single' if size == 4 else 'Double'}"
    else:
        sign = "Signed" if cube.dtype.kind == "i" else "Unsigned"
        kind = f"{sign}Byte" if size == 1 else f"{sign}{order}{size}"
    parts = "".join(
        f"<Axis_Array><axis_name>{axis}</axis_name><elements>{length}</elements>"
        f"<sequence_number>{number}</sequence_number></Axis_Array>"
        for number, (axis, length) in enumerate(zip(axes, cube.shape, strict=True), 1)
    )
    return f"""<?xml version="1.0" encoding="UTF-8"?>
<Product_Observational xmlns="http://pds.nasa.gov/pds4/pds/v1" xmlns:img="http://pds.nasa.gov/pds4/img/v1">
 <Observation_Area>
  <Time_Coordinates><start_date_time>2000-05-22T23:52:05.277Z</start_date_time>
   <stop_date_time>2000-05-22T23:52:05.527Z</stop_date_time></Time_Coordinates>
  <Observing_System>
   <Observing_System_Component><name>No Orbiter</name><type>Spacecraft</type></Observing_System_Component>
   <Observing_System_Component><name>NONE</name><type>Instrument</type></Observing_System_Component>
  </Observing_System>
  <Target_Identification><name>Europa</name><type>Satellite</type></Target_Identification>
  <Discipline_Area><img:exposure_duration unit="ms">250</img:exposure_duration></Discipline_Area>
 </Observation_Area>
 <File_Area_Observational><File><file_name>{file}</file_name></File>
  <Array_{cube.ndim}D_Image><offset unit="byte">{offset}</offset><axes>{cube.ndim}</axes>
   <axis_index_order>Last Index Fastest</axis_index_order>
   <Element_Array><data_type>{kind}</data_type></Element_Array>{parts}</Array_{cube.ndim}D_Image>
 </File_Area_Observational>
</Product_Observational>"""
