"""An example of a distribution that adds to planetpose."""

from pathlib import Path

TARGETS = Path(__file__).parent / "targets"
