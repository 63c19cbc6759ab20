"""planetpose demo"""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from flows.cli.options import Server

if TYPE_CHECKING:
    from flows.progress import Reporter
    from flows.request import Request

Text = str | None


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(demo)


def demo(
    folder: Annotated[Path, typer.Option(help="Folder for the archive and its products.")] = Path("out/demo"),
    json: Annotated[bool, typer.Option("--json", help="One JSON object per image on stdout.")] = False,
    workers: Annotated[int, typer.Option(min=1, help="Images at a time.")] = 2,
    server: Server = None,
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="No progress on stderr.")] = False,
) -> None:
    """Simulate six images of Europa with planted errors, correct them, and print planted and found errors."""
    import time

    from flows.cli.output import clean_stdout, log_to_stderr, write_json
    from flows.progress import reporter
    from flows.result import exit_status
    from flows.run import run_requests
    from lab.demo.run import run_demo
    from lab.demo.table import demo_table
    from local_server.prefect_settings import server_choice
    from tasks.profile import Profile

    def run(requests: "list[Request]", reported: "Reporter") -> list[dict[str, Any]]:
        return run_requests(requests, server_choice(server), workers, reported, lambda _: None)

    started = time.monotonic()
    log_to_stderr()
    with clean_stdout() as answer, reporter(6, Profile().passes * 3 + 5, quiet) as reported:
        rows = run_demo(folder, run, reported)
        if json:
            for row in rows:
                write_json(answer, row.to_dict())
        else:
            products = folder / "products"
            took = f"{time.monotonic() - started:.0f} s; products in {products}"
            print(f"\n{demo_table(rows)}\n\n{took}\nLook at them: planetpose view {products}", file=answer)
    sys.exit(exit_status([row.result for row in rows]))
