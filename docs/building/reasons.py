"""Every reason that a result can have: collected from the sources, explained in reasons.toml."""

import ast
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

from building.markdown import code
from building.markdown import table as table_of

ROOT = Path(__file__).resolve().parents[2]
FLOORS = ("catalog", "tasks", "flows", "planetpose", "lab")
TEXTS = Path(__file__).parent / "reasons.toml"
STATUS = {"RefusedError": "refused", "FailedError": "failed", "NoMaximumError": "failed", "Diagnosis": "failed"}
# Codes that are put together when they are raised, by the expression that does it.
PUT_TOGETHER = {
    "f'{code}-missing'": (
        "image-missing",
        "pose-file-missing",
        "base-map-missing",
        "mask-missing",
        "reseau-table-missing",
    ),
    "f'{code}-unreadable'": ("image-unreadable", "pose-file-unreadable", "base-map-unreadable", "mask-unreadable"),
    "f'{code}-too-large'": ("image-too-large", "pose-file-too-large", "base-map-too-large", "mask-too-large"),
    "f'{what}-unknown'": ("format-unknown", "projection-unknown", "kernel-unknown"),
    "found.code": (),  # a Diagnosis
    "told['code']": (),  # a failure that is remembered
    "OTHER": ("another-body",),  # imported
    "worst": ("limb-outside", "limb-saturated", "limb-masked", "limb-missing", "limb-faint"),
    "cause.code": (),
    "error.code": (),  # the same error once more, with other words: explained where it was raised first
}
# A reason that is told without an error: a doubt, or what is no expected failure.
SAID = re.compile(r"([a-z]+(?:-[a-z]+)+|bug): ")
# Parsing all modules takes seconds.
WORTH_A_LOOK = re.compile(rf"Error\(|Diagnosis\(|type\(error\)|[\"']{SAID.pattern}")
NO_DOUBT = ("bug", "file-trouble", "outcome-lost")


def table(_: str = "") -> str:
    """All codes with status, meaning and remedy."""
    written, raised = explained(), collected()
    rows = []
    for name in sorted(written):
        status = ", ".join(sorted(raised.get(name, {written[name].get("status", "failed")})))
        rows.append((f"{code(name)}<br>{status}", written[name]["meaning"], written[name]["remedy"]))
    return table_of(("code, status", "what was found", "what to do"), rows)


def explained() -> dict[str, dict[str, str]]:
    """What reasons.toml says, by code."""
    return tomllib.loads(TEXTS.read_text(encoding="utf-8"))


def collected() -> dict[str, set[str]]:
    """Every code in the sources with the statuses that it comes with."""
    found: dict[str, set[str]] = {}
    for path in sources():
        for name, status in codes_in(path):
            found.setdefault(name, set()).add(status)
    return found


def sources() -> list[Path]:
    """All modules of the program."""
    return [path for floor in FLOORS for path in sorted((ROOT / floor).rglob("*.py"))]


def codes_in(path: Path) -> Iterator[tuple[str, str]]:
    """Code and status of every expected failure and every doubt in a module."""
    text = path.read_text(encoding="utf-8")
    if not WORTH_A_LOOK.search(text):
        return
    tree = ast.parse(text)
    constants = dict(text_constants(tree))
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and node.args and (status := status_of(node)):
            for name in names_of(node.args[0], constants):
                yield name, status
        if found := SAID.match(first_words(node)):
            yield found[1], "failed" if found[1] in NO_DOUBT else "doubtful"


def status_of(call: ast.Call) -> str | None:
    """The status that an error of this name has; None for other calls."""
    name = call.func.id if isinstance(call.func, ast.Name) else ""
    is_same_again = isinstance(call.func, ast.Call) and ast.unparse(call.func.func) == "type"
    return "failed" if is_same_again else STATUS.get(name)


def names_of(code_node: ast.expr, constants: dict[str, str]) -> tuple[str, ...]:
    """The codes that an error's first argument stands for. Raises KeyError for one that nobody explained."""
    if isinstance(code_node, ast.Constant):
        return (str(code_node.value),)
    if isinstance(code_node, ast.Name):
        return (constants[code_node.id],) if code_node.id in constants else PUT_TOGETHER[code_node.id]
    return PUT_TOGETHER[ast.unparse(code_node)]


def text_constants(tree: ast.Module) -> Iterator[tuple[str, str]]:
    """Names in capitals that stand for a text."""
    for node in tree.body:
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            for target in node.targets:
                if isinstance(target, ast.Name):
                    yield target.id, node.value.value


def first_words(node: ast.AST) -> str:
    """How a text begins, also one with values in it; empty for what is no text."""
    if isinstance(node, ast.JoinedStr) and node.values:
        return first_words(node.values[0])
    return node.value if isinstance(node, ast.Constant) and isinstance(node.value, str) else ""
