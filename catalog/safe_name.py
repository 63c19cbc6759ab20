"""Names that are safe as a folder in the store, whatever a file or a label calls its product."""

import hashlib
import unicodedata

MAX_NAME_BYTES = 100  # a temporary sibling adds host, process and 25 more characters to it; file systems allow 255
ALLOWED = set("._-+=,@()")
RESERVED = {"CON", "PRN", "AUX", "NUL", "CLOCK$"} | {f"{port}{i}" for port in ("COM", "LPT") for i in range(1, 10)}
NAMELESS = "image"
INDEX, TABLE = "index.parquet", "reprocess"  # files beside the products of a store: the index, tables of the last run
# What a store or a product holds under these names is looked for there; a report is written into the folder `report`.
OF_THE_STORE = {
    *(INDEX, f"{TABLE}.csv", f"{TABLE}.json", "adjust.json", "report"),
    *("cube.zarr", "planes.zarr", "arrays.zarr", "zarr.json", "overlay.png"),
    *("record.json", "result.json", "settings.json", "sha256sums"),
}


def safe_product_name(name: str) -> str:
    """`name` as one folder name: letters and digits of any script and `._-+=,@()`, no more than `MAX_NAME_BYTES` of
    UTF-8, neither hidden nor an option nor a device's name nor one that the store uses itself. A name that has to be
    changed for more than leading dots and dashes gets eight hex digits of its hash, so that two different ones stay
    different. Never raises."""
    text = unicodedata.normalize("NFC", name.encode("utf-8", "surrogateescape").decode("utf-8", "replace"))
    text = text.lstrip(".-").rstrip(".")
    kept = "".join(character if character.isalnum() or character in ALLOWED else "_" for character in text)
    short = kept.encode()[:MAX_NAME_BYTES].decode("utf-8", "ignore")
    if short.partition(".")[0].upper() in RESERVED or short.casefold() in OF_THE_STORE:
        short = f"_{short}"
    elif short and short == text:
        return short
    if not short.strip("_"):
        short = NAMELESS
        if not text:
            return short
    digest = hashlib.sha256(name.encode("utf-8", "surrogateescape")).hexdigest()[:8]
    return f"{short.encode()[: MAX_NAME_BYTES - 9].decode('utf-8', 'ignore')}-{digest}"


def is_safe_product_name(name: str) -> bool:
    """Whether `name` can stay as it is."""
    return safe_product_name(name) == name
