"""Object stores by URL, `s3://bucket/prefix`, through fsspec; endpoint and credentials are found where AWS has them."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

from catalog.errors import FailedError, RefusedError
from catalog.fetch.signed import storage_errors
from catalog.reasons import Reason

SEPARATOR = "://"
S3 = "s3"
# Listings are never remembered: other processes write into the store too.
OPTIONS: dict[str, dict[str, Any]] = {
    S3: {
        "use_listings_cache": False,
        "config_kwargs": {
            "connect_timeout": 10,
            "read_timeout": 60,
            "retries": {"max_attempts": 4, "mode": "standard"},
        },
    }
}


def is_url(text: str) -> bool:
    """Whether a store's name is a URL and not a folder."""
    return SEPARATOR in text


@dataclass(frozen=True)
class ObjectStore:
    """files: fsspec's file system. root: path of the store in it, without a slash at its end. url: of the store."""

    files: Any
    root: str
    url: str

    def path(self, *parts: str) -> str:
        """Path of an object below the root."""
        return "/".join((self.root, *parts))


def open_object_store(url: str) -> ObjectStore:
    """The store at `url`; no request is made yet. Raises RefusedError when the URL names no storage that is known
    here, or no bucket."""
    import fsspec

    protocol, _, bucket = url.partition(SEPARATOR)
    if not bucket.strip("/"):
        raise RefusedError(Reason.STORE_UNKNOWN, f"store {url} names no bucket.", "Use s3://bucket/prefix.")
    try:
        files, root = fsspec.url_to_fs(url.rstrip("/"), **OPTIONS.get(protocol, {}))
    except ImportError as error:
        remedy = "pip install 'planetpose[s3]'" if protocol == S3 else f"Install fsspec's driver for {protocol}."
        raise RefusedError(Reason.STORE_DRIVER_MISSING, f"store {url}: {error}.", remedy) from error
    except ValueError as error:
        raise RefusedError(
            Reason.STORE_UNKNOWN, f"store {url}: {error}.", "Use a folder or s3://bucket/prefix."
        ) from error
    return ObjectStore(files, root.rstrip("/"), url.rstrip("/"))


@contextmanager
def reaching(store: ObjectStore) -> Iterator[None]:
    """Tell trouble with the storage within the `with` block as FailedError. What may be gone the next time (no
    connection, server errors) has a ConnectionError as its cause."""
    try:
        yield
    except PermissionError as error:
        remedy = "Check AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or AWS_PROFILE, and the bucket's policy."
        raise FailedError(
            Reason.STORE_FORBIDDEN, f"store {store.url} may not be used ({_in_words(error)}).", remedy
        ) from error
    except FileNotFoundError as error:
        fault = f"store {store.url}: {_in_words(error)}."
        raise FailedError(Reason.STORE_MISSING, fault, "Make the bucket; check AWS_ENDPOINT_URL.") from error
    except storage_errors() as error:
        if type(error).__name__ in ("NoCredentialsError", "PartialCredentialsError", "ProfileNotFound"):
            remedy = "Set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or AWS_PROFILE."
            raise FailedError(Reason.STORE_FORBIDDEN, f"store {store.url}: {_in_words(error)}.", remedy) from error
        fault = f"store {store.url} cannot be reached ({_in_words(error)})."
        raise FailedError(
            Reason.STORE_UNREACHABLE, fault, "Check the network and AWS_ENDPOINT_URL."
        ) from ConnectionError(_in_words(error))


def _in_words(error: Exception) -> str:
    return f"{type(error).__name__}: {error}".rstrip(".: ")
