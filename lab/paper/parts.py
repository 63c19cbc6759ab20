"""The parts of the report, in its order. Each is a module of this package with a function of one Context."""

from importlib import import_module

from lab.paper.section import Part

PARTS: dict[str, str] = {
    "table1": "lab.paper.table1",
    "reseau": "lab.paper.reseau",
    "table2": "lab.paper.table2",
    "flow": "lab.paper.flow",
    "projection": "lab.paper.projection",
    "similarity": "lab.paper.similarity",
    "limb": "lab.paper.limb",
    "methods": "lab.paper.methods",
    "published": "lab.paper.published",
}


def part(name: str) -> Part:
    """The function that makes the part `name`; imported when it is wanted."""
    found: Part = getattr(import_module(PARTS[name]), name)
    return found
