"""The adjustment as a table for people."""

from typing import Any

SHARED = {
    "range": ("range factor, in a sequence", ""),
    "roll": ("roll of the camera", " deg"),
    "attitude": ("attitude, in a sequence", " deg"),
    "psf": ("blur of the camera", ""),
}


def tie_line(row: dict[str, Any]) -> str:
    """Whether images share one kind of unknown."""
    name, unit = SHARED[row["kind"]]
    found = "shared" if row["holds"] else f"not quite shared: images scatter by {row['scatter']:.2g}{unit}"
    return f"{name}: {found} (chi-square {row['chi_square']:.1f} of {row['measurements']} measurements)"


def offset_line(row: dict[str, Any]) -> str:
    """Where a sequence's target is."""
    found = row["target_offset"]
    if found["offset_km"] is None:
        return f"sequence {row['sequence']}: {found['reason']}"
    parts = " ".join(
        f"{v:+.1f}+-" + ("?" if s is None else f"{s:.1f}")
        for v, s in zip(found["offset_km"], found["sigma_km"], strict=True)
    )
    chance = "" if found["probability"] is None else f", probability {found['probability']:.2g}"
    return (
        f"sequence {row['sequence']}: {row['target']} is off its ephemeris and trajectory by ({parts}) km, J2000, by "
        f"{len(found['images_with_stars'])} of {len(row['images'])} images with stars (chi-square "
        f"{found['chi_square']:.1f} of {found['degrees_of_freedom']}{chance})"
    )


def adjustment_table(report: dict[str, Any]) -> str:
    """Text of several lines."""
    lines = ["camera              images  focal scale          roll deg         blur px"]
    lines += [
        f"{row['camera']:<18} {row['images']:>7}  {row['focal_scale']:.5f} +- {row['focal_scale_sigma']:.5f}  "
        f"{row['roll_deg']:+.3f} +- {row['roll_sigma_deg']:.3f}  "
        f"{row['psf_sigma_px']:.3f} +- {row['psf_sigma_px_sigma']:.3f}"
        for row in report["cameras"]
    ]
    lines += ["", "sequence  images  range factor         turn of the target, deg                 chi2 of measurements"]
    for row in report["sequences"]:
        turn = " ".join(
            f"{v:+.3f}+-{s:.3f}" for v, s in zip(row["attitude_deg"], row["attitude_sigma_deg"], strict=True)
        )
        lines.append(
            f"{row['sequence']:>8}  {len(row['images']):>6}  {row['range_factor']:.5f} +- "
            f"{row['range_factor_sigma']:.5f}  {turn}  {row['chi_square']:.1f} of {row['measurements']}  "
            f"{row['images'][0]} ({row['camera']})"
        )
    lines += ["", *(offset_line(row) for row in report["sequences"])]
    lines += ["", "image                sequence  weight  free range factor    adjusted factor      roll deg"]
    lines += [
        f"{row['product']:<20} {row['sequence']:>8}  {row['weight']:>6.2f}  {row['range_factor_free']:.5f} +- "
        f"{row['range_factor_free_sigma']:.5f}  {row['range_factor']:.5f} +- {row['range_factor_sigma']:.5f}  "
        f"{row['roll_deg']:+.3f} +- {row['roll_sigma_deg']:.3f}"
        for row in report["images"]
    ]
    found = report["consistency"]
    chance = "" if found["probability"] is None else f", probability {found['probability']:.2g}"
    lines += [
        "",
        f"Consistency: chi-square {found['chi_square']:.1f}, {found['degrees_of_freedom']} degrees of freedom{chance}.",
        *(f"  {tie_line(row)}" for row in report["ties"]),
        report["overestimated_distance"],
    ]
    lines += [f"{row['product']}: left out: {row['reason']}" for row in report.get("left_out", [])]
    return "\n".join(lines)
