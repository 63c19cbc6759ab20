"""Writers of raw image files as the missions made them, so that simulated images are read like real ones."""

from lab.simulate.writers.raw_image import RawImage
from lab.simulate.writers.write import raw_suffix, write_raw_image

__all__ = ["RawImage", "raw_suffix", "write_raw_image"]
