"""Puts the helper modules of these tests on the path."""

import sys
from pathlib import Path

TESTS = Path(__file__).parents[1]
for folder in (TESTS / "viewer", TESTS / "tasks" / "products", TESTS / "flows", TESTS / "flows" / "downstream"):
    sys.path.insert(0, str(folder))
