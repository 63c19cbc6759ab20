"""A private PostgreSQL cluster in a folder of its own, for rehearsals; never a system's own one."""

import os
import pwd
import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path
from typing import Any

from local_server.server import free_port

START_TIMEOUT_S = 60.0
DEBIAN_FOLDERS = Path("/usr/lib/postgresql")
UNPRIVILEGED = ("postgres", "nobody")
USER, DATABASE, PASSWORD = "planetpose", "prefect", "rehearsal-only"


class PostgresError(Exception):
    """PostgreSQL is not installed, or does not start."""


def postgres_binaries() -> Path | None:
    """Folder of `initdb` and `postgres`: on the PATH, or where Debian keeps it; None when PostgreSQL is not here."""
    found = shutil.which("postgres")
    folders = [Path(found).resolve().parent] if found else []
    folders += sorted(DEBIAN_FOLDERS.glob("*/bin"), reverse=True)
    return next((folder for folder in folders if (folder / "initdb").is_file()), None)


class PrivatePostgres:
    """A cluster with one database and one user, on 127.0.0.1 and a free port. `start` after `stop` or `kill` finds the
    same data on the same port. PostgreSQL refuses to run as root; then an unprivileged user runs it."""

    def __init__(self, folder: Path) -> None:
        binaries = postgres_binaries()
        if binaries is None:
            raise PostgresError("PostgreSQL is not installed (Debian: apt-get install postgresql).")
        self._binaries = binaries
        self._folder = folder
        self._data = folder / "data"
        self._process: subprocess.Popen[bytes] | None = None
        self._owner = _unprivileged_user() if os.geteuid() == 0 else None
        self.port = free_port()

    @property
    def url(self) -> str:
        """As PREFECT_SERVER_DATABASE_CONNECTION_URL wants it."""
        return f"postgresql+asyncpg://{USER}:{PASSWORD}@127.0.0.1:{self.port}/{DATABASE}"

    def create(self) -> None:
        """Make the cluster. Raises PostgresError with what `initdb` said."""
        self._folder.mkdir(parents=True, exist_ok=True)
        password = self._folder / "password"
        password.write_text(PASSWORD + "\n")
        if self._owner:
            for path in (self._folder, password):
                os.chown(path, self._owner.pw_uid, self._owner.pw_gid)
        self._run("initdb", "-D", self._data, "-U", USER, "-A", "scram-sha-256", f"--pwfile={password}", "-E", "UTF8")

    def start(self) -> None:
        """Start the server and wait until it answers; makes the database when it is not there."""
        options = ("-D", self._data, "-p", self.port, "-k", self._folder, "-h", "127.0.0.1", "-N", 60)
        with (self._folder / "postgres.log").open("ab") as log:
            self._process = subprocess.Popen(
                [str(self._binaries / "postgres"), *map(str, options)], stdout=log, stderr=log, **self._as_owner()
            )
        deadline = time.monotonic() + START_TIMEOUT_S
        while not self._answers():
            if self._process.poll() is not None or time.monotonic() > deadline:
                raise PostgresError(f"PostgreSQL did not start:\n{(self._folder / 'postgres.log').read_text()[-2000:]}")
            time.sleep(0.1)
        exists = self.query(f"SELECT 1 FROM pg_database WHERE datname = '{DATABASE}'", "postgres")
        if not exists:
            self.query(f"CREATE DATABASE {DATABASE}", "postgres")

    def stop(self) -> None:
        """Shut down as an administrator would: sessions are cut off, data are whole."""
        self._end(signal.SIGINT)

    def crash(self) -> None:
        """End at once without a shutdown; the next start recovers from the log."""
        self._end(signal.SIGQUIT)

    def query(self, sql: str, database: str = DATABASE) -> str:
        """What psql prints for `sql`, unaligned and without headers. Raises PostgresError with what it said."""
        return self._run("psql", "-X", "-A", "-t", "-h", "127.0.0.1", "-p", self.port, "-U", USER, "-c", sql, database)

    def _answers(self) -> bool:
        try:
            with socket.create_connection(("127.0.0.1", self.port), timeout=1):
                pass
            self.query("SELECT 1", "postgres")
        except (OSError, PostgresError):
            return False
        return True

    def _end(self, how: signal.Signals) -> None:
        if self._process is not None and self._process.poll() is None:
            self._process.send_signal(how)
            self._process.wait(30)

    def _run(self, program: str, *arguments: object) -> str:
        command = [str(self._binaries / program), *map(str, arguments)]
        environment = {**os.environ, "PGPASSWORD": PASSWORD, "LC_ALL": "C"}
        done = subprocess.run(command, capture_output=True, text=True, env=environment, check=False, **self._as_owner())
        if done.returncode:
            raise PostgresError(f"{program}: {done.stderr.strip()}")
        return done.stdout.strip()

    def _as_owner(self) -> dict[str, Any]:
        if self._owner is None:
            return {"cwd": self._folder}
        return {"cwd": self._folder, "user": self._owner.pw_uid, "group": self._owner.pw_gid, "extra_groups": []}


def _unprivileged_user() -> pwd.struct_passwd:
    for name in UNPRIVILEGED:
        try:
            return pwd.getpwnam(name)
        except KeyError:
            continue
    raise PostgresError(f"PostgreSQL does not run as root, and there is no user {' or '.join(UNPRIVILEGED)}.")
