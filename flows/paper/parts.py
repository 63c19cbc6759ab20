"""The parts of the report, in its order. Each is a module of this package with a function of one Context."""

from importlib import import_module

from flows.paper.section import Part

PARTS: dict[str, str] = {
    "table1": "flows.paper.table1",
    "reseau": "flows.paper.reseau",
    "table2": "flows.paper.table2",
    "flow": "flows.paper.flow",
    "projection": "flows.paper.projection",
    "similarity": "flows.paper.similarity",
    "limb": "flows.paper.limb",
    "methods": "flows.paper.methods",
    "published": "flows.paper.published",
}


def part(name: str) -> Part:
    """The function that makes the part `name`; imported when it is wanted."""
    found: Part = getattr(import_module(PARTS[name]), name)
    return found
