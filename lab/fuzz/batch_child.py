"""The process that runs batches: bounded memory, [number, seed] a line on stdin, one JSON answer a line on stdout."""

import json
import os
import sys
from pathlib import Path

from lab.fuzz.batch import Ground, run_batch


def main(folder: str, memory_bytes: int) -> None:
    """Answer until stdin ends; `folder` is a prepared ground. What libraries print goes to stderr."""
    import resource

    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    resource.setrlimit(resource.RLIMIT_AS, (memory_bytes, memory_bytes))
    ground = Ground(Path(folder))
    print(json.dumps({"ready": True}), file=answers, flush=True)
    for line in sys.stdin:
        number, seed = json.loads(line)
        print(json.dumps({"outcome": "ended", **run_batch(ground, number, seed)}), file=answers, flush=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
