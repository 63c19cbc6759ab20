"""Files in S3 by web addresses, so that they come by the same bounded, resumed and checked transfer as others."""

import sys
from typing import Any
from urllib.parse import quote

from catalog.fetch.transfer import TransferError

VALID_S = 3600


def files_of(address: str) -> tuple[Any, str]:
    """fsspec's file system of an s3:// address, and the path in it. Raises TransferError when its driver is missing."""
    import fsspec

    try:
        files, path = fsspec.url_to_fs(
            address, use_listings_cache=False, config_kwargs={"signature_version": "s3v4", "connect_timeout": 10}
        )
    except ImportError as error:
        raise TransferError("driver", f"{address}: {error}. pip install 'planetpose[s3]'", passing=False) from error
    return files, path


def signed(address: str) -> str:
    """A web address that gives the file for an hour; without credentials the one that is open to everybody."""
    files, path = files_of(address)
    try:
        return str(files.sign(path, expiration=VALID_S))
    except storage_errors() as error:
        if type(error).__name__ != "NoCredentialsError":
            raise TransferError("request", f"{address} cannot be signed ({error})", passing=False) from error
    bucket, _, key = path.partition("/")
    return f"https://{bucket}.s3.amazonaws.com/{quote(key)}"


def storage_errors() -> tuple[type[Exception], ...]:
    """What file systems raise: the system's errors, and AWS' own when its library is in use."""
    if "botocore" not in sys.modules:
        return (OSError,)
    from botocore.exceptions import BotoCoreError, ClientError

    return (OSError, BotoCoreError, ClientError)
