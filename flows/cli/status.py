"""planetpose status STORE"""

from typing import Annotated, Any

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(status)


def status(
    store: Annotated[
        str,
        typer.Argument(
            help="Where `planetpose reprocess` publishes: a folder, or s3://bucket/prefix.", show_default=False
        ),
    ],
    json: Annotated[bool, typer.Option("--json", help="One JSON object on stdout.")] = False,
    plan: Annotated[
        bool | None,
        typer.Option("--plan/--no-plan", help="Find images that are out of date; default: for up to 10 000 images."),
    ] = None,
) -> None:
    """Print the verdicts of a store's images, its latest runs, its slowest steps, and which images are out of date."""
    from flows.cli.output import clean_stdout, write_json
    from flows.status import PLANNED_BY_DEFAULT, out_of_date, status_of
    from tasks.objectstore.places import place_of
    from tasks.objectstore.state import STATE, pull_state

    with clean_stdout() as answer:
        place = place_of(store)
        pull_state(place.publish_to, place.store / STATE)
        found = status_of(place.store, plan if json else False)
        if json:
            write_json(answer, found)
            return
        print("\n".join(lines_of(found)), file=answer, flush=True)  # before the plan, which takes longer
        if not found["runs"] or plan is False:
            return
        if plan or found["images"] <= PLANNED_BY_DEFAULT:
            print("\n".join(outdated_lines(out_of_date(found["runs"][0]))), file=answer)
        else:
            print("\nout of date: not looked at in so large a store; --plan does", file=answer)


def lines_of(found: dict[str, Any]) -> list[str]:
    """The status for people."""
    by_hand = len(found["not_remembered"])
    products = f"{by_hand} product{'s' if by_hand > 1 else ''}"
    if by_hand and not found["images"] and not found["runs"]:
        return [
            f"{found['store']}: {products}, published by `planetpose correct`",
            f"  `planetpose index {found['store']}` lists what they show, `planetpose check` whether they are sound.",
            "  Runs are those of `planetpose reprocess`, which has not run here.",
        ]
    lines = [f"{found['store']}: {found['images']} images"]
    for name, count in found["status"].items():
        reasons = ", ".join(f"{code} {times}" for code, times in found["reasons"].get(name, {}).items())
        lines.append(f"  {name:10s} {count:6d}" + (f"  {reasons}" if reasons else ""))
    if by_hand:
        lines.append(f"  and {products} that `planetpose correct` published, outside the runs")
    if found["stale"]:
        lines.append(f"  {len(found['stale'])} products of earlier runs whose image was refused or failed since")
    if found["runs"]:
        lines += ["", "latest runs              images   done  failed %   wall s   busy s  peak MB"]
        lines += [
            f"  {run['run']:22s} {run['images']:6d} {run['done']:6d} {run['failed_percent']:9.1f} {run['wall_s']:8.1f} "
            f"{run['busy_s']:8.1f} {run['peak_mb']:8.0f}"
            for run in found["runs"]
        ]
    if found["steps"]:
        lines += ["", "steps          done  cached  median s    max s    sum s  peak MB  slowest"]
        lines += [
            f"  {row['step']:10s} {row['done']:6d} {row['cached']:7d} {row['median_s']:9.2f} {row['max_s']:8.2f} "
            f"{row['sum_s']:8.1f} {row['peak_mb']:8.0f}  {row['slowest'] or ''}"
            for row in found["steps"]
        ]
    return lines + outdated_lines(found["out_of_date"])


def outdated_lines(found: dict[str, Any] | None) -> list[str]:
    """What a run would do now."""
    if found is None:
        return []
    if found["fault"]:
        return ["", f"out of date: unknown: {found['fault']}"]
    lines = ["", f"out of date: {found['images']} of {found['of']} images of {found['list']}"]
    return lines + [f"  {count:6d}  {why}" for why, count in found["why"].items()]
