"""An instrument's keywords in SPICE's kernel pool, and where each came from."""

import tomllib
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, Protocol

from catalog.errors import RefusedError
from catalog.kernel_text import is_binary, read_text_kernel
from catalog.reasons import Reason
from catalog.spice import Kernel

CONSTANTS = Path(__file__).parent / "instrument_constants.toml"
MAX_VALUES = 200
MAX_KEYWORDS = 5000
INSTRUMENT_REMEDY = "Load the instrument kernel (IK) and, where ISIS has one, its addendum (IAK) with --kernels."


class Pool(Protocol):
    """Where keywords come from."""

    def numbers(self, variable: str) -> tuple[float, ...]:
        """Numbers of a variable; () where it has none."""
        ...

    def text(self, variable: str) -> str | None:
        """First string of a variable."""
        ...

    def names(self, prefix: str) -> tuple[str, ...]:
        """Variables that begin with `prefix`."""
        ...

    def source(self, variable: str) -> str:
        """Name of the file that gives a variable."""
        ...


class KernelPool:
    """SPICE's pool, while kernels are loaded."""

    def __init__(self, loaded: Iterable[Kernel]) -> None:
        self._files = _files_of_keywords(loaded)

    def numbers(self, variable: str) -> tuple[float, ...]:
        """Numbers of a variable; () where it has none."""
        import spiceypy

        try:
            return tuple(map(float, spiceypy.gdpool(variable, 0, MAX_VALUES)))
        except spiceypy.NotFoundError:
            return ()

    def text(self, variable: str) -> str | None:
        """First string of a variable."""
        import spiceypy

        try:
            return str(spiceypy.gcpool(variable, 0, 1)[0]).strip()
        except spiceypy.NotFoundError:
            return None

    def names(self, prefix: str) -> tuple[str, ...]:
        """Variables that begin with `prefix`."""
        import spiceypy

        try:
            return tuple(spiceypy.gnpool(f"{prefix}*", 0, MAX_KEYWORDS))
        except spiceypy.NotFoundError:
            return ()

    def source(self, variable: str) -> str:
        """Name of the file that gives a variable last."""
        return self._files.get(variable, "loaded kernels")


class TablePool:
    """Keywords that a file carries: the NaifKeywords of ISIS cubes and of ISDs."""

    def __init__(self, values: Mapping[str, Any], source: str) -> None:
        self._values, self._source = {str(key).upper(): value for key, value in values.items()}, source

    def _items(self, variable: str) -> list[Any]:
        value = self._values.get(variable.upper())
        return list(value) if isinstance(value, list | tuple) else [] if value is None else [value]

    def numbers(self, variable: str) -> tuple[float, ...]:
        """Numbers of a variable; () where it has none."""
        found = self._items(variable)
        sound = all(isinstance(each, int | float) and not isinstance(each, bool) for each in found)
        return tuple(map(float, found)) if sound else ()

    def text(self, variable: str) -> str | None:
        """First string of a variable."""
        found = self._items(variable)
        return found[0].strip() if found and isinstance(found[0], str) else None

    def names(self, prefix: str) -> tuple[str, ...]:
        """Variables that begin with `prefix`."""
        return tuple(key for key in self._values if key.startswith(prefix))

    def source(self, variable: str) -> str:  # noqa: ARG002
        """Name of the file."""
        return self._source


class Instrument:
    """Keywords INS<id>_* of one instrument.

    A keyword that the id itself lacks is looked for under the ids of ten and a hundred that it belongs to: filters and
    framelets share their camera's focal plane (-143422 has -143400's). What no kernel says comes from
    `instrument_constants.toml`. `used` collects the keywords that were found, by source.
    """

    def __init__(self, naif_id: int, name: str, pool: Pool) -> None:
        self.naif_id, self.name, self.pool = naif_id, name, pool
        self.family = tuple(dict.fromkeys((naif_id, _rounded(naif_id, 10), _rounded(naif_id, 100))))
        self.used: dict[str, list[str]] = {}

    @property
    def parent(self) -> "Instrument | None":
        """The camera that a filter or framelet belongs to: the next id of ten or a hundred with a boresight's pixel."""
        for naif_id in self.family[1:]:
            if self.pool.numbers(f"INS{naif_id}_BORESIGHT_LINE"):
                found = Instrument(naif_id, self.name, self.pool)
                found.used = self.used
                return found
        return None

    def numbers(self, keyword: str, own: bool = False) -> tuple[float, ...]:
        """Values of a keyword, () where nothing gives it. own: only under the instrument's own id."""
        for naif_id in self.family[:1] if own else self.family:
            values = self.pool.numbers(f"INS{naif_id}_{keyword}")
            if values:
                self._note(f"INS{naif_id}_{keyword}")
                return values
        return self._constant(keyword)

    def number(self, keyword: str, own: bool = False) -> float | None:
        """First value of a keyword."""
        values = self.numbers(keyword, own)
        return values[0] if values else None

    def text(self, keyword: str) -> str | None:
        """First string of a keyword."""
        for naif_id in self.family:
            value = self.pool.text(f"INS{naif_id}_{keyword}")
            if value is not None:
                self._note(f"INS{naif_id}_{keyword}")
                return value
        return None

    def keywords(self) -> tuple[str, ...]:
        """All keywords that are given for the instrument itself."""
        prefix = f"INS{self.naif_id}_"
        return tuple(name.removeprefix(prefix) for name in self.pool.names(prefix))

    def _constant(self, keyword: str) -> tuple[float, ...]:
        known = instrument_constants().get(str(self.naif_id), {})
        if keyword not in known:
            return ()
        found = self.used.setdefault(str(known["source"]), [])
        found += [keyword] if keyword not in found else []
        return (float(known[keyword]),)

    def _note(self, variable: str) -> None:
        found = self.used.setdefault(self.pool.source(variable), [])
        found += [variable] if variable not in found else []

    def sources(self) -> tuple[str, ...]:
        """One line for each source: its name and the keywords it gave."""
        return tuple(f"{source}: {', '.join(variables)}" for source, variables in self.used.items())

    def fault(self, what: str) -> str:
        """A sentence that names the instrument and what is wrong with its kernels."""
        return f"instrument {self.name} ({self.naif_id}): {what}."


def _rounded(naif_id: int, step: int) -> int:
    return -(-naif_id // step * step) if naif_id < 0 else naif_id // step * step


@cache
def instrument_constants() -> dict[str, dict[str, Any]]:
    """Content of `instrument_constants.toml`."""
    return tomllib.loads(CONSTANTS.read_text(encoding="utf-8"))


def _files_of_keywords(loaded: Iterable[Kernel]) -> dict[str, str]:
    """Name of the file that gives each INS keyword last."""
    files: dict[str, str] = {}
    for kernel in loaded:
        if kernel.kind in ("spk", "ck", "lsk", "sclk") or is_binary(kernel.path):
            continue
        for statement in read_text_kernel(kernel.path).statements:
            if statement.name.startswith("INS"):
                files[statement.name] = kernel.path.name
    return files


def naif_id_of(instrument: str | int) -> int:
    """NAIF id of an instrument: a number, a name of a loaded kernel, or the name of its frame.

    Raises RefusedError listing the instruments that the loaded kernels describe.
    """
    import spiceypy

    text = str(instrument).strip()
    try:
        return int(text)
    except ValueError:
        pass
    try:
        return int(spiceypy.bods2c(text))
    except spiceypy.NotFoundError:
        frame = int(spiceypy.namfrm(text.upper()))
    if frame < 0:
        return frame
    known = ", ".join(known_instruments()) or "none"
    fault = f"instrument {text!r} is not in the loaded kernels; they describe {known}."
    raise RefusedError(Reason.INSTRUMENT_UNKNOWN, fault, f"Give one of them, or its NAIF id. {INSTRUMENT_REMEDY}")


def known_instruments() -> list[str]:
    """Names (ids where they have none) of the instruments with a focal length or a pixel pitch in the pool."""
    import spiceypy

    ids: dict[int, None] = {}
    for keyword in ("FOCAL_LENGTH", "PIXEL_PITCH", "TRANSX"):
        try:
            variables = spiceypy.gnpool(f"INS*_{keyword}", 0, MAX_KEYWORDS)
        except spiceypy.NotFoundError:
            continue
        for variable in variables:
            digits = variable[3:].split("_")[0]
            if digits.lstrip("-").isdigit():
                ids.setdefault(int(digits))
    return [instrument_name(naif_id) for naif_id in ids]


def instrument_name(naif_id: int) -> str:
    """NAIF name of an instrument, of its frame, or the id itself."""
    import spiceypy

    try:
        return str(spiceypy.bodc2n(naif_id))
    except spiceypy.NotFoundError:
        return str(spiceypy.frmnam(naif_id)).strip() or str(naif_id)
