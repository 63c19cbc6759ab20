"""How fast one frame is undistorted once its model is fitted."""

import time
from typing import Any

import numpy as np

from catalog.observation import Observation, Quality
from catalog.reseau import find_reseau_table
from tasks.undistort.mark_set import marks_of_table
from tasks.undistort.methods import fit_model
from tasks.undistort.resample import resampled


def benchmark_undistortion(table: str = "vg1_na_sn7", repeats: int = 10) -> dict[str, Any]:
    """Best wall-clock seconds to undistort an 800x800 frame to 1000x1000, once the model is fitted, per kernel."""
    marks = marks_of_table(find_reseau_table(table), (800, 800), (1000, 1000))
    rng = np.random.default_rng(0)
    image = rng.uniform(0, 255, (800, 800)).astype(np.float32)
    quality = np.where(rng.random((800, 800)) < 0.01, np.uint16(Quality.RESEAU), np.uint16(0)).astype(np.uint16)
    observation = Observation(image, np.ones_like(image), quality)
    model = fit_model("thin-plate", marks)
    started = time.perf_counter()
    resampled(observation, model)
    figures: dict[str, Any] = {"first_s": round(time.perf_counter() - started, 4)}
    for kernel in ("bilinear", "bicubic", "lanczos"):
        seconds = []
        for _ in range(repeats):
            started = time.perf_counter()
            resampled(observation, model, kernel)
            seconds.append(time.perf_counter() - started)
        figures[f"{kernel}_s"] = round(min(seconds), 4)
    return figures
