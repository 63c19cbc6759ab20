"""The plans of a list, in its order, each made when it is wanted; of a long one by several processes."""

import multiprocessing
from collections import deque
from collections.abc import Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import replace
from itertools import islice

from catalog.digest import Signature, learn_digests, learned_digests, remember_digests
from catalog.spice import KernelLists
from flows.options import ReprocessOptions, processors
from flows.reprocessing.fingerprint import Fingerprints
from flows.reprocessing.planning import Plan, plan_of
from flows.reprocessing.worker import DIGESTS
from flows.request import Request

ONE_PROCESS = 3000  # images that one process has planned before others have started
AT_ONCE = 250
Answer = tuple[list[Plan], dict[str, tuple[Signature, str]]]


def each_plan(requests: Iterable[Request], count: int, options: ReprocessOptions) -> Iterator[Plan]:
    """The plan of every image. count: how many there are."""
    waiting = iter(requests)
    if count < ONE_PROCESS or processors() < 2:
        planner = Planner(options)
        yield from map(planner.plan, waiting)
        return
    method = "forkserver" if "forkserver" in multiprocessing.get_all_start_methods() else "spawn"
    context = multiprocessing.get_context(method)
    with ProcessPoolExecutor(processors(), context, begin_planning, (options,)) as pool:
        ahead: deque[tuple[list[Request], Future[Answer]]] = deque()
        while True:
            while len(ahead) < 2 * processors() and (some := list(islice(waiting, AT_ONCE))):
                ahead.append((some, pool.submit(plan_some, some)))
            if not ahead:
                return
            some_requests, future = ahead.popleft()
            plans, learned = future.result()
            learn_digests(learned)
            for request, plan in zip(some_requests, plans, strict=True):
                yield replace(plan, request=request)


class Planner:
    """What the plans of a list share."""

    def __init__(self, options: ReprocessOptions) -> None:
        self._options, self._kernels = options, KernelLists()
        self._fingerprints = Fingerprints(self._kernels)

    def plan(self, request: Request) -> Plan:
        """The plan of one image."""
        return plan_of(request, self._options, self._kernels, self._fingerprints)


_planner: list[Planner] = []


def begin_planning(options: ReprocessOptions) -> None:
    """What a process does first."""
    remember_digests(options.steps_cache / DIGESTS)
    _planner[:] = [Planner(options)]


def plan_some(requests: list[Request]) -> Answer:
    """Plans of some images, in a process; the traces of those that are left alone stay here. Also the digests of files
    that were found on the way."""
    plans = [_planner[0].plan(request) for request in requests]
    return [plan if plan.do else replace(plan, trace={}) for plan in plans], learned_digests()
