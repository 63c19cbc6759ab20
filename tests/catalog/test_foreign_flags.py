"""Quality planes that cannot hold this program's bits are left alone, and that is reported."""

from pathlib import Path

import numpy as np
import pytest
from astropy.io import fits

from catalog.readers import read_frame


@pytest.mark.parametrize("kind", ["f4", "f8"])
def test_flags_that_are_no_whole_numbers_are_reported_and_not_used(kind: str, tmp_path: Path) -> None:
    image = np.random.default_rng(0).normal(100, 5, (64, 64)).astype(np.float32)
    plane = fits.ImageHDU(np.ones((64, 64), kind), fits.Header({"FLAGS": "planetpose"}), name="QUALITY")
    fits.HDUList([fits.PrimaryHDU(image), plane]).writeto(tmp_path / "a.fits")
    frame = read_frame(tmp_path / "a.fits")
    assert not frame.observation.quality.any()
    assert any("QUALITY is not used: its flags are no whole numbers" in reported for reported in frame.warnings)
