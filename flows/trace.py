"""What is remembered of an image's steps, so that a later run knows by the same keys what has to be done, and why.

A trace is plain JSON: the profile, and of each step its name, key, code version and inputs, with its result or its
failure. It holds all that the flow needs to find its way again, also when the cache of steps is gone.
"""

from dataclasses import replace
from typing import Any

from pydantic import ValidationError

from catalog.errors import FailedError, PlanetposeError, RefusedError
from catalog.spice import KernelLists
from flows.chain import Chain, NotCachedError, RunStep, Tried
from flows.image import correct_image
from flows.request import Request
from tasks.changes import inputs_changed, leaves_changed
from tasks.fields import Json
from tasks.record import Record
from tasks.registry import STEPS
from tasks.step import AnyStep, StepType

FAILURES: dict[str, type[PlanetposeError]] = {kind.status: kind for kind in (FailedError, RefusedError)}


def trace_of(chain: Chain, failures: bool = True) -> Json:
    """What the steps of a chain came to. failures: whether those that failed would fail again."""
    entries = [entry_of(tried if failures else replace(tried, failure=None)) for tried in chain.tried]
    return {"profile": chain.request.profile.resolved(), "steps": entries}


def entry_of(tried: Tried) -> Json:
    """One step of a trace."""
    step, failure = tried.step, tried.failure
    failed = (
        {"status": failure.status, "code": failure.code, "fault": failure.fault, "remedy": failure.remedy}
        if failure
        else None
    )
    result = tried.record.result if tried.record else None
    known = {"name": step.name, "key": step.key, "code": step.code, "inputs": step.plain_inputs}
    return {**known, "result": result, "failure": failed}


def answering(trace: Json) -> RunStep:
    """Answers for a chain: by the trace, where a step has the same key, else from the cache. Raises NotCachedError."""
    known = {entry["key"]: entry for entry in trace.get("steps", [])}

    def answer(step: AnyStep) -> Record:
        entry = known.get(step.key)
        if entry and entry["failure"]:
            failed = entry["failure"]
            raise FAILURES[failed["status"]](failed["code"], failed["fault"], failed["remedy"])
        if entry and entry["result"] is not None:
            return Record(step.name, step.key, step.code, step.plain_inputs, entry["result"], 0.0, "")
        record = None if step.destination or step.kind.find_record else step.record()
        if record is None:
            raise NotCachedError(step)
        return record

    return answer


def known_chain(request: Request, trace: Json, kernels: KernelLists) -> tuple[Chain, Exception | None]:
    """The chain of an image as far as trace and cache answer it, and what ended it: NotCachedError at the first step
    that has to be done, a failure, or None where there is nothing to do. Nothing is written."""
    chain = Chain(request, answering(trace), read_only=True, kernels=kernels)
    try:
        correct_image(chain)
    except (NotCachedError, PlanetposeError, OSError) as error:
        return chain, error
    return chain, None


def changes(trace: Json, chain: Chain) -> list[str]:
    """What is another than when the trace was made, for people: `settings: range.ssim.step 0.001 -> 0.002`, `code of
    point`, `kernel naif0012.tls`. A chain that came to a step which is not in the trace shows more than its inputs."""
    before = {entry["name"]: entry for entry in trace.get("steps", [])}
    found: list[str] = []
    for tried in chain.tried:
        old = before.get(tried.step.name)
        if old and old["key"] != tried.step.key:
            found += inputs_changed(tried.step.kind.labels, old["inputs"], tried.step.plain_inputs)
    settings = leaves_changed(trace.get("profile") or {}, chain.request.profile.resolved())
    found += [f"settings: {change}" for change in settings if not change.startswith("name ")]
    kinds = {step.name: step for step in STEPS}
    first: dict[str, Json] = {}
    for name, entry in before.items():
        first.setdefault(name.partition("-")[0], entry)
    found += [f"code of {name}" for name in first if name in kinds and code_changed(kinds[name], first[name])]
    return list(dict.fromkeys(found))


def code_changed(kind: StepType[Any, Any, Any], entry: Json) -> bool:
    """Whether a step of a trace would run other code now, its own or that of the plugins that its inputs name."""
    try:
        return kind.code_for(kind.inputs.model_validate(entry["inputs"])) != entry["code"]
    except (ValidationError, RefusedError):  # inputs of another version, or of a plugin that is gone
        return bool(kind.code != entry["code"])
