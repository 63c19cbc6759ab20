"""The flow's parameters, which are plain JSON, and the settings that they mean."""

from pathlib import Path
from typing import Any

from pydantic import ValidationError

from catalog.errors import RefusedError
from flows.places import place_of
from flows.reprocessing.requests import absolute
from flows.reprocessing.settings import Limits, Settings


def settings_of(**parameters: Any) -> Settings:
    """The flow's parameters as settings; what is None keeps its default. Paths become absolute, for workers stand
    elsewhere. Raises RefusedError naming what is no good."""
    given = {name: value for name, value in parameters.items() if value is not None}
    limits = {name: given.pop(name) for name in Limits.model_fields if name in given}
    if "store" in given:
        place = place_of(given["store"])
        given |= {"store": place.store, "publish_to": place.publish_to}
    for name in ("store", "archive", "cache"):
        if name in given:
            (given[name],) = absolute([Path(given[name])])
    for name in ("images", "profile"):  # a catalog's name, or a file
        if name in given and Path(given[name]).is_file():
            given[name] = str(Path(given[name]).absolute())
    if "kernels" in given:
        given["kernels"] = absolute(Path(path) for path in given["kernels"])
    try:
        return Settings(**given, limits=Limits(**limits))
    except ValidationError as error:
        faults = "; ".join(f"{'.'.join(map(str, fault['loc']))}: {fault['msg']}" for fault in error.errors())
        raise RefusedError("parameters-invalid", f"{faults}.", "See `planetpose reprocess --help`.") from error


def parameters_of(settings: Settings) -> dict[str, Any]:
    """The flow's parameters that mean these settings."""
    plain = settings.model_dump(mode="json")
    plain["store"] = plain.pop("publish_to") or plain["store"]
    limits = {name: value for name, value in plain["limits"].items() if name != "tries"}
    return {**{name: value for name, value in plain.items() if name != "limits"}, **limits}
