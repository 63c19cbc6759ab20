"""One model per command: its options, the parameters of its flow, and its deployment are the same."""

import inspect
from pathlib import Path
from typing import Any

import pytest
import yaml  # type: ignore[import-untyped]
from typer.main import get_command

from flows import map_options, star_options
from flows import options as models
from flows.cli import build_app
from flows.image_options import Options

COMMANDS = (
    "correct",
    "reprocess",
    "fetch",
    "export",
    "report",
    "kernels",
    "photometry",
    "mosaic",
    "control",
    "improve-map",
    "adjust",
    "check",
    "stars",
    "astrometry",
)
OF_THE_TERMINAL = {"json", "log_json", "quiet", "server", "dry_run", "help"}
DEPLOYMENTS = yaml.safe_load((Path(__file__).parents[2] / "deploy/prefect.yaml").read_text())["deployments"]


def model_of(command: str) -> type[Options]:
    name = f"{command.title().replace('-', '')}Options"
    found: type[Options] = next(vars(each)[name] for each in (models, map_options, star_options) if name in vars(each))
    return found


def flow_of(command: str) -> Any:
    from flows import correct, downstream, reprocess

    named = {"correct": correct.correct, "reprocess": reprocess.reprocess}
    return named.get(command) or getattr(downstream, command.replace("-", "_"))


@pytest.mark.parametrize("command", COMMANDS)
def test_options_of_the_command_line_and_parameters_of_the_flow_are_the_models(command: str) -> None:
    fields = model_of(command).model_fields
    cli = get_command(build_app()).commands[command]  # type: ignore[attr-defined]
    named = {parameter.name for parameter in cli.params}
    assert named - OF_THE_TERMINAL == fields.keys() - OF_THE_TERMINAL
    flow = flow_of(command)
    assert flow.name == command
    assert list(inspect.signature(flow.fn).parameters) == list(fields)
    shown = flow.parameters.model_dump()["properties"]
    for name, field in fields.items():
        assert field.description, name
        assert shown[name].get("description") == field.description
    assert any(entry["entrypoint"].endswith(f":{command.replace('-', '_')}") for entry in DEPLOYMENTS)


@pytest.mark.parametrize(
    ("command", "given"),
    [
        ("reprocess", {"images": "x", "workers": -1}),
        ("reprocess", {"images": "x", "most_failed_percent": 101}),
        ("correct", {"files": ["a"], "start_offset_px": "3"}),
        ("correct", {"files": ["a"], "flip": "sideways"}),
        ("export", {"paths": ["a"], "format": []}),
        ("check", {"paths": ["a"], "unknown": 1}),
        ("export", {"paths": ["s3://bucket/prefix"], "format": ["stac"]}),
        ("kernels", {"paths": ["a", "s3://bucket/prefix"]}),
        *(
            (command, {"store": "s3://bucket/prefix"})
            for command in ("report", "photometry", "mosaic", "control", "improve-map", "adjust")
        ),
    ],
)
def test_a_flow_takes_what_the_model_takes(command: str, given: dict[str, Any]) -> None:
    from prefect.exceptions import ParameterTypeError

    with pytest.raises((ParameterTypeError, TypeError)):
        flow_of(command).validate_parameters(given)


def test_texts_of_the_command_line_mean_the_same_in_a_deployment() -> None:
    by_text = flow_of("correct").validate_parameters({"files": ["a"], "hold": "range, roll", "start_offset_px": "-1,2"})
    assert (by_text["hold"], by_text["start_offset_px"]) == (("range", "roll"), (-1.0, 2.0))
    by_values = {"files": ["a"], "hold": ["range", "roll"], "start_offset_px": [-1, 2]}
    assert flow_of("correct").validate_parameters(by_values) == by_text
