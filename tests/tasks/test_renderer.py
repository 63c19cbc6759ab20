"""Mitsuba is loaded once, whoever asks first."""

import subprocess
import sys

FOUR_AT_ONCE = """
from concurrent.futures import ThreadPoolExecutor
from tasks.renderer import mitsuba
with ThreadPoolExecutor(4) as pool:
    loaded = list(pool.map(lambda _: mitsuba(), range(4)))
print(len({id(module) for module in loaded}), loaded[0].variant())
"""


def test_threads_that_ask_at_once_get_the_same_module_ready_to_use() -> None:
    done = subprocess.run([sys.executable, "-c", FOUR_AT_ONCE], capture_output=True, text=True, check=True, timeout=300)
    assert done.stdout.split() == ["1", "scalar_rgb"]
