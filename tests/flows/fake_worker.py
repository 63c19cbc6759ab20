"""A worker that does what its job says: end, die, hang, grow, or crash in the middle of a step."""

import json
import os
import sys
import time
from pathlib import Path
from typing import Any

from tasks.atomic import folder_put_in_place


def say(kind: str, **content: Any) -> None:
    print(json.dumps({"kind": kind, **content}), flush=True)


for line in sys.stdin:
    job = json.loads(line)
    say("begin")
    say("step", step="point-1", iteration=0, text="", folder=job.get("folder", ""))
    if job["do"] == "end":
        say("end", pid=os.getpid(), resident_mb=10.0)
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
