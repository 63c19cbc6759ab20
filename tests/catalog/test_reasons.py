"""Every reason of the sources is in the enumeration, with a meaning and a remedy; nothing in it is left over."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from catalog.errors import FailedError, RefusedError
from catalog.reasons import TEXTS, Reason, reason_texts

ROOT = Path(__file__).resolve().parents[2]
SOURCES = [
    path
    for floor in ("catalog", "tasks", "local_server", "flows", "planetpose", "viewer", "lab")
    for path in (ROOT / floor).rglob("*.py")
]
ERRORS = {"RefusedError", "FailedError", "NoMaximumError", "Diagnosis"}
# Codes that are put together when they are raised, by the expression that does it.
PUT_TOGETHER = {
    "f'{code}-missing'": "missing",
    "f'{code}-unreadable'": "unreadable",
    "f'{code}-too-large'": "too-large",
    "f'{what}-unknown'": "unknown",
}
# The same error once more, with other words, and one of a plugin or of a record.
PASSED_ON = {"found.code", "cause.code", "error.code", "worst"}
SAID = re.compile(r"([a-z]+(?:-[a-z]+)+): ")


def literals_in(path: Path) -> Iterator[str]:
    """Codes that a module raises, or begins a reason with, as text instead of a member of the enumeration."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        name = node.func.id if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) else ""
        if isinstance(node, ast.Call) and name in ERRORS and node.args:
            first = node.args[0]
            written = ast.unparse(first)
            if isinstance(first, ast.Constant):
                yield str(first.value)
            elif written in PUT_TOGETHER:
                yield from (reason for reason in Reason if reason.endswith(PUT_TOGETHER[written]))
            elif not written.startswith("Reason.") and written not in PASSED_ON and not written.isupper():
                yield written
        elif isinstance(node, ast.JoinedStr) and isinstance(node.values[0], ast.Constant):
            found = SAID.match(str(node.values[0].value))
            if found and (len(node.values) > 1 or found[1] in set(Reason)):
                yield found[1]


def members_in(path: Path) -> set[str]:
    return {Reason[name].value for name in re.findall(r"\bReason\.([A-Z0-9_]+)\b", path.read_text(encoding="utf-8"))}


def test_every_reason_has_a_status_a_meaning_and_a_remedy() -> None:
    texts = reason_texts()
    assert set(texts) == set(Reason)
    assert [reason for reason, text in texts.items() if not (text.meaning.endswith(".") and text.remedy)] == []
    assert {status for text in texts.values() for status in text.status} <= {"refused", "failed", "doubtful"}
    assert Reason.RANGE_CONFLICT.text.status == ("doubtful",)


def test_every_code_that_is_raised_is_one_of_them() -> None:
    unknown = {
        f"{path.relative_to(ROOT)}: {code}" for path in SOURCES for code in literals_in(path) if code not in set(Reason)
    }
    assert unknown == set()


def test_none_of_them_is_left_over() -> None:
    raised = {code for path in SOURCES for code in (*literals_in(path), *members_in(path))}
    written = {text for text in raised if text in set(Reason)}
    others = "".join(path.read_text(encoding="utf-8") for path in SOURCES if path.name != "reasons.py")
    assert [reason.value for reason in Reason if reason not in written and f'"{reason}' not in others] == []


def test_a_code_that_nobody_knows_would_be_found(tmp_path: Path) -> None:
    module = tmp_path / "module.py"
    module.write_text('raise RefusedError("never-heard", "x", "y")\nsaid = f"not-known: {1}"\n', encoding="utf-8")
    assert set(literals_in(module)) == {"never-heard", "not-known"}


@pytest.mark.parametrize("kind", [RefusedError, FailedError])
def test_an_errors_code_is_plain_text(kind: type[RefusedError]) -> None:
    """It goes into JSON, tables and other processes."""
    error = kind(Reason.MAP_SHAPE, "a fault.", "a remedy.")
    assert type(error.code) is str
    assert error.reason == "map-shape: a fault. a remedy."
    assert TEXTS.is_file()
