"""Fixtures shared by all tests."""

import gc
import os
from collections import defaultdict
from pathlib import Path, PurePosixPath

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


# Files of tests that take longest, by the seconds that `make test` prints. They begin first: the process that began one
# of them last would be the only one that works at the end.
LONGEST_FIRST: tuple[str, ...] = ()
# A file of tests that takes so many seconds is printed with its time.
LONG_FILE_S = 10.0

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


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Bring the longest files to the front; `--no-loadscope-reorder` has the processes take them in this order."""
    place = {name: number for number, name in enumerate(LONGEST_FIRST)}
    items.sort(key=lambda item: place.get(item.nodeid.partition("::")[0], len(place)))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Print the seconds that each folder of tests took, and each long file."""
    files: dict[str, float] = defaultdict(float)
    for reports in terminalreporter.stats.values():
        for report in reports:
            if isinstance(report, pytest.TestReport):
                files[report.nodeid.partition("::")[0]] += report.duration
    if sum(files.values()) < LONG_FILE_S:
        return
    folders: dict[str, float] = defaultdict(float)
    for name, seconds in files.items():
        folders[str(PurePosixPath(name).parent)] += seconds
    terminalreporter.section("seconds, by folder and long file")
    for chosen in (folders, {name: seconds for name, seconds in files.items() if seconds >= LONG_FILE_S}):
        for name, seconds in sorted(chosen.items(), key=lambda each: -each[1]):
            terminalreporter.write_line(f"{seconds:7.1f}  {name}")
