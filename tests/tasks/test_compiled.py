"""Machine code that several processes share."""

import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from tasks.compiled import compiled

MODULE = """
import sys
from tasks.compiled import compiled

@compiled
def inner(values):
    total = 0.0
    for value in values:
        total += value * value
    return total

@compiled
def outer(values):
    return inner(values) + inner(values[::2].copy())
"""
CHILD = """
import sys
import numpy as np
import shared

print("ready", flush=True)
sys.stdin.readline()
assert shared.outer(np.arange(4.0)) == 18.0
stats = [shared.inner.stats, shared.outer.dispatcher.stats]
print(sum(sum(stat.cache_misses.values()) for stat in stats), sum(sum(stat.cache_hits.values()) for stat in stats))
"""


def test_of_processes_that_start_together_one_compiles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "shared.py").write_text(MODULE, encoding="utf-8")
    root = Path(__file__).resolve().parents[2]
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{root}")
    children = [
        subprocess.Popen([sys.executable, "-c", CHILD], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        for _ in range(3)
    ]
    for child in children:
        assert child.stdout is not None
        assert child.stdout.readline() == "ready\n"
    for child in children:
        assert child.stdin is not None
        child.stdin.write("go\n")
        child.stdin.flush()
    printed = [child.communicate(timeout=300)[0].split() for child in children]
    assert [child.returncode for child in children] == [0, 0, 0]
    # Functions compiled, and found compiled, by each.
    assert sum(int(misses) for misses, _ in printed) == 2
    assert sum(int(hits) for _, hits in printed) >= 2


def test_without_a_folder_for_locks_it_is_compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from tasks import compiled as module

    (tmp_path / "no-folder").write_text("")
    with module._only_process(tmp_path / "no-folder" / "a.lock"):
        pass


def test_threads_compile_functions_that_call_each_other() -> None:
    def square(x: float) -> float:
        return x * x

    first = compiled(square)
    found: list[float] = []

    def run(value: float) -> None:
        found.append(first(value))

    threads = [threading.Thread(target=run, args=(each,)) for each in (2.0, np.float32(3.0), 4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(120)
    assert sorted(found) == [4, 9, 16]
