"""One thread for one image: a process of a cluster has as many neighbours as its machine has processors."""

import os

VARIABLES = tuple(f"{name}_NUM_THREADS" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA"))


def single_thread_environment() -> dict[str, str]:
    """Environment of a process whose libraries read it when they are imported."""
    return dict.fromkeys(VARIABLES, "1")


def use_one_thread() -> None:
    """Tell the libraries of this process that can be told later: OpenCV and Mitsuba."""
    import cv2
    import drjit

    os.environ.update({name: os.environ.get(name, "1") for name in VARIABLES})
    cv2.setNumThreads(1)
    drjit.set_thread_count(1)
