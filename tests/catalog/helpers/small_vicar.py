"""A small VICAR label, and the one rule of all readers."""

from pathlib import Path

import numpy as np

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
