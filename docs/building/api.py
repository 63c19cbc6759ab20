"""The API reference: every module of a room with what it offers, read from the sources without importing them."""

import ast
import textwrap
from collections.abc import Iterator
from pathlib import Path

from building.settings import plain

ROOT = Path(__file__).resolve().parents[2]
WIDTH = 100
Definition = ast.FunctionDef | ast.ClassDef


def page_of(package: str) -> str:
    """A section per module of `package`, the package itself first; folders within it included."""
    return "\n".join(section(path) for path in modules_of(package))


def public_face(_: str = "") -> str:
    """Every name that `planetpose.PUBLIC` lists, in its order, as the module that defines it has it."""
    tree = ast.parse((ROOT / "planetpose" / "__init__.py").read_text(encoding="utf-8"))
    listed = next(node.value for node in tree.body if isinstance(node, ast.Assign) and _assigned(node) == "PUBLIC")
    return "\n".join(_defined(name, module) for name, module in ast.literal_eval(listed).items())


def _defined(name: str, module: str) -> str:
    tree = ast.parse(modules_of(module)[0].read_text(encoding="utf-8"))
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == name:
            return term(node)
        if isinstance(node, ast.Assign) and _assigned(node) == name:
            return f"`{ast.unparse(node)}`\n: A type, for annotations.\n"
    raise LookupError(f"{module} defines no {name}")


def _assigned(node: ast.Assign) -> str:
    return node.targets[0].id if isinstance(node.targets[0], ast.Name) else ""


def modules_of(package: str) -> list[Path]:
    """Files of the package and all modules in it, or of the one module. Raises FileNotFoundError when there is none."""
    place = ROOT.joinpath(*package.split("."))
    if place.is_dir():
        return sorted(place.rglob("*.py"), key=lambda path: (path.parent.parts, path.name != "__init__.py", path.name))
    return [place.with_suffix(".py")]


def section(path: Path) -> str:
    """One module: what it is for, its public functions and classes. Packages that offer nothing are left out."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    name = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    terms = [term(node) for node in public(tree.body)]
    if not terms and path.name == "__init__.py":
        return ""
    return "\n".join([f"## `{name}`\n", paragraphs(ast.get_docstring(tree)), *terms])


def public(body: list[ast.stmt]) -> Iterator[Definition]:
    """Functions and classes without a leading underscore."""
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            yield node


def term(node: Definition) -> str:
    """A definition with its docstring; a class with its fields and methods."""
    described = paragraphs(ast.get_docstring(node))
    if isinstance(node, ast.ClassDef):
        described += "".join(f"\n{term(method)}" for method in public(node.body) if isinstance(method, ast.FunctionDef))
    return f"`{signature(node)}`\n: {textwrap.indent(described, '  ').strip()}\n"


def signature(node: Definition) -> str:
    """How it is called, on one line."""
    if isinstance(node, ast.ClassDef):
        bases = ", ".join(ast.unparse(base) for base in node.bases)
        fields = ", ".join(fields_of(node))
        inside = fields or bases
        return f"class {node.name}({inside})" if inside else f"class {node.name}"
    kept = [arg for arg in node.args.args if arg.arg != "self"]
    arguments = ast.unparse(ast.arguments(**{**vars(node.args), "args": kept}))
    if any(isinstance(mark, ast.Name) and mark.id == "property" for mark in node.decorator_list):
        return f"{node.name}: {ast.unparse(node.returns) if node.returns else ''}"
    return f"{node.name}({arguments})" + (f" -> {ast.unparse(node.returns)}" if node.returns else "")


def fields_of(node: ast.ClassDef) -> Iterator[str]:
    """Annotated fields of a dataclass, a model or a named tuple."""
    for child in node.body:
        if isinstance(child, ast.AnnAssign) and isinstance(child.target, ast.Name) and child.target.id[0] != "_":
            default = f" = {ast.unparse(child.value)}" if child.value else ""
            yield f"{child.target.id}: {ast.unparse(child.annotation)}{default}"


def paragraphs(docstring: str | None) -> str:
    """A docstring as Markdown; indented paragraphs word for word."""
    parts = []
    for paragraph in (docstring or "").split("\n\n"):
        lines = paragraph.splitlines()
        if lines and all(line.startswith("  ") for line in lines):
            parts.append(f"```text\n{textwrap.dedent(paragraph)}\n```")
        else:
            parts.append(plain(" ".join(line.strip() for line in lines)))
    return "\n\n".join(parts) + "\n"
