"""Leases on products: one process at a time works on a product or writes it, wherever it runs.

A lease is an object that its holder writes anew again and again. Who waits takes it over when he has seen no change of
it for PLANETPOSE_LEASE_S by his own clock, so clocks need not agree. A holder that could not renew it (it was stopped,
or the storage was away) looks before it writes: a lease that was taken over meanwhile is lost, and nothing more is
written.
"""

import json
import os
import platform
import threading
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from catalog.errors import FailedError
from catalog.reasons import Reason
from catalog.settings import lease_s
from tasks.objectstore.conditional import (
    delete_same,
    has_conditions,
    put_new,
    put_over,
    read_object,
    tag_of,
)
from tasks.objectstore.location import ObjectStore, reaching

LEASES = ".reprocess/leases"
LOOK_EVERY_S = 1.0
RENEWALS = 4  # in the time after which a lease may be taken over


class Lease:
    """One that is held. name: of its object. holder: who holds it."""

    def __init__(self, store: ObjectStore, name: str, holder: str, tag: str) -> None:
        self._store, self._name, self._holder, self._tag = store, name, holder, tag
        self._renewed = time.monotonic()
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self._is_lost = False
        threading.Thread(target=self._keep, daemon=True, name=f"lease {name}").start()

    def check(self) -> None:
        """Raises FailedError when it is lost, or the storage cannot say whether it is."""
        if time.monotonic() - self._renewed > lease_s() / 2:
            with reaching(self._store):
                self._renew()
        if self._is_lost:
            raise lost(self._store, self._name)

    def release(self) -> None:
        """Give it back; where the storage is away it runs out by itself."""
        self._ended.set()
        with self._lock, suppress(FailedError), reaching(self._store):
            delete_same(self._store, self._name, self._tag)

    def _renew(self) -> None:
        with self._lock:
            if self._is_lost or self._ended.is_set():
                return
            started = time.monotonic()
            content = content_of_lease(self._holder)
            # None also where the answer to an earlier renewal was lost on its way, and not the renewal.
            tag = put_over(self._store, self._name, content, self._tag) or tag_of_own(
                self._store, self._name, self._holder
            )
            self._is_lost = tag is None
            if tag is not None:
                self._tag, self._renewed = tag, started

    def _keep(self) -> None:
        while not self._ended.wait(lease_s() / RENEWALS):
            with suppress(FailedError), reaching(self._store):
                self._renew()


_held: dict[tuple[str, str], Lease] = {}


@contextmanager
def leased(store: ObjectStore, product: str, waiting: Callable[[], None] = lambda: None) -> Iterator[None]:
    """Hold the lease on a product for the `with` block; a block within another one of this process has the same.
    `waiting` is called while another process has it. Raises FailedError when the storage cannot be reached."""
    key = (store.url, product)
    if key in _held or not has_conditions(store):
        yield
        return
    lease = acquired(store, f"{LEASES}/{product}", waiting)
    _held[key] = lease
    try:
        yield
    finally:
        del _held[key]
        lease.release()


def check_lease(store: ObjectStore, product: str) -> None:
    """Before something of a product is written: raises FailedError when its lease was taken over meanwhile."""
    if lease := _held.get((store.url, product)):
        lease.check()


def acquired(store: ObjectStore, name: str, waiting: Callable[[], None]) -> Lease:
    """The lease, once nobody else has it."""
    holder, seen, since = uuid.uuid4().hex, None, time.monotonic()
    while True:
        tag = None
        with reaching(store):
            there = tag_of(store, name) if seen else None
            if there is None:
                tag = put_new(store, name, content_of_lease(holder)) or tag_of_own(store, name, holder)
                there = tag or tag_of(store, name)
            elif there == seen and time.monotonic() - since > lease_s():
                tag = put_over(store, name, content_of_lease(holder), there)
        if tag is not None:
            return Lease(store, name, holder, tag)
        if there != seen:
            seen, since = there, time.monotonic()
        waiting()
        time.sleep(LOOK_EVERY_S)


def content_of_lease(holder: str) -> bytes:
    """Who holds it; never the same twice, so that each renewal has another ETag."""
    known = {"holder": holder, "host": platform.node(), "pid": os.getpid(), "renewal": uuid.uuid4().hex}
    return json.dumps(known).encode()


def tag_of_own(store: ObjectStore, name: str, holder: str) -> str | None:
    """ETag of a lease that this holder has all the same; None where it is another's. A lease that was taken over never
    comes back, so that content which is the holder's says that the ETag, read before it, was too."""
    tag = tag_of(store, name)
    try:
        known = json.loads(read_object(store, name) or b"{}") if tag else {}
    except ValueError:
        return None
    return tag if isinstance(known, dict) and known.get("holder") == holder else None


def lost(store: ObjectStore, name: str) -> FailedError:
    """The failure of a holder whose lease was taken over; it can pass."""
    error = FailedError(
        Reason.LEASE_LOST,
        f"the lease {name} in {store.url} was taken over by another worker while this one could not renew it.",
        "Nothing is needed: the other worker does the image. Else run it again.",
    )
    error.__cause__ = ConnectionError("lease lost")
    return error
