"""planetpose server status|start|stop|serve"""

from typing import Annotated

import typer


def register(app: typer.Typer) -> None:
    """Add the command group."""
    group = typer.Typer(help="The local Prefect server that commands share, or one for workers.", no_args_is_help=True)
    group.command()(status)
    group.command()(start)
    group.command()(stop)
    group.command()(serve)
    app.add_typer(group, name="server")


def status() -> None:
    """Print the server's address, or that no server runs."""
    from local_server.server import idle_minutes, running_server, server_files

    record = running_server()
    if record is None:
        print("no local server runs; the next command that has work starts one")
        return
    print(f"{record.url}  process {record.server_pid}; stops after {idle_minutes():g} minutes without use")
    print(f"log and database in {server_files().folder}")


def start() -> None:
    """Start the server now, so that the next command does not have to start it."""
    from local_server.server import ensure_server

    print(ensure_server())


def stop() -> None:
    """Stop the server."""
    from local_server.server import stop_server

    print("stopped" if stop_server() else "no local server ran")


def serve(
    host: Annotated[
        str, typer.Option(help="Address to listen on; another than this machine's own needs a password.")
    ] = ("127.0.0.1"),
    port: Annotated[int, typer.Option(min=1, max=65535)] = 4200,
) -> None:
    """Run a Prefect server for workers and schedules in the foreground; its database is the environment's
    (PREFECT_SERVER_DATABASE_CONNECTION_URL), else SQLite in PREFECT_HOME."""
    from local_server.serve import serve as become_server

    become_server(host, port)
