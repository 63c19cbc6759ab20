"""planetpose benchmark fuzz"""

from pathlib import Path
from typing import Annotated

import typer


def fuzz(
    count: Annotated[int, typer.Option(min=1, help="Damaged files to read.")] = 2200,
    seed: Annotated[int, typer.Option(min=0, help="Another seed: other damage.")] = 1,
    folder: Annotated[Path | None, typer.Option(help="Undamaged files (default: images/ of PLANETPOSE_DATA).")] = None,
    json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Damage real files, read each in a bounded process, and count who is refused, read, crashes or hangs."""
    from catalog.settings import data_folder
    from flows.cli.output import clean_stdout, write_json
    from flows.fuzz.bench import fuzz_readers, originals_in, table

    images = folder or (data_folder() or Path()) / "images"
    with clean_stdout() as answer:
        findings = fuzz_readers(originals_in(images), count, seed)
        if json:
            write_json(answer, findings.to_dict())
        else:
            print(table(findings), file=answer)
    raise typer.Exit(1 if findings.bad else 0)
