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


SPHERE = """
import numpy as np
from catalog.errors import FailedError
from tasks.renderer import mitsuba, rendered

def sphere(size):
    film = {"type": "hdrfilm", "width": size, "height": size}
    sensor = {"type": "perspective", "film": film, "sampler": {"type": "independent", "sample_count": 2}}
    integrator = {"type": "aov", "aovs": "p:position"}
    world = {"type": "scene", "integrator": integrator, "sensor": sensor, "ball": {"type": "sphere"}}
    return mitsuba().load_dict(world)
"""

CTRL_C_WHILE_TWO_RENDER = (
    SPHERE
    + """
import os, signal
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait
from threading import Event
stopped = Event()

def render(size, begun):
    scene = sphere(size)
    whole = rendered(scene)
    begun.set()
    while not stopped.is_set():
        try:
            if not np.allclose(rendered(scene), whole, atol=1e-3):  # borders of blocks add up in any order
                return "torn"
        except FailedError as error:
            return error.code
    return "whole"

with ThreadPoolExecutor(2) as pool:
    begun = [Event(), Event()]
    ends = [pool.submit(render, size, event) for size, event in zip((500, 370), begun)]
    for event in begun:
        event.wait()
    try:
        for _ in range(10):
            os.kill(os.getpid(), signal.SIGINT)
            if wait(ends, timeout=2, return_when=FIRST_COMPLETED).done:
                break
    except KeyboardInterrupt:
        print("heard", end=" ")
    stopped.set()
    print(*(end.result() for end in ends))
"""
)

CUT_SHORT = (
    SPHERE
    + """
from threading import Event, Thread
over, scene = Event(), sphere(300)

def cancel():
    while not over.is_set():
        scene.integrator().cancel()

Thread(target=cancel).start()
try:
    while True:
        rendered(scene)
except FailedError as error:
    print(error.code)
finally:
    over.set()
"""
)


def test_ctrl_c_is_heard_while_two_threads_render_and_a_picture_that_it_cut_short_is_not_used() -> None:
    """By the main thread, by a rendering or by both: which is chance, and either ends a batch (`flows.correct`).

    Pressed again where nothing happens, as a user does: Mitsuba forgets a signal that comes just when it begins a
    rendering (it takes SIGINT first, and clears its mark of an interruption after that).
    """
    done = subprocess.run([sys.executable, "-c", CTRL_C_WHILE_TWO_RENDER], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    ends = done.stdout.split()
    assert {"heard", "interrupted"} & set(ends)
    assert set(ends) <= {"heard", "interrupted", "whole"}


def test_a_rendering_that_was_cut_short_is_distinguished_from_a_whole_one() -> None:
    done = subprocess.run([sys.executable, "-c", CUT_SHORT], capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stdout.strip()) == (0, "interrupted"), done.stderr
