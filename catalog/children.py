"""Commands for processes of our own: they import our packages, whatever the working folder or PYTHONPATH hold."""

import sys

from catalog.settings import PROJECT_ROOT

LAUNCHER = PROJECT_ROOT / "planetpose_launcher.py"


def our_module(module: str, *arguments: str) -> list[str]:
    """Command that runs a module as a program; it may be ours or one that ours import."""
    return [sys.executable, "-P", str(LAUNCHER), "-m", module, *arguments]


def our_command(*arguments: str) -> list[str]:
    """Command that does `planetpose ARGUMENTS`."""
    return [sys.executable, "-P", str(LAUNCHER), *arguments]


def their_module(module: str, *arguments: str) -> list[str]:
    """Command that runs a library's module as a program, without the working folder on its path."""
    return [sys.executable, "-P", "-m", module, *arguments]
