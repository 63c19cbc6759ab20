"""What counts of a module's source text: its syntax tree without what does not change what it computes."""

import ast
import hashlib
from dataclasses import dataclass
from typing import Any

Import = tuple[str, str]
LOGGERS = ("logger", "log", "logging", "warnings")


@dataclass(frozen=True)
class ModuleSource:
    """digest: hex, of the normalised syntax tree. imports: (module, member) of each `from module import member`, the
    member empty for `import module`."""

    digest: str
    imports: tuple[Import, ...]

    def to_json(self) -> list[Any]:
        """Plain JSON."""
        return [self.digest, [list(each) for each in self.imports]]

    @classmethod
    def from_json(cls, content: Any) -> "ModuleSource":
        """What `to_json` made. Raises TypeError, ValueError or LookupError for anything else."""
        digest, imports = content
        return cls(str(digest), tuple((str(module), str(member)) for module, member in imports))


def read_source(content: bytes, package: str) -> ModuleSource:
    """The source of a module in `package`. Raises SyntaxError when it is no Python."""
    tree = ast.parse(content)
    tree.body = [statement for statement in tree.body if not _is_for_type_checking(statement)]
    imports = tuple(dict.fromkeys(each for node in ast.walk(tree) for each in _imports(node, package)))
    normalised = _Normaliser().visit(tree)
    text = ast.dump(normalised, annotate_fields=False, include_attributes=False)
    return ModuleSource(hashlib.sha256(text.encode()).hexdigest()[:32], imports)


def _is_for_type_checking(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.If) and _last_name(statement.test) == "TYPE_CHECKING"


def _imports(node: ast.AST, package: str) -> list[Import]:
    if isinstance(node, ast.Import):
        return [(alias.name, "") for alias in node.names]
    if isinstance(node, ast.ImportFrom):
        above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
        module = ".".join([*above, *([node.module] if node.module else [])])
        return [(module, alias.name) for alias in node.names]
    return []


class _Normaliser(ast.NodeTransformer):
    """Takes out bare texts (docstrings), descriptions of fields, and the wording of errors and log lines: texts in the
    arguments of what is named ...Error, ...Exception or ...Warning or is a logger's (but the first of several, an
    error's code), and those of local variables that only such arguments use."""

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        """A bare text is a docstring."""
        if _is_text(node.value):
            return ast.Pass()
        return self.generic_visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        """The wording that a local variable holds for an error."""
        for name in _names_for_messages(node):
            for assignment in ast.walk(node):
                if isinstance(assignment, ast.Assign) and [_last_name(each) for each in assignment.targets] == [name]:
                    assignment.value = _Wording().visit(assignment.value)
        return self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """The wording that is given to an error or a logger."""
        if _takes_message(node):
            with_code = len(node.args) > 1 and _is_error(node)  # RefusedError("code", fault, remedy)
            coded = node.args[:1] if with_code else []
            node.args = coded + [_Wording().visit(each) for each in node.args[len(coded) :]]
            for keyword in node.keywords:
                keyword.value = _Wording().visit(keyword.value)
        node.keywords = [each for each in node.keywords if each.arg != "description" or not _is_text(each.value)]
        return self.generic_visit(node)


class _Wording(ast.NodeTransformer):
    """Empties texts and the fixed parts of f-strings."""

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        """A text."""
        return ast.Constant("") if isinstance(node.value, str) else node

    def visit_JoinedStr(self, node: ast.JoinedStr) -> ast.AST:
        """An f-string: what it shows stays, in its order."""
        self.generic_visit(node)
        shown = [part.value for part in node.values if isinstance(part, ast.FormattedValue)]
        return ast.Tuple(shown, ast.Load())


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def _is_error(call: ast.Call) -> bool:
    return _last_name(call.func).endswith(("Error", "Exception", "Warning"))


def _takes_message(call: ast.Call) -> bool:
    by_logger = isinstance(call.func, ast.Attribute) and _last_name(call.func.value) in LOGGERS
    return by_logger or _is_error(call)


def _names_for_messages(function: ast.FunctionDef) -> set[str]:
    """Local variables that are used in arguments of errors and loggers, and nowhere else."""
    inside = [node for call in ast.walk(function) if isinstance(call, ast.Call) and _takes_message(call)
              for argument in (*call.args, *(keyword.value for keyword in call.keywords))
              for node in ast.walk(argument)]  # fmt: skip
    known = {id(node) for node in inside}
    loaded = [node for node in ast.walk(function) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)]
    return {node.id for node in loaded if id(node) in known} - {node.id for node in loaded if id(node) not in known}


def _last_name(node: ast.AST) -> str:
    """`name` of `name` and of `package.name`; empty for anything else."""
    return node.id if isinstance(node, ast.Name) else node.attr if isinstance(node, ast.Attribute) else ""
