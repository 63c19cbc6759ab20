"""How fast the index of a store of many small cubes is, on this machine."""

import json
import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from catalog.camera import Camera
from catalog.observation import Observation
from catalog.pose import Pose
from catalog.target import Target
from tasks.project.uncertainty import PoseUncertainty
from tasks.publish import Publication, publish

EUROPA = Target(name="europa", naif_id=502, radii_km=(1562.6, 1560.3, 1559.5), iau_crs="IAU_2015:50200")
SIZE_PX = 64
IN_ANOTHER_PROCESS = "import sys, pandas; print(len(pandas.read_parquet(sys.argv[1])))"


def benchmark_index(products: int = 1000) -> dict[str, Any]:
    """Figures of a store of `products` small cubes.

    In seconds: build_s, the index made from all cubes; open_s, opened when it is up to date (every product's stamp is
    compared); update_s, opened after one product was published anew; read_s, the Parquet file alone; new_process_s, the
    same by a new Python with its imports. index_bytes: its size.
    """
    from tasks.publish.index import INDEX, open_index, read_index

    with TemporaryDirectory() as folder:
        store = Path(folder)
        first = publish(small_publication(), store)
        open_index(store)  # loads pandas and Arrow
        for i in range(1, products):
            _copy_as(first, f"C{i:05d}", i)
        (store / INDEX).unlink()
        build_s, index = _timed(lambda: open_index(store))
        open_s = min(_timed(lambda: open_index(store))[0] for _ in range(5))
        publish(small_publication(), store)
        update_s, _ = _timed(lambda: open_index(store))
        read_s = min(_timed(lambda: read_index(store))[0] for _ in range(5))
        command = [sys.executable, "-P", "-c", IN_ANOTHER_PROCESS, str(store / INDEX)]
        new_process_s, done = _timed(lambda: subprocess.run(command, capture_output=True, text=True, check=True))
        return {
            "products": len(index),
            "build_s": build_s,
            "open_s": open_s,
            "update_s": update_s,
            "read_s": read_s,
            "new_process_s": new_process_s,
            "rows_in_new_process": int(done.stdout),
            "index_bytes": (store / INDEX).stat().st_size,
        }


def small_publication() -> Publication:
    """A cube of 64x64 pixels with the body in it."""
    camera = Camera(name="benchmark", size_px=(SIZE_PX,) * 2, centre_px=(SIZE_PX / 2,) * 2, focal_length_px=1e4)
    pose = Pose(0.0, np.eye(3), np.array([0, 0, 8e5]), np.array([6e8, 1e8, -4e8]), np.eye(3))
    image = np.ones((SIZE_PX, SIZE_PX), np.float32)
    observation = Observation(image, image, np.zeros(image.shape, np.uint16))
    uncertainty = PoseUncertainty.from_sigmas({"offset_px": [0.1, 0.1]})
    provenance = {"image": {"sha256": "none: a benchmark"}, "kernels": []}
    return Publication("C00000", observation, camera, EUROPA, pose, pose, uncertainty, {"status": "ok"}, {}, provenance)


def _copy_as(product: Path, name: str, number: int) -> None:
    """A product under another name and at another time; quicker than writing it."""
    folder = product.parent / name
    shutil.copytree(product, folder)
    group = folder / "cube.zarr" / "zarr.json"
    content = json.loads(group.read_text())
    pose = json.loads(content["attributes"]["pose_after"])
    pose["et"] += 10.0 * number
    content["attributes"] |= {"product": name, "et": pose["et"], "pose_after": json.dumps(pose)}
    group.write_text(json.dumps(content))


def _timed(work: Callable[[], Any]) -> tuple[float, Any]:
    started = time.perf_counter()
    result = work()
    return time.perf_counter() - started, result
