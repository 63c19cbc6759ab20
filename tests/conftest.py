"""Fixtures shared by all tests."""

import gc
import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from catalog.settings import data_folder as find_data_folder

# As the command does, before numpy comes: where two processes of tests share two cores, threads of linear algebra wait
# for each other at full speed (frames with reseau marks take three times the processor time).
for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(name, "1")

# A busy machine is no fault of what is tested.
settings.register_profile("busy", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("busy")


# Modules and tests, millions of objects, live as long as the process: the search for garbage leaves them out.
gc.disable()


def pytest_collection_finish() -> None:
    """From here on garbage is searched for, among what comes now."""
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """The folder of real mission files; real-file tests are skipped only where it does not exist."""
    folder = find_data_folder()
    if folder is None:
        pytest.skip("no real mission files: set PLANETPOSE_DATA to the folder that holds images/ and kernels/")
    return folder
