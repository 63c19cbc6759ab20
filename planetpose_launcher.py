"""Starts planetpose with its own `catalog`, `tasks`, `flows`, `viewer` and `lab`, whatever else is called so.

Their names are general: a folder on PYTHONPATH, or the working folder, may hold a user's `tasks.py` or `flows.py`. This
module alone has a name that nobody else has. The command `planetpose` imports it, and processes that it starts run it:

    python -P planetpose_launcher.py -m local_server.keeper ARGUMENTS
    python -P planetpose_launcher.py ARGUMENTS OF planetpose

Importing it is enough: from then on our packages come from the folder that this file is in, in processes that
multiprocessing starts as well, for they import the main module first.
"""

import os
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType

# The matrices of all steps are small: threads of BLAS and OpenMP would mostly wait for each other, at full speed (a
# fifth of the processor's time of a Voyager frame). What gains from threads starts its own.
ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
HERE = Path(__file__).resolve().parent
PACKAGES = frozenset({"catalog", "tasks", "local_server", "flows", "viewer", "lab"})
put_aside: dict[str, str] = {}  # name and file of strangers that were imported before


class OwnPackages:
    """Finds our packages beside this file, before anything else is looked at."""

    @staticmethod
    def find_spec(name: str, _: Sequence[str] | None = None, target: ModuleType | None = None) -> ModuleSpec | None:
        """Where a package of ours is; None for everything else."""
        return PathFinder.find_spec(name, [str(HERE)], target) if name in PACKAGES else None


def pin() -> None:
    """From now on the names in PACKAGES are ours; imported strangers of these names are forgotten."""
    if OwnPackages not in sys.meta_path:
        sys.meta_path.insert(0, OwnPackages)
    for name in PACKAGES & sys.modules.keys():
        found = getattr(sys.modules[name], "__file__", None)
        if found is None or Path(found).resolve().parent.parent != HERE:
            put_aside[name] = str(found or "a folder")
            for known in [known for known in sys.modules if known.partition(".")[0] == name]:
                del sys.modules[known]


def hidden() -> dict[str, str]:
    """Name and file of strangers on the path that would be found under our names, were ours not first."""
    found = {name: PathFinder.find_spec(name) for name in sorted(PACKAGES)}
    files = {name: Path(spec.origin) for name, spec in found.items() if spec and spec.origin}
    return {name: str(file) for name, file in files.items() if HERE not in file.resolve().parents}


def main() -> None:
    """The command `planetpose`; with `-m MODULE` first, that module as a program. BLAS and OpenMP get one
    thread in it and in all processes that it starts, unless the environment says otherwise."""
    for name in ONE_THREAD:
        os.environ.setdefault(name, "1")
    if sys.argv[1:2] == ["-m"] and len(sys.argv) > 2:
        import runpy

        del sys.argv[:2]  # the module's name stands for the program's, as for python -m
        runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
        return
    if sys.argv[1:2] == ["correct"]:
        from catalog.unchanged import answered

        if (status := answered()) is not None:
            sys.exit(status)
    from flows.cli import main as command_line

    command_line()


pin()
if __name__ == "__main__":
    main()
