"""Mid-exposure of 16 images of 12 missions, by their labels and clock kernels, against the ISDs that ALE made."""

import json
import warnings
from pathlib import Path

import numpy as np
import pvl
import pytest

from catalog.camera import Camera, find_camera, known_cameras
from catalog.observation import Frame, Observation
from catalog.readers.isis import facts_of_cube
from catalog.readers.keywords import facts_of_keywords, plain_values
from catalog.spice import kernel_pool
from tasks.ingest.pose import _time_of_frame

WITH_CLOCK = {"N1702360370_1", "st_2458542208_v", "f004a47", "f704b28"}
# LORRI's label rounds its StartTime to 1 ms, Juno's clock kernel is not used.
WITHIN_S = {"JNCR_2016240_01M06152_V01": 4e-4, "m0126888978f7_2p": 2e-4, "lor_0034974380_0x630_sci_1": 2e-4}
WITHIN_S |= dict.fromkeys(WITH_CLOCK, 1e-6)
NAMES = sorted(
    {"EN1072174528M", "E6I0032", "c1637937", "c1638610", "c2065022", "c2065801", "LUA3107H.161", *WITHIN_S}
    | {"mpf_0295610274_0x539_sci", "CAS-MCO-2016-11-26T22.32.14.582-RED-01000-B1"}
)


def frame_of(label_file: Path) -> Frame:
    """What readers make of a label, without pixels."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pvl's own deprecations
        label = pvl.load(str(label_file))
    if "IsisCube" in label:
        facts = facts_of_cube(label["IsisCube"], (100, 100))
    elif "Instrument" in label:  # a label of which only the groups are kept
        facts = facts_of_cube(label, (100, 100))
    else:
        facts = facts_of_keywords(dict(label)) | {"label": plain_values(dict(label))}
    blank = np.zeros((2, 2), np.float32)
    camera = next(
        (name for name, each in known_cameras().items() if set(each.label_names) & set(facts["instrument_names"])), None
    )
    return Frame(
        product=label_file.stem, path=label_file, sha256="", format="label",
        observation=Observation(blank, blank, blank.astype(np.uint16)), camera=camera, et=facts["time"].et,
        exposure_s=facts["exposure_s"], label=facts["label"],
    )  # fmt: skip


def by_clock(frame: Frame, camera: Camera, kernels: list[Path]) -> tuple[float | None, tuple[str, ...]]:
    """As the step `pose` takes it, with these kernels loaded."""
    with kernel_pool(kernels) as loaded:
        return _time_of_frame(frame, camera, loaded)


@pytest.mark.parametrize("name", NAMES)
def test_mid_exposure_is_that_of_the_isd(name: str, data_folder: Path) -> None:
    folder = data_folder / "isd" / name
    isd = json.loads(next(each for each in sorted(folder.glob("*isd.json")) if "isis_isd" not in each.name).read_text())
    for label_file in sorted(folder.glob("*.lbl")):
        frame = frame_of(label_file)
        camera = find_camera(str(frame.camera))
        assert (camera.clock is not None) == (name in WITH_CLOCK)
        et, faults = by_clock(frame, camera, [folder / "kernels"])
        assert faults == ()
        assert et is not None
        apart_s = et - isd["center_ephemeris_time"]
        print(f"\n{label_file.name}: {apart_s:+.1e} s, by the label alone {(frame.et or np.nan) - et + apart_s:+.1e} s")
        assert abs(apart_s) < WITHIN_S.get(name, 2e-5)


@pytest.mark.parametrize("name", sorted(WITH_CLOCK))
def test_without_clock_kernels_the_labels_time_stands_and_the_reason_is_said(name: str, data_folder: Path) -> None:
    folder = data_folder / "isd" / name
    frame = frame_of(sorted(folder.glob("*.lbl"))[0])
    camera = find_camera(str(frame.camera))
    assert by_clock(frame, camera, []) == (frame.et, ())
    et, faults = by_clock(frame, camera, [next((folder / "kernels").glob("naif*.tls"))])
    assert et == frame.et
    assert faults[0].startswith("SCLK: the label's clock count")


def test_a_clock_count_of_another_exposure_is_not_taken(data_folder: Path) -> None:
    folder = data_folder / "isd" / "N1702360370_1"
    frame = frame_of(folder / "N1702360370_1_pds3.lbl")
    later = frame.replaced(et=(frame.et or 0.0) + 3600.0)
    et, faults = by_clock(later, find_camera("cassini-nac"), [folder / "kernels"])
    assert et == later.et
    assert "the label says" in faults[0]
