"""The schema document (`docs/schema.md`), written from the tables that products are checked against:
`python -m tasks.publish.schema > docs/schema.md`."""

from collections.abc import Iterable

from tasks.publish.index_rows import COLUMNS
from tasks.publish.variables import BODY_VARIABLES, FLAGS, REQUIRED_ATTRIBUTES, SENSOR_VARIABLES, VARIABLES, Variable

INTRODUCTION = """# What a store holds

Written by `python -m tasks.publish.schema` from the tables in `tasks/publish/`; a test compares the two.

A store is a folder with one folder per image, the product, and one index. Products appear whole or not at all.

```
STORE/index.parquet            one row per image; a folder of `part-*.parquet` beyond 20 000 images
STORE/PRODUCT/cube.zarr        Zarr v3 group, the geometry cube
STORE/PRODUCT/planes.zarr      further planes of the same pixels, where `planetpose planes` added them
STORE/PRODUCT/overlay.png      image, predicted and corrected limb, grid, terminator
STORE/PRODUCT/result.json      the object that `planetpose correct --json` prints
STORE/PRODUCT/settings.json    every setting, defaults included
STORE/PRODUCT/SHA256SUMS       digests of all these files, for `sha256sum -c` and `planetpose check`
STORE/PRODUCT/record.json      the key under which the product was made (not in products published from Python)
```

```python
xarray.open_zarr("STORE/PRODUCT/cube.zarr")  # lazy; also "https://.../cube.zarr" on any static web server
pandas.read_parquet("STORE/index.parquet")  # the index as it was when the last command that publishes ended
tasks.publish.index.open_index("STORE")  # the same, brought up to date first
tasks.publish.index.open_store("STORE")  # all cubes as one lazy xarray.DataTree
```

## The cube

Dimensions `y` (line, downwards) and `x` (sample, to the right), 0-based, integers at pixel centres; coordinates
`x`, `y`, `latitude`, `longitude`. One chunk per variable, Blosc (zstd 3, byte shuffle), consolidated metadata. NaN:
the pixel's centre does not see the body (variables marked *body*), or nobody knows the value. `crs` is the CF grid
mapping: the IAU_2015 code of the body's sphere as `crs_wkt` and CF attributes, the triaxial radii on which the planes
were projected as `triaxial_radii_km`. Latitude is planetocentric, longitude grows eastward from 0 to 360 degrees; the
night side keeps its geometry and carries a flag.
"""


def schema_markdown() -> str:
    """The document's text."""
    parts = [
        INTRODUCTION,
        _table(("variable", "type", "units", "range", "body", "meaning"), map(_variable_row, VARIABLES)),
        "\nCubes of the detector's own pixels (`pixel_space` is `sensor`) hold also\n",
        _table(("variable", "type", "units", "range", "body", "meaning"), map(_variable_row, SENSOR_VARIABLES)),
        "\nCubes whose frame more than one body or a ring concerns hold also\n",
        _table(("variable", "type", "units", "range", "body", "meaning"), map(_variable_row, BODY_VARIABLES)),
        "\n### Flags of `quality`\n",
        _table(("bit", "flag"), ((str(int(flag)), str(flag.name).lower()) for flag in FLAGS)),
        "\n### Attributes that every cube has\n",
        ", ".join(f"`{name}`" for name in REQUIRED_ATTRIBUTES) + ". Nested values are JSON text.",
        "\n## The index\n",
        _table(("column", "kind", "meaning"), ((f"`{c.name}`", c.kind, c.meaning) for c in COLUMNS)),
    ]
    return "\n".join(parts) + "\n"


def _variable_row(variable: Variable) -> tuple[str, ...]:
    limits = "{:g} to {:g}".format(*variable.valid_range) if variable.valid_range else ""
    meaning = "; ".join(text for text in (variable.long_name, variable.comment) if text)
    if variable.standard_name:
        meaning += f" (CF: {variable.standard_name})"
    on_body = "body" if variable.on_body else ""
    return f"`{variable.name}`", variable.dtype, variable.units, limits, on_body, meaning


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join(f"| {' | '.join(cell.replace('|', '/') for cell in line)} |" for line in lines)


if __name__ == "__main__":
    print(schema_markdown(), end="")
