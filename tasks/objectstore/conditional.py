"""Single objects written under a condition: only where there is none, or only where it is what was read.

S3 answers If-None-Match and If-Match of a put and a deletion in one step (conditional writes), which is what stands in
for locks and renames. Storage without them has no leases; there the last writer of a product stays.
"""

from tasks.objectstore.location import ObjectStore

PRECONDITION_FAILED, CONFLICT = 412, 409
MISSING = 404


def has_conditions(store: ObjectStore) -> bool:
    """Whether the storage takes conditions."""
    return hasattr(store.files, "call_s3")


def put_new(store: ObjectStore, name: str, content: bytes) -> str | None:
    """Write an object where there is none; its ETag, None where there is one."""
    return _put(store, name, content, IfNoneMatch="*")


def put_over(store: ObjectStore, name: str, content: bytes, tag: str) -> str | None:
    """Write an object in place of the one with this ETag; the new one's, None where it is another one or gone."""
    return _put(store, name, content, IfMatch=tag)


def delete_same(store: ObjectStore, name: str, tag: str) -> bool:
    """Delete the object with this ETag; whether it was there."""
    bucket, key = bucket_and_key(store, name)
    try:
        store.files.call_s3("delete_object", Bucket=bucket, Key=key, IfMatch=tag)
    except OSError as error:
        if _status(error) in (PRECONDITION_FAILED, CONFLICT, MISSING):
            return False
        raise
    return True


def tag_of(store: ObjectStore, name: str) -> str | None:
    """ETag of an object; None where there is none."""
    bucket, key = bucket_and_key(store, name)
    try:
        return str(store.files.call_s3("head_object", Bucket=bucket, Key=key)["ETag"])
    except FileNotFoundError:
        return None


def _put(store: ObjectStore, name: str, content: bytes, **condition: str) -> str | None:
    bucket, key = bucket_and_key(store, name)
    try:
        return str(store.files.call_s3("put_object", Bucket=bucket, Key=key, Body=content, **condition)["ETag"])
    except OSError as error:
        # 409: another conditional write of the same object was under way.
        if _status(error) in (PRECONDITION_FAILED, CONFLICT, MISSING) and not _bucket_is_missing(error):
            return None
        raise


def bucket_and_key(store: ObjectStore, name: str) -> tuple[str, str]:
    """An object's bucket, and its key in it."""
    bucket, _, key = store.path(name).partition("/")
    return bucket, key


def _status(error: OSError) -> int | None:
    answer = getattr(error.__cause__, "response", None) or {}
    status = answer.get("ResponseMetadata", {}).get("HTTPStatusCode")
    return status if isinstance(status, int) else None


def _bucket_is_missing(error: OSError) -> bool:
    answer = getattr(error.__cause__, "response", None) or {}
    return bool(answer.get("Error", {}).get("Code") == "NoSuchBucket")


def read_object(store: ObjectStore, name: str) -> bytes | None:
    """Content of an object by one request; None where there is none."""
    if not has_conditions(store):
        try:
            return bytes(store.files.cat_file(store.path(name)))
        except FileNotFoundError:
            return None
    from fsspec.asyn import sync

    bucket, key = bucket_and_key(store, name)
    try:
        answer = store.files.call_s3("get_object", Bucket=bucket, Key=key)
    except FileNotFoundError as error:
        if _bucket_is_missing(error):
            raise
        return None
    return bytes(sync(store.files.loop, answer["Body"].read))
