"""What the joint step decides by stands in one settings model, each with unit and source; its functions are given one
problem instead of its parts."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest
from pydantic import BaseModel

from tasks.joint import JointSettings
from tasks.joint.settings import TileSettings
from tasks.joint.thresholds import Thresholds

FOLDER = Path(__file__).resolve().parents[2] / "tasks" / "joint"
MODULES = sorted(FOLDER.glob("*.py"))
# Numbers that are no thresholds: how many unknowns there are, and how finely numerics work.
NUMERICS = {
    "tiles.py": {"GAINS", "LOCAL"},
    "tile_prior.py": {"HELD"},
    "parameters.py": {"OFFSET", "RANGE", "ROLL", "ATTITUDE", "PSF"},
    "limb_observation.py": {"OBSERVED"},
    "gauss_newton.py": {"SHARES", "FIXED"},
    "derivatives.py": {"PSF_STEP", "TRAIL_STEP_PX"},
    "elimination.py": {"BLOCK", "LEAST", "ONE"},
    "relief_response.py": {"ARCS", "RING_DEG", "SECTORS", "FIRST", "MOST_EMISSION_DEG"},
    "outline.py": {"SAMPLES", "LIMB_POINTS", "DIRECTIONS"},
    "contradiction.py": {"MOST"},
    "linearity.py": {"FREE", "EDGE_WIDTH"},
    "beam_bending.py": {"FREE"},
    "shape.py": {"SHEAR"},
    "normal_equations.py": {"UNSEEN"},
    "displaced_markings.py": {"UNSEEN", "SEEN", "HELD"},
    "variance_model.py": {"MEDIAN_CHI2"},
    "uncertainty.py": {"INDEPENDENT_LIMBS"},
}


def numeric_constants(path: Path) -> Iterator[str]:
    """Names that a module gives to numbers."""
    for node in ast.parse(path.read_text()).body:
        if isinstance(node, ast.Assign) and any(
            isinstance(part, ast.Constant) and type(part.value) in (int, float) for part in ast.walk(node.value)
        ):
            for target in node.targets:
                yield from (name.id for name in ast.walk(target) if isinstance(name, ast.Name))


@pytest.mark.parametrize("path", MODULES, ids=lambda path: path.name)
def test_a_module_has_no_threshold_of_its_own(path: Path) -> None:
    assert set(numeric_constants(path)) == NUMERICS.get(path.name, set())


def fields_of(model: type[BaseModel]) -> Iterator[tuple[str, str]]:
    for name, field in model.model_fields.items():
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            yield from fields_of(inner)
        else:
            yield f"{model.__name__}.{name}", field.description or ""


def test_every_threshold_says_what_it_is_and_where_it_is_from() -> None:
    described = dict(fields_of(Thresholds))
    assert len(described) > 60
    sources = ("Choice", "measured", "simulated images", "scenes", "sigma", "%", "shortest", "images", "0.03 at")
    assert [
        name for name, text in described.items() if not (text.endswith(".") and any(s in text for s in sources))
    ] == []
    own = ("fewest", "smallest", "heavy_tail", "chance", "seen")
    assert all(TileSettings.model_fields[name].description for name in own)


def test_a_profile_can_set_each_and_not_misspell_one() -> None:
    changed = JointSettings.model_validate({"thresholds": {"iteration": {"stale_px": 0.9}}})
    assert changed.thresholds.iteration.stale_px == 0.9
    with pytest.raises(ValueError, match="stale"):
        JointSettings.model_validate({"thresholds": {"iteration": {"stale": 0.9}}})
    with pytest.raises(ValueError, match="greater than 0"):
        JointSettings.model_validate({"thresholds": {"variance": {"dusk": 0.0}}})


def test_few_functions_have_more_than_six_parameters() -> None:
    many = {
        f"{path.name}: {node.name}"
        for path in MODULES
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.FunctionDef)
        and len([a for a in (*node.args.args, *node.args.kwonlyargs) if a.arg not in ("self", "cls")]) > 6
    }
    compiled = {"surface.py: _trace", "elimination.py: _eliminate", "elimination.py: _evaluate"}
    assert many <= {"find_pose.py: find_pose_jointly"} | compiled


def test_every_module_of_the_joint_step_is_tried_by_a_test() -> None:
    """A test imports from it by name, or has its name; `find_pose` is what the folder itself offers."""
    files = list((FOLDER.parents[1] / "tests").rglob("test_*.py"))
    named, text = {path.stem for path in files}, "".join(path.read_text() for path in files)
    untried = [
        path.name
        for path in MODULES
        if f"tasks.joint.{path.stem} import" not in text and f"test_joint_{path.stem}" not in named
    ]
    assert untried == ["__init__.py", "find_pose.py"]
    assert "tasks.joint import JointSettings, find_pose_jointly" in text
