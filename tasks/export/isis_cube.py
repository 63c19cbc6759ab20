"""Products as ISIS3 cubes: the image and its backplanes as bands, named as ISIS' phocube names them."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tasks.atomic import file_put_in_place
from tasks.export.source import Source

LABEL_BYTES = 65536
NULL = np.frombuffer(np.uint32(0xFF7FFFFB).tobytes(), "<f4")[0]  # ISIS SpecialPixel.h
# Band of phocube, and the plane of the cube that it holds; planes in km become metres.
BANDS = (
    ("Image", "image", 1.0),
    ("Phase Angle", "phase", 1.0),
    ("Emission Angle", "emission", 1.0),
    ("Incidence Angle", "incidence", 1.0),
    ("Latitude", "latitude", 1.0),
    ("Longitude", "longitude", 1.0),
    ("Pixel Resolution", "resolution_km", 1000.0),
)
MOST_CHARACTERS = 60


def write_isis_cube(source: Source, path: Path) -> Path:
    """Write the product as a band-sequential cube of 32-bit reals, NULL where a value is unknown, and return `path`.

    Bands (ISIS' phocube): image, phase, emission, incidence (degrees), planetocentric latitude, east longitude
    (degrees), pixel resolution (metres). Line 1 is the top of the picture. The label has the middle of the exposure
    (ImageMidTime, UTC); ISIS' StartTime is its beginning, which products do not keep.
    """
    bands = [_band(source, plane, factor) for _, plane, factor in BANDS]
    lines, samples = bands[0].shape
    label = _label(source, samples, lines).encode("ascii")
    with file_put_in_place(path) as temporary, temporary.open("wb") as file:
        file.write(label.ljust(LABEL_BYTES, b"\0"))
        for band in bands:
            file.write(band.tobytes())
    return path


def _band(source: Source, plane: str, factor: float) -> NDArray[np.float32]:
    values = source.cube[plane].values.astype(np.float64) * factor
    return np.where(np.isfinite(values), values, NULL).astype("<f4")


def _label(source: Source, samples: int, lines: int) -> str:
    names = ", ".join(f'"{name}"' for name, *_ in BANDS)
    middle = _word(str(source.attributes.get("utc", "")).removesuffix("Z"))
    return f"""Object = IsisCube
  Object = Core
    StartByte = {LABEL_BYTES + 1}
    Format    = BandSequential

    Group = Dimensions
      Samples = {samples}
      Lines   = {lines}
      Bands   = {len(BANDS)}
    End_Group

    Group = Pixels
      Type       = Real
      ByteOrder  = Lsb
      Base       = 0.0
      Multiplier = 1.0
    End_Group
  End_Object

  Group = Instrument
    SpacecraftName = {_quoted(source.camera.mission or source.camera.name)}
    InstrumentId   = {_quoted(source.camera.name)}
    TargetName     = {_quoted(source.target.name)}
    ImageMidTime   = {middle or "NULL"}
  End_Group

  Group = Archive
    ProductId = {_quoted(source.product)}
  End_Group

  Group = BandBin
    Name = ({names})
  End_Group
End_Object

Object = Label
  Bytes = {LABEL_BYTES}
End_Object
End
"""


def _quoted(text: str) -> str:
    plain = "".join(c if c.isascii() and c.isprintable() and c != '"' else "_" for c in text)
    return f'"{plain[:MOST_CHARACTERS]}"'


def _word(text: str) -> str:
    return "".join(c for c in text if c.isascii() and (c.isalnum() or c in "-:."))[:MOST_CHARACTERS]
