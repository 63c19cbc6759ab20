"""A command whose options are the fields of a model of `flows.options`; what only concerns the terminal (--json,
--quiet, --server) the command's own function adds."""

import inspect
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Union, get_args, get_origin

import typer
from annotated_types import Ge, Le
from pydantic import ValidationError
from pydantic.fields import FieldInfo

from catalog.errors import RefusedError, WrongOptionError
from flows.options import Cli, Options

Json = Annotated[bool, typer.Option("--json", help="One JSON object per line on stdout.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress on stderr.")]


def known_server(option: str | None) -> str | None:
    """The option as it is; what it and the environment come to must be a server, or it is wrong usage."""
    from catalog.loopback import is_address
    from local_server.prefect_settings import EMBEDDED, LOCAL, server_choice

    choice = server_choice(option)
    if choice not in (EMBEDDED, LOCAL) and not is_address(choice):
        fault = f"{choice!r} is neither {LOCAL}, {EMBEDDED} nor the URL of an API such as http://127.0.0.1:4200/api."
        raise typer.BadParameter(fault)
    return option


Server = Annotated[
    str | None, typer.Option(help="Prefect server: local, embedded, or the URL of its API.", callback=known_server)
]


def add_command(app: typer.Typer, model: type[Options], body: Callable[..., None], name: str = "") -> None:
    """Add a command to `app` that is called like `body` and explained by `model`. body: gets the options, a `model`,
    and as keywords what it has beside them."""
    own = list(inspect.signature(body).parameters.values())[1:]
    fields = sorted(model.model_fields.items(), key=lambda item: not cli_of(item[1]).argument)
    parameters = [as_parameter(name, field) for name, field in fields] + [
        each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in own
    ]

    def command(**given: Any) -> None:
        chosen = {name: given.pop(name) for name in model.model_fields}
        body(options_of(model, {name: value for name, value in chosen.items() if value is not None}), **given)

    command.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {each.name: each.annotation for each in parameters}
    app.command(name or body.__name__, help=model.__doc__)(command)


@contextmanager
def wrong_usage(option: str | None = None) -> Iterator[None]:
    """An option's value that is not taken within the `with` block is wrong usage; so is whatever is refused there, when
    `option` is named."""
    try:
        yield
    except WrongOptionError as error:
        raise typer.BadParameter(str(error), param_hint=f"--{error.option}") from error
    except RefusedError as error:
        if option is None:
            raise
        raise typer.BadParameter(str(error), param_hint=option) from error


def refuse_useless_kernels(paths: Sequence[Path] | None) -> None:
    """What holds no kernel is wrong usage."""
    if not paths:
        return
    from catalog.regular_file import is_folder, is_regular
    from catalog.spice import refuse_what_holds_no_kernel

    with wrong_usage("--kernels"):
        refuse_what_holds_no_kernel(path for path in paths if is_regular(path) or is_folder(path))


def options_of(model: type[Options], given: dict[str, Any]) -> Options:
    """The options; what a model does not take is wrong usage, with the option's name."""
    try:
        return model(**given)
    except ValidationError as error:
        fault = error.errors()[0]
        name = str(fault["loc"][0]) if fault["loc"] else None
        hint = spelled(name, model.model_fields[name])[0] if name in model.model_fields else None
        raise typer.BadParameter(fault["msg"].removeprefix("Value error, "), param_hint=hint) from error


def cli_of(field: FieldInfo) -> Cli:
    """How the command line spells a field."""
    return next((each for each in field.metadata if isinstance(each, Cli)), Cli())


def spelled(name: str, field: FieldInfo) -> tuple[str, ...]:
    """Names of a field's option; that of an argument is in capitals."""
    cli = cli_of(field)
    if cli.argument:
        return (name.upper(),)
    usual = f"--{name.replace('_', '-')}"
    return cli.names or ((f"{usual}/--no-{usual[2:]}" if field.default is True else usual),)


def as_parameter(name: str, field: FieldInfo) -> inspect.Parameter:
    """A field as a parameter that typer reads."""
    cli, (kind, may_be_none) = cli_of(field), kind_of(field)
    bounds = {"min": bound_of(field, Ge, "ge"), "max": bound_of(field, Le, "le")} if kind in (int, float) else {}
    if cli.argument:
        folder: Any = {"exists": True, "file_okay": False} if cli.folder else {}
        info: Any = typer.Argument(help=field.description, show_default=False, **folder)
    else:
        info = typer.Option(*spelled(name, field), help=field.description, metavar=cli.metavar, **bounds)
    default = inspect.Parameter.empty if field.is_required() else field.default
    if may_be_none:
        kind, default = kind | None, None if not field.is_required() else default
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=Annotated[kind, info])


def kind_of(field: FieldInfo) -> tuple[Any, bool]:
    """What typer makes of a field's text, and whether the command line leaves it out as None."""
    if cli_of(field).text:
        return str, True
    kind = field.annotation
    may_be_none = get_origin(kind) in (Union, UnionType)
    if may_be_none:
        kind = next(each for each in get_args(kind) if each is not NoneType)
    kind = plain(kind)
    if get_origin(kind) is tuple:
        parts = [plain(part) for part in get_args(kind)]
        if parts[-1] is Ellipsis:
            return list[parts[0]], not field.is_required()  # type: ignore[valid-type]
        return tuple[tuple(parts)], may_be_none  # type: ignore[misc]
    return kind, may_be_none


def plain(kind: Any) -> Any:
    """A type without what is annotated to it."""
    return get_args(kind)[0] if get_origin(kind) is Annotated else kind


def bound_of(field: FieldInfo, kind: type, name: str) -> Any:
    """A field's lower or upper bound, None where it has none."""
    return next((getattr(each, name) for each in field.metadata if isinstance(each, kind)), None)
