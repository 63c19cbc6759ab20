"""Raw Voyager ISS frames: VICAR with the flight label LAB01 .. LAB06 that `catalog.readers.voyager` reads."""

import re
from pathlib import Path

from catalog.times import utc_from_et
from lab.simulate.writers.raw_image import RawImage
from lab.simulate.writers.vicar_file import write_vicar_bytes

SHORT_NAMES = {"voyager1": "VGR-1", "voyager2": "VGR-2", "nac": "NA", "wac": "WA"}


def write_voyager(raw: RawImage, path: Path) -> None:
    """Write a raw frame. Its SCET is the end of the exposure, in whole seconds like the real ones: the pose file knows
    the time better. The label holds no pose."""
    spacecraft, camera = (SHORT_NAMES[part] for part in raw.camera.name.split("-"))
    digits = re.sub(r"\D", "", raw.product).rjust(7, "0")[-7:]
    lines = [
        "                     800     800 800 800 L 1                          SC",
        f"{spacecraft}   FDS {digits[:5]}.{digits[5:]}   PICNO xxxxJ{spacecraft[-1]}-xxx   SCET {_scet(raw)}",
        f"{camera} CAMERA  EXP {1000 * raw.exposure_s:07.1f} MSEC  FILT 0(CLEAR )  LO GAIN  SCAN RATE  1:1",
        "ERT xx.xxx xx:xx:xx   1/ 1 FULL    RES   VIDICON TEMP  -80.00 DEG C",
        f"IN/xxxxxx/xx OUT/xxxxxx/xx     {raw.target.upper()[:8]:8s}    DSS #xx   BIT SNR   xx.xxx",
        "SIMULATED BY PLANETPOSE",
    ]
    labels = {f"LAB{number:02d}": f"{line:71.71s}C" for number, line in enumerate(lines, 1)}
    write_vicar_bytes(path, raw.image, {"TASK": "SIMULATE", "USER": "PLANETPOSE", **labels})


def _scet(raw: RawImage) -> str:
    """YY.DDD HH:MM:SS of the end of the exposure."""
    from astropy.time import Time

    end = Time(utc_from_et(raw.pose.et + raw.exposure_s / 2 + 0.5).removesuffix("Z"), scale="utc")
    year, day, clock = re.fullmatch(r"(\d{4}):(\d{3}):(\d\d:\d\d:\d\d).*", end.yday).groups()  # type: ignore[union-attr]
    return f"{year[2:]}.{day} {clock}"
