"""planetpose benchmark closeup"""

from pathlib import Path
from typing import Annotated, Any

import typer


def closeup(
    frames: Annotated[int, typer.Option(min=1, help="Frames with a limb nowhere in them.")] = 30,
    wrong: Annotated[int, typer.Option(min=0, help="Wrong maps that each frame is matched to as well.")] = 1,
    first: Annotated[int, typer.Option(min=0, help="Number of the first frame.")] = 0,
    rows: Annotated[Path | None, typer.Option(help="File for a line of JSON per match.")] = None,
    json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Render close-ups with known truth by an independent ray caster and match them to the catalog's maps, and to maps
    and places that are not theirs.

    The surface is another map of the body where the real mission files (PLANETPOSE_DATA) have one, else the catalog's
    map with planted errors. Exit status 1 when a match is `ok` and wrong.
    """
    import sys
    from json import dumps

    from catalog.settings import data_folder
    from flows.cli.output import clean_stdout, write_json
    from lab.closeup.run import run_close_ups, summary
    from lab.closeup.table import markdown, one_line

    found = data_folder()
    maps = found / "maps" if found else None

    def tell(row: dict[str, Any]) -> None:
        print(one_line(row), file=sys.stderr, flush=True)
        if rows:
            with rows.open("a", encoding="utf-8") as file:
                file.write(dumps(row) + "\n")

    with clean_stdout() as answer:
        figures = summary(run_close_ups(range(first, first + frames), wrong, maps, tell))
        if json:
            write_json(answer, figures)
        else:
            print(markdown(figures), file=answer)
    raise typer.Exit(1 if figures["wrong_ok"] or figures["ok_far_off"] else 0)
