"""Time `planetpose reprocess` on an archive: cold, unchanged, a late setting changed; and on very many small images."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import tomli_w

from catalog.errors import FailedError
from catalog.reasons import Reason
from lab.benchmark.small import environment, watch_small
from lab.faults.processes import Command
from tasks.profile import find_profile

Figures = dict[str, Any]
Tell = Callable[[str, Figures], None]
COLD_BAR_S, RERUN_BAR_S = 360.0, 15.0


def benchmark_archive(images: Path, profile: str, workers: int, folder: Path, tell: Tell) -> None:
    """Reprocess the list `images`: with nothing cached; once more; with another `accept` setting, which the step
    `publish` alone depends on; with another one of `validate`, on which `publish` depends. A step that failed leaves
    nothing in the cache, and is done in each run where something changed."""
    late = {"accept": {"sure_likeness": 0.79}}
    later = {"validate": changed_validate(profile)}
    runs = {
        "cold": (profile, COLD_BAR_S),
        "unchanged": (profile, RERUN_BAR_S),
        "another accept": (varied(profile, late, folder / "late.toml"), None),
        "another validate": (varied(profile, late | later, folder / "later.toml"), None),
    }
    for name, (chosen, bar_s) in runs.items():
        command = started(images, chosen, workers, folder)
        command.await_end()
        tell(name, figures_of(command) | {"bar_s": bar_s})


def changed_validate(profile: str) -> dict[str, Any]:
    """The step's settings with one number a little different."""
    settings = find_profile(profile).resolved()["validate"]
    name = next(name for name, value in settings.items() if isinstance(value, float))
    return settings | {name: settings[name] * 1.01}


def varied(profile: str, changes: dict[str, dict[str, Any]], path: Path) -> str:
    """A file with the profile's settings, some of them changed, under the same name."""
    resolved = find_profile(profile).resolved()
    for step, settings in changes.items():
        resolved[step] |= settings
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(tomli_w.dumps(without_none(resolved)), encoding="utf-8")
    return str(path)


def without_none(value: Any) -> Any:
    """Plain values without those that are None, for which TOML has no word."""
    return (
        {name: without_none(each) for name, each in value.items() if each is not None}
        if isinstance(value, dict)
        else value
    )


def started(images: Path, profile: str, workers: int, folder: Path) -> Command:
    """The command, with cache, store and server in `folder`."""
    arguments = [str(images), "--store", str(folder / "store"), "--profile", profile, "--workers", str(workers)]
    return Command(arguments, environment(folder))


def figures_of(command: Command) -> Figures:
    """What a run says of itself, and how long the command took. Raises FailedError when it said nothing."""
    summary = command.summary
    if summary is None:
        raise FailedError(Reason.BENCHMARK, "the command gave no summary: " + " ".join(command.noise[-3:])[:500])
    names = ("images", "done", "status", "wall_s", "busy_s", "cpu_s", "peak_mb", "steps_done", "steps_cached", "codes")
    return {"command_s": command.seconds, **{name: summary[name] for name in names}}


def benchmark_small(count: int, workers: int, folder: Path, tell: Tell) -> None:
    """Reprocess `count` small images; memory of every process on the way, cost of the orchestration, the database."""
    tell("small", watch_small(count, workers, folder))
