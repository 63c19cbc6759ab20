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


CTRL_C_WHILE_TWO_RENDER = """
import os, signal, time
from concurrent.futures import ThreadPoolExecutor
from catalog.errors import FailedError
from tasks.renderer import mitsuba, rendered
stopped = False

def render(size):
    film = {"type": "hdrfilm", "width": size, "height": size}
    sensor = {"type": "perspective", "film": film, "sampler": {"type": "independent", "sample_count": 2}}
    integrator = {"type": "aov", "aovs": "p:position"}
    world = {"type": "scene", "integrator": integrator, "sensor": sensor, "ball": {"type": "sphere"}}
    scene = mitsuba().load_dict(world)
    while not stopped:
        try:
            rendered(scene)
        except FailedError as error:
            return error.code

with ThreadPoolExecutor(2) as pool:
    ends = [pool.submit(render, size) for size in (500, 370)]
    try:
        time.sleep(1)
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(5)
    except KeyboardInterrupt:
        print("heard", end=" ")
    stopped = True
print(*(end.result() for end in ends))
"""


def test_ctrl_c_is_heard_while_two_threads_render_and_a_picture_that_it_cut_short_is_not_used() -> None:
    done = subprocess.run([sys.executable, "-c", CTRL_C_WHILE_TWO_RENDER], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split()[0] == "heard"
    assert "interrupted" in done.stdout
