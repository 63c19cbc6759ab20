"""planetpose benchmark fuzz|batches"""

import sys
from pathlib import Path
from typing import Annotated

import typer


def fuzz(
    count: Annotated[int, typer.Option(min=1, help="Damaged files to read.")] = 2200,
    seed: Annotated[int, typer.Option(min=0, help="Another seed: other damage.")] = 1,
    folder: Annotated[Path | None, typer.Option(help="Undamaged files (default: images/ of PLANETPOSE_DATA).")] = None,
    correct: Annotated[
        int, typer.Option(min=0, help="Number of damaged copies of --correct-file to correct as well.")
    ] = 0,
    correct_file: Annotated[Path | None, typer.Option(help="An image whose label gives its geometry.")] = None,
    json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Damage real files, read each in a bounded process, and count who is refused, read, crashes or hangs."""
    from catalog.settings import data_folder
    from flows.cli.output import clean_stdout, write_json
    from lab.fuzz.bench import Original, fuzz_readers, originals_in, table

    images = folder or (data_folder() or Path()) / "images"
    with clean_stdout() as answer:
        findings, verdicts = fuzz_readers(originals_in(images), count, seed), None
        if not json:
            print(table(findings), file=answer, flush=True)
        if correct:
            from lab.fuzz.corrected import correct_damaged

            image = correct_file or images / "galileo" / "C0552809300R.IMG"
            verdicts = correct_damaged(
                Original(image, None), correct, seed, tell=lambda line: print(line, file=sys.stderr)
            )
        if json:
            write_json(answer, findings.to_dict() | {"corrected": verdicts.to_dict() if verdicts else None})
        elif verdicts:
            print(f"corrected: {dict(verdicts.counts)}; ok ones within {verdicts.furthest_px:.2f} px", file=answer)
    raise typer.Exit(1 if findings.bad or (verdicts and verdicts.wrong) else 0)


def batches(
    count: Annotated[int, typer.Option(min=1, help="Batches, each with two good images and one that spoils it.")] = 300,
    seed: Annotated[int, typer.Option(min=0, help="Another seed: other damage at other moments.")] = 1,
    json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
) -> None:
    """Correct batches with one bad image each (name, rights, pipe, bomb, exchanged while it is read ...), and count
    what is lost, hangs, or ends without a reason that names the file and a remedy."""
    from flows.cli.output import clean_stdout, write_json
    from lab.fuzz.batches import spoil_batches, table

    with clean_stdout() as answer:
        found = spoil_batches(range(count), seed, lambda number: print(f"  {number + 1}/{count}", file=sys.stderr))
        if json:
            write_json(answer, found.to_dict())
        else:
            print(table(found), file=answer)
    raise typer.Exit(1 if found.bad else 0)
