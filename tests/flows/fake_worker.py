"""A worker that does what its job says: end, die, hang, grow, or crash in the middle of a step."""

import os
import time
from multiprocessing.connection import Connection
from pathlib import Path

from tasks.atomic import folder_put_in_place


def work(connection: Connection, _: int) -> None:
    """Jobs, until nobody sends any more."""
    while True:
        job = connection.recv()
        connection.send({"kind": "begin"})
        connection.send(
            {"kind": "step", "step": "point-1", "iteration": 0, "text": "", "folder": job.get("folder", "")}
        )
        if job["do"] == "end":
            connection.send({"kind": "end", "pid": os.getpid(), "resident_mb": 10.0, "is_main": main_was_run()})
        elif job["do"] == "die":
            os._exit(3)
        elif job["do"] == "hang":
            with folder_put_in_place(Path(job["folder"]) / "step") as half:
                (half / "half.txt").write_text("half")
                Path(job["started"]).touch()
                time.sleep(600)
        elif job["do"] == "grow":
            kept = bytearray(300_000_000)
            kept[::4096] = b"x" * len(kept[::4096])
            time.sleep(600)


def main_was_run() -> bool:
    """Whether the parent's main script was run here too."""
    import sys

    return "__mp_main__" in sys.modules
