"""planetpose server status|stop"""

import typer


def register(app: typer.Typer) -> None:
    """Add the command group."""
    group = typer.Typer(help="The local Prefect server that commands share.", no_args_is_help=True)
    group.command()(status)
    group.command()(start)
    group.command()(stop)
    app.add_typer(group, name="server")


def status() -> None:
    """Print the server's address, or that none runs."""
    from flows.server import idle_minutes, running_server, server_files

    record = running_server()
    if record is None:
        print("no local server runs; the next command that has work starts one")
        return
    print(f"{record.url}  process {record.server_pid}; stops after {idle_minutes():g} minutes without use")
    print(f"log and database in {server_files().folder}")


def start() -> None:
    """Start the server now, so that the next command need not."""
    from flows.server import ensure_server

    print(ensure_server())


def stop() -> None:
    """Stop the server."""
    from flows.server import stop_server

    print("stopped" if stop_server() else "no local server ran")
