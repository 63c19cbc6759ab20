"""Small image files with labels, and the one rule of all readers."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from astropy.io import fits
from numpy.typing import NDArray

from catalog.errors import RefusedError
from catalog.readers import read_frame

VICAR_LABEL = (
    b"LBLSIZE=800             FORMAT='BYTE'  TYPE='IMAGE'  BUFSIZ=20480  DIM=3  EOL=1  RECSIZE=60  ORG='BSQ'  NL=30"
    b"  NS=40  NB=1  N1=40  N2=30  N3=1  N4=0  NBB=20  NLB=1  HOST='VAX-VMS'  INTFMT='LOW'  REALFMT='VAX'"
    b"  MISSION_NAME='X'  EXPOSURE_DURATION=12.5  START_TIME='2005-068T04:09:08.968Z'  STOP_TIME='2005-068T04:09:10Z'"
)


def read_or_refuse(path: Path) -> None:
    """Read a file; what is not refused, naming the file, is finite and has noise."""
    fault = ""
    try:
        frame = read_frame(path)
    except RefusedError as refusal:
        fault = refusal.fault
    if fault:
        assert str(path) in fault
        return
    assert frame.observation.image.size
    assert np.isfinite(frame.observation.image).all()
    assert (frame.observation.noise > 0).all()


def fits_with(path: Path, keywords: Mapping[str, Any]) -> Path:
    """A FITS image of noise with these keywords in its header."""
    image = np.random.default_rng(0).normal(20, 5, (20, 30)).astype(np.float32)
    fits.writeto(path, image, fits.Header(dict(keywords)))
    return path


def voyager_with_label(folder: Path, label: Mapping[str, str], scet: str, exposure_ms: float) -> Path:
    """A Voyager frame with a flight label, and a PDS3 label beside it."""
    flight = (
        f"LAB01='X' LAB02='VGR-1   FDS 35808.00   PICNO 0482J2-001   SCET {scet}         C'"
        f"  LAB03='NA CAMERA  EXP {exposure_ms:08.1f} MSEC  FILT 0(CLEAR)  LO GAIN  SCAN RATE  1:1   C'"
    )
    head = (
        f"LBLSIZE=1600            FORMAT='BYTE'  TYPE='IMAGE'  BUFSIZ=20480  DIM=3  EOL=0  RECSIZE=800  ORG='BSQ'"
        f"  NL=800  NS=800  NB=1  N1=800  N2=800  N3=1  N4=0  NBB=0  NLB=0  HOST='X'  INTFMT='LOW'  REALFMT='RIEEE'"
        f"  {flight}"
    )
    pixels = np.random.default_rng(0).integers(5, 99, (800, 800)).astype("u1")
    path = folder / "C3580800_RAW.IMG"
    path.write_bytes(head.encode().ljust(1600, b"\0") + pixels.tobytes())
    lines = "".join(f"{key} = {value}\r\n" for key, value in label.items())
    path.with_suffix(".LBL").write_text(f"PDS_VERSION_ID = PDS3\r\n{lines}END\r\n")
    return path


def vicar_file(path: Path, pixels: NDArray[Any], keywords: str = "", prefix: int = 0, header_lines: int = 0) -> Path:
    """A VICAR file with line prefixes and binary header lines full of 0xEE."""
    lines, samples = pixels.shape
    record = prefix + samples * pixels.dtype.itemsize
    kind = {"u1": "BYTE", "i2": "HALF", "i4": "FULL", "f4": "REAL"}[pixels.dtype.str[1:]]
    order = "HIGH" if pixels.dtype.str[0] == ">" else "LOW"
    body = (
        f"FORMAT='{kind}'  TYPE='IMAGE'  BUFSIZ=20480  DIM=3  EOL=0  RECSIZE={record}  ORG='BSQ'  NL={lines}"
        f"  NS={samples}  NB=1  N1={samples}  N2={lines}  N3=1  N4=0  NBB={prefix}  NLB={header_lines}"
        f"  HOST='X'  INTFMT='{order}'  REALFMT='RIEEE' {keywords} "
    ).encode()
    label = b"LBLSIZE=%-16d" % 4096 + body
    rows = b"".join(b"\xee" * prefix + row.tobytes() for row in pixels)
    path.write_bytes(label.ljust(4096, b"\0") + b"\xee" * (header_lines * record) + rows)
    return path
