"""The table of a store's images, in memory: a browser gets pages of it, sorted and filtered here."""

import math
import threading
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from catalog.errors import WrongOptionError
from flows.options import BOOKS
from tasks.boundary import PUBLISHED
from tasks.diagnose.failed_folder import failed_results
from tasks.guidance.decisions import all_reviews
from tasks.outcomes import all_outcomes
from tasks.publish.index import open_index
from viewer.filters import ALIASES, filtered

if TYPE_CHECKING:
    import pandas as pd

# Texts that few images have to themselves: kept once each.
REPEATED = ("status", "camera", "target", "pose_source", "profile", "pixel_space", "software", "review")
LEFT_OUT = ("stamp", "image_sha256", "cube", "overlay", "et")
SPARKLINES = ("sigma_px", "limb_rms_px")
RANKED, FEWEST_RANKED = ("sigma_px", "limb_rms_px", "offset_px"), 5
BESIDE = 4  # images before and after one
LARGEST_PAGE = 1000
MOST_POINTS = 20_000


@dataclass(frozen=True)
class Page:
    """rows: some of those that fit, in order. fitting: how many fit; images: how many there are. counts: of those that
    fit, by verdict."""

    rows: list[dict[str, Any]]
    fitting: int
    images: int
    counts: dict[str, int]


class Neighbours:
    """Of every image the values of those that the same camera took before and after it, for sparklines."""

    def __init__(self, table: "pd.DataFrame") -> None:
        camera = table["camera"].cat.codes.to_numpy()
        self._order = np.lexsort([table["utc"].to_numpy(dtype="datetime64[us]"), camera])
        self._place = np.empty_like(self._order)
        self._place[self._order] = np.arange(len(self._order))
        self._camera = camera[self._order]
        self._values = {
            name: table[name].to_numpy(dtype=np.float32, na_value=np.nan)[self._order] for name in SPARKLINES
        }

    def of(self, places: Any) -> list[dict[str, list[float | None]]]:
        """Per image (n,) and column its own value in the middle, those before and after it beside; None where there is
        none."""
        if not len(places):
            return []
        around = self._place[places][:, None] + np.arange(-BESIDE, BESIDE + 1)
        inside = (around >= 0) & (around < len(self._order))
        around = np.clip(around, 0, len(self._order) - 1)
        inside &= self._camera[around] == self._camera[around[:, BESIDE]][:, None]
        found = {name: np.where(inside, values[around], np.nan) for name, values in self._values.items()}
        return [
            {name: [float(f"{v:.3g}") if np.isfinite(v) else None for v in rows[i]] for name, rows in found.items()}
            for i in range(len(places))
        ]


class Table:
    """The images of one store; products and those that were refused or failed in runs of `reprocess`."""

    def __init__(self, store: Path) -> None:
        self.store = Path(store)
        self._lock = threading.RLock()
        self._orders: dict[tuple[str, str, bool], Any] = {}
        self.refresh()

    def refresh(self) -> None:
        """Read the store anew. Raises RefusedError when it is gone."""
        import pyarrow as pa

        table = prepared(self.store)
        pa.default_memory_pool().release_unused()  # of a large index some ten MB
        with self._lock:
            self.table = table
            self._orders.clear()
            self._neighbours = Neighbours(table)
            self.places = {name: place for place, name in enumerate(table["product"])}

    def note_review(self, product: str, review: str, note: str) -> None:
        """Show a decision in the table."""
        with self._lock:
            place = self.places.get(product)
            if place is None:
                return
            if review not in self.table["review"].cat.categories:
                self.table["review"] = self.table["review"].cat.add_categories([review])
            self.table.loc[place, "review"] = review
            self.table.loc[place, "note"] = note
            self._orders.clear()

    def page(self, text: str = "", sort: str = "", down: bool = False, first: int = 0, count: int = 100) -> Page:
        """Some of the images that fit the filter, sorted by a column (what is unknown last). Raises WrongOptionError
        for a filter or column that is none."""
        with self._lock:
            order = self._order(text, sort, down)
            chosen = order[max(first, 0) : max(first, 0) + min(max(count, 0), LARGEST_PAGE)]
            counts = self.table["status"].iloc[order].value_counts()
            by_status = {str(name): int(number) for name, number in counts.items() if number}
            return Page(self._rows(chosen), len(order), len(self.table), by_status)

    def place_in(self, product: str, text: str = "", sort: str = "", down: bool = False) -> int | None:
        """Position of a product among those that fit; None where it does not."""
        with self._lock:
            found = np.flatnonzero(self._order(text, sort, down) == self.places.get(product, -1))
            return int(found[0]) if len(found) else None

    def first(self) -> str:
        """Name of the first image; empty where there is none."""
        return next(iter(self.places), "")

    def row(self, product: str) -> dict[str, Any] | None:
        """The row of a product; None for another name."""
        with self._lock:
            place = self.places.get(product)
            return None if place is None else self._rows(np.array([place]))[0]

    def _rows(self, places: Any) -> list[dict[str, Any]]:
        rows = plain_rows(self.table.iloc[places])
        for row, series in zip(rows, self._neighbours.of(places), strict=True):
            row["neighbours"] = series
        return rows

    def ranks(self, product: str) -> dict[str, float]:
        """Of some columns the share of the images of the same camera whose value is smaller than the product's; only
        where five others have one."""
        with self._lock:
            place = self.places.get(product)
            if place is None:
                return {}
            camera = self.table["camera"].cat.codes.to_numpy()
            found = {}
            for name in RANKED:
                values = self.table[name].to_numpy(dtype=np.float64, na_value=np.nan)
                others = values[(camera == camera[place]) & np.isfinite(values)]
                if np.isfinite(values[place]) and len(others) > FEWEST_RANKED:
                    found[name] = float((others < values[place]).sum() / (len(others) - 1))
            return found

    def worst(self, product: str) -> str:
        """Place of a product in the order Worst first, and what puts it there; empty for another name."""
        with self._lock:
            place = self.places.get(product)
            if place is None:
                return ""
            row, worst = self.table.iloc[place], self.table["worst"].to_numpy()
            before = int((worst > worst[place]).sum())
            return f"{before + 1} of {len(worst)}, {why_worst(row['status'], row['sigma_px'], row['limb_rms_px'])}"

    def points(self, x: str, y: str, text: str = "") -> dict[str, Any]:
        """Values of two columns of the images that fit, for a plot; of very many, every n-th. Raises WrongOptionError
        for a column that is none."""
        with self._lock:
            chosen = np.sort(self._order(text, "", False))
            step = max(math.ceil(len(chosen) / MOST_POINTS), 1)
            table = self.table.iloc[chosen[::step]]
            values = {name: numbers(table, known_column(table, name)) for name in (x, y)}
            known = np.isfinite(values[x]) & np.isfinite(values[y])
            texts = {
                name: table[name].astype("str").to_numpy()[known].tolist() for name in ("product", "status", "camera")
            }
            return {"x": values[x][known].tolist(), "y": values[y][known].tolist(), **texts, "every": step}

    def _order(self, text: str, sort: str, down: bool) -> Any:
        key = (text, sort, down)
        if key not in self._orders:
            if len(self._orders) > 16:
                self._orders.clear()
            places = np.flatnonzero(filtered(self.table, text))
            if sort:
                column = self.table[known_column(self.table, sort)].iloc[places]
                if str(column.dtype) == "category":
                    column = column.astype("str")
                order = column.reset_index(drop=True).sort_values(ascending=not down, na_position="last", kind="stable")
                places = places[order.index.to_numpy()]
            self._orders[key] = places
        return self._orders[key]


def prepared(store: Path) -> "pd.DataFrame":
    """The index with what is derived from it, what people decided, and the images without a product."""
    import pandas as pd

    table = open_index(store).drop(columns=list(LEFT_OUT))
    table["sigma_px"] = table[["centre_x_uncertainty_px", "centre_y_uncertainty_px"]].max(axis=1)
    table["offset_px"] = np.hypot(table["offset_x_px"], table["offset_y_px"])
    others = without_product(store, set(table["product"]))
    if others:
        more = pd.DataFrame(others, columns=list(SHOWN_OF_OUTCOMES))
        more["utc"] = pd.to_datetime(more["utc"], utc=True, format="ISO8601").astype(table["utc"].dtype)
        table = pd.concat([table, more.astype({"product": "str"})], ignore_index=True)
    table["worst"] = worst_of(table)
    reviews = all_reviews(store)
    for place, name in enumerate(("review", "note")):
        table[name] = [reviews.get(product, ("", ""))[place] for product in table["product"]]
    for name in REPEATED:
        table[name] = table[name].astype("category")
    return table


def worst_of(table: "pd.DataFrame") -> Any:
    """(n,) by which the images that want a look come first: those without a product, doubtful ones, then ok ones
    (thousands), each by the larger of sigma of the centre and limb residual, px. Of a close-up without a limb the sigma
    does not count: the centre is far outside the frame, and the place on the surface is known much better."""
    verdict = table["status"].map({"ok": 0.0, "doubtful": 1.0}).fillna(2.0).to_numpy(dtype=np.float64)
    sigma = table["sigma_px"].to_numpy(dtype=np.float64, na_value=np.nan)
    limb = table["limb_rms_px"].to_numpy(dtype=np.float64, na_value=np.nan)
    errors = np.fmax(np.fmax(np.where(np.isfinite(limb), sigma, np.nan), limb), 0.0)
    return 1000.0 * verdict + np.minimum(errors, 999.0)


def why_worst(status: str, sigma_px: float, limb_rms_px: float) -> str:
    """What puts an image to its place in the order of `worst_of`."""
    if status not in PUBLISHED:
        return f"{status}: it has no product"
    what = "it is doubtful; " if status == "doubtful" else ""
    if not np.isfinite(limb_rms_px):
        return f"{what}no limb is measured"
    if sigma_px > limb_rms_px:
        return f"{what}sigma of the centre {sigma_px:.3g} px"
    return f"{what}limb residual {limb_rms_px:.3g} px"


SHOWN_OF_OUTCOMES = ("product", "status", "reason", "utc", "camera", "target", "profile")


def without_product(store: Path, products: set[str]) -> list[dict[str, Any]]:
    """Images that were refused or failed and have no product: as runs of `reprocess` remember them, and as failed
    images left them in the store, which is what was done last."""
    remembered = (each.__dict__ for each in all_outcomes(Path(store) / BOOKS) if each.status not in PUBLISHED)
    found = {each["product"]: each for each in (*remembered, *failed_results(store))}
    return [
        {name: each.get(name) for name in SHOWN_OF_OUTCOMES}
        for product, each in sorted(found.items())
        if product not in products
    ]


def known_column(table: "pd.DataFrame", name: str) -> str:
    """The column of a name or alias. Raises WrongOptionError."""
    column = ALIASES.get(name, name)
    if column not in table.columns:
        raise WrongOptionError("column", f"there is no column {name!r}.", f"Known are {', '.join(table.columns)}.")
    return column


def numbers(table: "pd.DataFrame", column: str) -> Any:
    """A column as float64; times as decimal years."""
    if column == "utc":
        times = table["utc"].dt.tz_localize(None).to_numpy(dtype="datetime64[us]")
        years = times.astype("datetime64[us]").astype(np.float64) / (365.25 * 86400e6) + 1970.0
        return np.where(np.isnat(times), np.nan, years)
    try:
        return table[column].to_numpy(dtype=np.float64, na_value=np.nan)
    except (ValueError, TypeError) as error:
        raise WrongOptionError("column", f"{column} is no number.", "Choose another one.") from error


def plain_rows(table: "pd.DataFrame") -> list[dict[str, Any]]:
    """Rows as plain JSON, unknown values None."""
    columns = {str(name): [plain_value(value) for value in table[name]] for name in table.columns}
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def plain_value(value: Any) -> Any:
    """One value of a table as JSON."""
    if value is None or str(value) in ("<NA>", "NaT", "nan"):
        return None
    if hasattr(value, "isoformat"):
        return value.isoformat().replace("+00:00", "Z")
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(value) if math.isfinite(value) else None
    return str(value)


def columns_of(table: "pd.DataFrame") -> Sequence[dict[str, str]]:
    """Names and kinds of the columns, for the page."""
    from viewer.filters import is_number

    kinds = {name: "number" if is_number(table, name) else "text" for name in map(str, table.columns)}
    return [{"name": name, "kind": "time" if name == "utc" else kind} for name, kind in kinds.items()]
