"""The page's server with an index of very many rows in place of its store's: `python many_rows.py STORE INDEX`.

A row has numbers drawn at random; `/api/memory` says what the server holds.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

ROWS = 100_000


def write_many_rows(store: Path, index: Path, rows: int = ROWS) -> None:
    """Write an index of `rows` rows, made from the first of the store's, which keeps its name."""
    from tasks.publish.index import open_index
    from tasks.publish.index_rows import COLUMNS

    many = open_index(store).iloc[np.zeros(rows, dtype=int)].reset_index(drop=True)
    random = np.random.default_rng(1)
    many["product"] = [many["product"][0], *(f"C{number:07d}" for number in range(1, rows))]
    many["reason"] = [f"limb-differs: image {number}" if number % 9 == 0 else None for number in range(rows)]
    for column in COLUMNS:
        if column.kind == "number" and column.name != "et":
            many[column.name] = np.abs(random.normal(size=rows))
    many.to_parquet(index)


def serve_with_index(store: Path, index: Path) -> None:
    """Serve the page of a store; its table is the index. Ends with the process."""
    import pandas as pd
    import psutil

    import viewer.serving
    import viewer.table

    def rows_of(_: Path) -> pd.DataFrame:
        return pd.read_parquet(index)

    build = viewer.serving.build_app

    def with_memory(*given: Any) -> Any:
        app = build(*given)
        app.get("/api/memory")(lambda: {"mb": psutil.Process().memory_info().rss / 1e6})
        return app

    for module, name, function in ((viewer.table, "open_index", rows_of), (viewer.serving, "build_app", with_memory)):
        setattr(module, name, function)
    viewer.serving.serve(store, "127.0.0.1", 0, False, None, False)


if __name__ == "__main__":
    serve_with_index(Path(sys.argv[1]), Path(sys.argv[2]))
