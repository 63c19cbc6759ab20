"""Prefect flows whose parameters are the fields of a model of options."""

import functools
import inspect
from collections.abc import Callable
from typing import Any, TypeVar

from prefect import Flow, flow
from prefect.states import State

from flows.image_options import Options

O = TypeVar("O", bound=Options)  # noqa: E741 - options


def flow_of(model: type[O]) -> Callable[[Callable[[O], State[Any]]], Flow[..., State[Any]]]:
    """A decorator that makes a flow of a function of the options: its name is the command's (the function's,
    with dashes), its parameters are the
    fields of `model`, with their types, bounds, defaults and descriptions."""

    def decorate(body: Callable[[O], State[Any]]) -> Flow[..., State[Any]]:
        @functools.wraps(body)
        def run(**given: Any) -> State[Any]:
            return body(model(**given))

        fields = model.model_fields.items()
        parameters = [
            inspect.Parameter(
                name,
                inspect.Parameter.KEYWORD_ONLY,
                default=inspect.Parameter.empty if field.is_required() else field.default,
                annotation=field.rebuild_annotation(),
            )
            for name, field in fields
        ]
        run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        # Prefect's page has the descriptions of parameters from here.
        described = "".join(f"\n    {name}: {field.description}" for name, field in fields if field.description)
        run.__doc__ = f"{inspect.getdoc(body)}\n\nArgs:{described}"
        return flow(name=body.__name__.replace("_", "-"), description=inspect.getdoc(body), persist_result=False)(run)

    return decorate
