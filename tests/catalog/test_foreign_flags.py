"""Quality planes that cannot hold this program's bits are left alone, and that is reported."""

from pathlib import Path

import numpy as np
import pytest
from astropy.io import fits

from catalog.errors import RefusedError
from catalog.observation import Quality
from catalog.readers import read_frame


@pytest.mark.parametrize("kind", ["f4", "f8"])
def test_flags_that_are_no_whole_numbers_are_reported_and_not_used(kind: str, tmp_path: Path) -> None:
    image = np.random.default_rng(0).normal(100, 5, (64, 64)).astype(np.float32)
    plane = fits.ImageHDU(np.ones((64, 64), kind), fits.Header({"FLAGS": "planetpose"}), name="QUALITY")
    fits.HDUList([fits.PrimaryHDU(image), plane]).writeto(tmp_path / "a.fits")
    frame = read_frame(tmp_path / "a.fits")
    assert not frame.observation.quality.any()
    assert any("QUALITY is not used: its flags are no whole numbers" in reported for reported in frame.warnings)


@pytest.mark.parametrize("flagged", [False, True])
def test_a_picture_without_usable_pixels_blames_flags_only_where_there_are_some(flagged: bool, tmp_path: Path) -> None:
    image = np.full((64, 64), 5.0 if flagged else np.nan, np.float32)
    image[0, 0] = 7
    parts = [fits.PrimaryHDU(image)]
    if flagged:
        bad = np.full((64, 64), int(Quality.MISSING), np.int16)
        parts.append(fits.ImageHDU(bad, fits.Header({"FLAGS": "planetpose"}), name="QUALITY"))
    fits.HDUList(parts).writeto(tmp_path / "a.fits")
    with pytest.raises(RefusedError, match=r"pixels are usable") as refused:
        read_frame(tmp_path / "a.fits")
    assert ("QUALITY" in refused.value.fault) == flagged
    assert ("--mask" in str(refused.value)) == flagged
