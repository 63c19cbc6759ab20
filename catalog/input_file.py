"""Files that a user names: their content hashes, and what is wrong with one that cannot be read."""

from pathlib import Path

from catalog.absent import absent_file
from catalog.basemap import MAX_MAP_BYTES
from catalog.body import MAX_SHAPE_BYTES
from catalog.digest import input_changed, sha256_of_file
from catalog.errors import RefusedError
from catalog.mask import MAX_MASK_BYTES
from catalog.readers import image_is_folder
from catalog.readers.reading import MAX_FILE_BYTES
from catalog.regular_file import MAX_TEXT_BYTES, ChangedError, TooLargeError

LARGEST_BYTES = {
    "image": MAX_FILE_BYTES,
    "label": MAX_FILE_BYTES,
    "pose file": MAX_TEXT_BYTES,
    "mask": MAX_MASK_BYTES,
    "base map": MAX_MAP_BYTES,
    "shape": MAX_SHAPE_BYTES,
    "reseau table": MAX_TEXT_BYTES,
}


def digest_of(path: Path, what: str) -> str:
    """Content hash of a file that the user named. Raises RefusedError when it cannot be read, has more bytes than what
    it is meant to be, or changes meanwhile."""
    if known := absent_file(path):
        return known.sha256
    code = what.replace(" ", "-")
    try:
        return sha256_of_file(path, LARGEST_BYTES.get(what))
    except FileNotFoundError as error:
        raise RefusedError(f"{code}-missing", f"{what} {path} does not exist.", "Check the path.") from error
    except TooLargeError as error:
        remedy = "Give a single frame." if what == "image" else "Is it the right file?"
        raise RefusedError(f"{code}-too-large", f"{what} {path}: {error.strerror}.", remedy) from error
    except ChangedError:
        raise input_changed(f"{what} {path}") from None
    except OSError as error:
        if what == "image" and isinstance(error, IsADirectoryError):
            raise image_is_folder(path) from error
        remedy = "Give a file that may be read; save what comes from a pipe as a file first."
        raise RefusedError(f"{code}-unreadable", f"{what} {path} cannot be read: {error.strerror}.", remedy) from error
