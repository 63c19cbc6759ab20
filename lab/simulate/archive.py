"""Simulate an archive of images with planted errors, and the truth beside them."""

import csv
import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from catalog.basemap import BaseMap, map_of_target
from catalog.camera import find_camera
from catalog.errors import RefusedError
from catalog.pose import write_pose_file
from catalog.reasons import Reason
from catalog.target import find_target
from catalog.times import utc_from_et
from lab.simulate.cameras import other_map
from lab.simulate.europa57 import paper_images
from lab.simulate.synthesis import Synthetic, TrueImage, synthesise
from lab.simulate.writers import RawImage, raw_suffix, write_raw_image

EUROPA57 = "europa57"
MANIFEST = "images.csv"
COLUMNS = (
    "product",
    "image",
    "camera",
    "target",
    "utc",
    "exposure_s",
    "pose_file",
    "truth_file",
    "truth.facts",
    "truth.phase_deg",
    "truth.diameter_px",
    "truth.law",
    "truth.psf_factor",
    "truth.offset_x_px",
    "truth.offset_y_px",
    "truth.range_factor",
    "truth.attitude_x_deg",
    "truth.attitude_y_deg",
    "truth.attitude_z_deg",
)


@dataclass(frozen=True)
class Files:
    """Where an image is: raw file, pose file with planted errors, pose file with the truth, all that was planted."""

    image: Path
    predicted: Path
    truth: Path
    facts: Path


def simulate_europa57(
    folder: Path,
    seed: int,
    products: Sequence[str] = (),
    cameras: Sequence[str] = (),
    limit: int | None = None,
    matched: bool = False,
    basemap: BaseMap | None = None,
    tell: Callable[[Synthetic], None] = lambda _: None,
) -> list[Files]:
    """Make the paper's 57 images (all, or some) from its published poses, as files of their cameras' own formats, and
    the list `images.csv` of all of them.

    basemap: true albedo; default: another map than the corrections' where the data folder has one, else the same with
    its planted error. Raises RefusedError when products, cameras and limit leave nothing.
    """
    target = find_target("europa")
    entries = [
        TrueImage(published.image, find_camera(published.camera), target, published.pose, published.exposure_s)
        for published in paper_images().values()
        if (not products or published.image in products) and (not cameras or published.camera in cameras)
    ][:limit]
    if not entries:
        raise RefusedError(
            Reason.NOTHING_TO_SIMULATE,
            f"no image of {EUROPA57} is among {[*products, *cameras]}.",
            f"It has, for example, {', '.join(list(paper_images())[:3])}.",
        )
    truth_map = basemap or other_map(target) or map_of_target(target)
    return write_archive(folder, entries, seed, truth_map, matched, tell)


def write_archive(
    folder: Path,
    entries: Iterable[TrueImage],
    seed: int,
    basemap: BaseMap,
    matched: bool,
    tell: Callable[[Synthetic], None] = lambda _: None,
) -> list[Files]:
    """Make and write images one by one, and the list of them."""
    folder.mkdir(parents=True, exist_ok=True)
    written: list[Files] = []
    rows: list[dict[str, object]] = []
    for entry in entries:
        made = synthesise(entry, seed, basemap, matched)
        files = write_synthetic(folder, made)
        written.append(files)
        rows.append(manifest_row(made, files))
        tell(made)
    write_manifest(folder / MANIFEST, rows)
    return written


def write_synthetic(folder: Path, made: Synthetic) -> Files:
    """Write PRODUCT.IMG or .fit, PRODUCT.predicted.json, PRODUCT.truth.json and PRODUCT.facts.json."""
    entry, sent = made.image, made.recorded
    suffixes = (raw_suffix(entry.camera), ".predicted.json", ".truth.json", ".facts.json")
    files = Files(*(folder / f"{entry.product}{suffix}" for suffix in suffixes))
    pixels = (sent.image, sent.noise, sent.saturated, sent.missing)
    raw = RawImage(entry.product, entry.camera, entry.target.name, made.predicted, entry.exposure_s, *pixels)
    write_raw_image(raw, files.image)
    write_pose_file(made.predicted, files.predicted)
    write_pose_file(entry.pose, files.truth)
    files.facts.write_text(json.dumps(made.facts, indent=1) + "\n")
    return files


def manifest_row(made: Synthetic, files: Files) -> dict[str, object]:
    """One line of `images.csv`; paths are relative to it."""
    entry, errors, facts = made.image, made.errors, made.facts
    attitude = dict(zip("xyz", errors.attitude_deg, strict=True))
    return {
        "product": entry.product,
        "image": files.image.name,
        "camera": entry.camera.name,
        "target": entry.target.name,
        "utc": utc_from_et(entry.pose.et),
        "exposure_s": entry.exposure_s,
        "pose_file": files.predicted.name,
        "truth_file": files.truth.name,
        "truth.facts": files.facts.name,
        "truth.phase_deg": round(facts["geometry"]["phase_deg"], 3),
        "truth.diameter_px": round(facts["geometry"]["diameter_px"], 2),
        "truth.law": facts["surface"]["law"],
        "truth.psf_factor": facts["psf"]["factor"],
        "truth.offset_x_px": errors.offset_px[0],
        "truth.offset_y_px": errors.offset_px[1],
        "truth.range_factor": errors.range_factor,
        **{f"truth.attitude_{axis}_deg": value for axis, value in attitude.items()},
    }


def write_manifest(path: Path, rows: Iterable[dict[str, object]]) -> None:
    """The list of images; rows of earlier runs that are not made again stay."""
    kept: dict[str, dict[str, object]] = {}
    if path.is_file():
        kept = {row["product"]: dict(row) for row in read_manifest(path)}
    kept |= {str(row["product"]): row for row in rows}
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(kept[product] for product in sorted(kept))


def read_manifest(path: Path) -> list[dict[str, str]]:
    """Rows of `images.csv`. Raises RefusedError when it cannot be read or lacks a column."""
    remedy = "Give a folder that `planetpose simulate` wrote."
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise RefusedError(Reason.ARCHIVE_UNREADABLE, f"list {path} cannot be read ({error}).", remedy) from error
    missing = {"product", "image", "camera", "target", "pose_file", "truth_file"} - set(rows[0] if rows else ())
    if missing:
        raise RefusedError(Reason.ARCHIVE_INVALID, f"list {path} lacks {', '.join(sorted(missing))}.", remedy)
    return rows
