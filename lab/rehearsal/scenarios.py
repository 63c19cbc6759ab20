"""What happens to a deployment: its schedule fires, its database restarts, its server and its worker are lost."""

import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from flows.options import BOOKS
from lab.rehearsal.deployment import ENDED, POOL, Api, products, set_up
from lab.rehearsal.postgres import PrivatePostgres
from lab.rehearsal.processes import Installation, RehearsalError, Session, wait_until
from lab.simulate.small_archive import LIST, PROFILE_FILE, write_small_archive
from tasks.outcomes import all_outcomes

DEPLOYMENT, PART = "nightly", "part"
EVERY_S = 5.0
DATABASE_AWAY_S = 5.0
RUN_TIMEOUT_S = 300.0
ONE_THREAD = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}


@dataclass
class Stage:
    """A running installation: PostgreSQL, server, a worker, deployments, an image list."""

    folder: Path
    images: int
    postgres: PrivatePostgres
    installation: Installation
    api: Api
    sessions: dict[str, Session] = field(default_factory=dict)

    def parameters(self, place: str) -> dict[str, Any]:
        """Of a run that starts from nothing, in places of its own."""
        archive = self.folder / "images"
        return {
            "images": str(archive / LIST),
            "store": str(self.store(place)),
            "cache": str(self.folder / place / "cache"),
            "profile": str(archive / PROFILE_FILE),
            "workers": 1,
            "retry_delay_s": 1,
        }

    def store(self, place: str) -> Path:
        """Store of such a run."""
        return self.folder / place / "store"

    def start_worker(self) -> None:
        """A worker, instead of the one before."""
        self.sessions["worker"] = self.installation.start_worker(POOL)

    def start_server(self) -> None:
        """A server, instead of the one before."""
        self.sessions["server"] = self.installation.start_server()

    def end(self) -> None:
        """End worker and server."""
        for session in reversed(self.sessions.values()):
            session.end()

    def begun(self, place: str) -> str:
        """Id of a run that has just published its first product."""
        run = self.api.start(DEPLOYMENT, self.parameters(place))
        wait_until(f"the first product of {place}", lambda: len(products(self.store(place))) > 0, RUN_TIMEOUT_S)
        if self.api.state_of(run) in ENDED:
            raise RehearsalError(f"the run of {place} was over before anything could happen to it: use more images.")
        return run

    def ended(self, run: str) -> str:
        """State that a run ends in."""
        wait_until("the run's end", lambda: self.api.state_of(run) in ENDED, RUN_TIMEOUT_S)
        return self.api.state_of(run)

    def sound(self, place: str) -> int:
        """Sound products in a store (see `planetpose check`)."""
        from tasks.publish.check import product_faults

        return sum(not product_faults(self.store(place) / name) for name in products(self.store(place)))


@contextmanager
def stage(images: int) -> Iterator[Stage]:
    """Everything up and deployed; all of it ends, and is deleted, with the block."""
    with tempfile.TemporaryDirectory(prefix="planetpose-rehearsal-") as scratch, ExitStack() as ends:
        folder = Path(scratch)
        folder.chmod(0o755)  # PostgreSQL may run as another user
        database = PrivatePostgres(folder / "postgres")
        database.create()
        database.start()
        ends.callback(database.stop)
        kept = {"PLANETPOSE_STATE": str(folder / "state"), "PLANETPOSE_KERNELS": "", **ONE_THREAD}
        installation = Installation(folder, database.url, kept)
        prepared = Stage(folder, images, database, installation, Api(installation))
        ends.callback(prepared.end)
        prepared.start_server()
        write_small_archive(folder / "images", images)
        set_up(installation, folder / "images" / LIST, str(folder / "unused"))
        yield prepared


def schedule_fires(on: Stage) -> dict[str, Any]:
    """A schedule of a few seconds: how long until a run is begun, and until it has ended well."""
    place = "scheduled"
    on.api.schedule(DEPLOYMENT, EVERY_S, on.parameters(place))
    on.start_worker()
    began = wait_until("a scheduled run", lambda: bool(on.api.runs_in("RUNNING", *ENDED)))
    took = wait_until("its end", lambda: bool(on.api.runs_in("COMPLETED", "FAILED", "CRASHED")), RUN_TIMEOUT_S)
    states = [run["state_type"] for run in on.api.runs_in("COMPLETED", "FAILED", "CRASHED")]
    on.api.pause(DEPLOYMENT)
    wait_until("an idle worker", lambda: not on.api.runs_in("RUNNING", "PENDING"), RUN_TIMEOUT_S)
    return _reported(on, place, states[0], began_s=round(began, 1), run_s=round(took, 1))


def database_restarts(on: Stage) -> dict[str, Any]:
    """PostgreSQL is shut down in the middle of a run and comes back."""
    run = on.begun("database")
    on.postgres.stop()
    time.sleep(DATABASE_AWAY_S)
    on.postgres.start()
    return _reported(on, "database", on.ended(run), away_s=DATABASE_AWAY_S)


def server_is_killed(on: Stage) -> dict[str, Any]:
    """The server is killed in the middle of a run and started anew."""
    run = on.begun("server")
    on.sessions["server"].lose()
    time.sleep(DATABASE_AWAY_S)
    on.start_server()
    return _reported(on, "server", on.ended(run), away_s=DATABASE_AWAY_S)


def worker_is_lost(on: Stage) -> dict[str, Any]:
    """The worker and all that it runs are killed in the middle of a run. The server notices (heartbeats), another
    worker comes, and the next run does what is left."""
    run = on.begun("worker")
    on.sessions["worker"].lose()
    before = len(products(on.store("worker")))
    on.start_worker()
    noticed = wait_until("notice of the lost run", lambda: on.api.state_of(run) in ENDED, RUN_TIMEOUT_S)
    first = on.api.state_of(run)
    again = on.ended(on.api.start(DEPLOYMENT, on.parameters("worker")))
    return _reported(on, "worker", again, first_run=first, noticed_s=round(noticed, 1), published_before=before)


def parts_are_shared(on: Stage) -> dict[str, Any]:
    """Two workers take a run each, of one half of the list each, into one store."""
    place, begun = "parts", []
    on.api.let_run(POOL, 2)
    second = on.installation.start_worker(POOL)
    for part in ("1/2", "2/2"):
        begun.append(on.api.start(PART, on.parameters(place) | {"part": part}))
    states = [on.ended(run) for run in begun]
    second.end()
    on.api.let_run(POOL, 1)
    done = [outcome.run for outcome in all_outcomes(on.store(place) / BOOKS)]
    shares = [done.count(run) for run in sorted(set(done))]
    found = _reported(on, place, states[0], second_run=states[1], shares=shares)
    return found | {"good": found["good"] and set(states) == {"COMPLETED"} and len(shares) == 2}


def _reported(on: Stage, place: str, state: str, **figures: Any) -> dict[str, Any]:
    sound = on.sound(place)
    return {
        "state": state,
        "sound": sound,
        "of": on.images,
        "good": state == "COMPLETED" and sound == on.images,
        **figures,
    }


SCENARIOS: dict[str, Callable[[Stage], dict[str, Any]]] = {
    "schedule fires": schedule_fires,
    "database restarts": database_restarts,
    "server is killed": server_is_killed,
    "worker is lost": worker_is_lost,
    "parts are shared": parts_are_shared,
}


def rehearse(images: int, tell: Callable[[str], None]) -> dict[str, dict[str, Any]]:
    """All scenarios, one after the other, on one installation. Raises PostgresError when PostgreSQL is not here,
    RehearsalError when something does not come about in time."""
    started, found = time.monotonic(), {}
    with stage(images) as on:
        tell(f"{time.monotonic() - started:6.1f} s  server on PostgreSQL {on.postgres.query('SHOW server_version')}")
        for name, happen in SCENARIOS.items():
            found[name] = happen(on)
            tell(f"{time.monotonic() - started:6.1f} s  {name}: {found[name]}")
    return found
