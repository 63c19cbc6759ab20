"""The demo's tables: planted, found, residual, and the paper's figures beside them."""

from lab.demo.images import demo
from lab.demo.run import DemoRow

POINTING_HEADER = (
    "Pointing (px)   planted dx, dy      found dx, dy       left dx, dy      paper left   paper's offsets\n"
    "                                                                                     mean (largest)"
)
SHAPE_HEADER = (
    "Range, attitude        range factor                attitude (deg)      surface (px)      limb\n"
    "and the whole     planted    found     left        planted    left     before    left    rms px"
)
CAPTION = """\
Planted: true minus predicted. Found: corrected minus predicted. Left: corrected minus true. Surface: RMS distance
between where a pose puts visible points of the surface and where they are. The images have their camera's noise, PSF
and distortion, but the photometric law, base map and distortion model that the correction uses too: this measures
the method, not the models. Paper (Belgacem et al. 2020): table 1 for what its registration left, table 2 for offsets
of real images; it found range factors of 0.985 to 1.001 and turned Europa by 0 to 1.7 deg; it gives no residual of
either."""


def demo_table(rows: list[DemoRow]) -> str:
    """Plain text, two tables with a line per image; the reason where there is no corrected pose."""
    pointing = [POINTING_HEADER, *map(_pointing, rows)]
    shape = [SHAPE_HEADER, *map(_shape, rows)]
    return "\n".join([*pointing, "", *shape, "", CAPTION])


def _pointing(row: DemoRow) -> str:
    entry, result = row.simulated.entry, row.result
    if row.after is None:
        return _without_pose(row)
    mean_px, largest_px = entry.paper_offset_px
    found, left = _pair(result["offset_px"]), _pair(row.after.centre_px, 3)
    return (
        f"{entry.product:13s} {_pair(entry.offset_px)}  {found}  {left}     {demo().paper_residual_px:5.1f}"
        f"       {mean_px:6.1f} ({largest_px:.1f})"
    )


def _shape(row: DemoRow) -> str:
    entry, result = row.simulated.entry, row.result
    if row.after is None:
        return _without_pose(row)
    before_px, after_px = row.before.surface_px, row.after.surface_px
    turned = sum(angle**2 for angle in entry.attitude_deg) ** 0.5
    limb = "none" if result["limb_rms_px"] is None else f"{result['limb_rms_px']:.2f}"
    return (
        f"{entry.product:13s}    {entry.range_factor:.5f}   {result['range_factor']:.5f}  {row.after.range:+.5f}"
        f"      {turned:5.2f}     {row.after.attitude_deg:5.3f}    {before_px:6.1f}  {after_px:6.3f}    {limb:>6s}"
    )


def _without_pose(row: DemoRow) -> str:
    return f"{row.simulated.entry.product:13s}  {row.result['status']}: {row.result['reason']}"


def _pair(xy: tuple[float, float], digits: int = 2) -> str:
    return f"{xy[0]:8.{digits}f} {xy[1]:8.{digits}f}"
