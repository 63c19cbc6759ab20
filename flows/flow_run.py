"""The Prefect run that this code is part of, as it is noted beside products."""

from typing import Any

from catalog.times import now_utc


def current_run() -> dict[str, Any] | None:
    """Plain JSON: `flow_run` (id), `name`, `task_run` (id, None outside of a task), `url` of its page (None with an
    embedded server), `at` (UTC); None outside of a run."""
    from prefect.context import FlowRunContext, TaskRunContext
    from prefect.utilities.urls import url_for

    task, flow = TaskRunContext.get(), FlowRunContext.get()
    run = flow.flow_run if flow else None
    flow_id = run.id if run else task.task_run.flow_run_id if task else None
    if flow_id is None:
        return None
    task_id = task.task_run.id if task else None
    page = url_for("task-run", obj_id=task_id) if task_id else url_for("flow-run", obj_id=flow_id)
    name = f"{run.name if run else ''} {task.task_run.name if task else ''}".strip()
    return {
        "flow_run": str(flow_id),
        "task_run": str(task_id) if task_id else None,
        "name": name or str(flow_id),
        "url": page,
        "at": now_utc(),
    }
