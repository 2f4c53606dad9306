"""Tests use what users use: the names of `solver`, `solver.mechanics` and `blockvis`; those that do not are listed."""

import ast
from pathlib import Path

from structures import imports_of

import blockvis
import solver
from solver import mechanics

TESTS = Path(__file__).parents[1]

#: Modules that are faces, with their names; of the generators and the command line all of them.
FACES = {
    "solver": {*solver.__all__, "mechanics"},
    "solver.mechanics": {*mechanics.__all__},
    "blockvis": {*blockvis.__all__, "generators", "cli", "pyvista_plugin"},
    "blockvis.generators": None,
    "blockvis.cli": None,
}

#: Files that look inside, each with how many names it takes from there, in scripts that it starts as well. None may
#: come to it and no number may grow; a number that has become smaller is made smaller here.
WHITE_BOX = {
    "system/test_drawing.py": 6,
    "system/test_memory.py": 8,
    "system/test_path_range.py": 11,
    "system/test_report_use.py": 5,
    "system/test_results_in_space.py": 16,
    "system/test_step_check.py": 7,
    "system/test_study_campaign.py": 10,
    "unit/test_case_keys.py": 7,
    "unit/test_closed_joints.py": 11,
    "unit/test_crack_drawing.py": 9,
    "unit/test_dimensions.py": 12,
    "unit/test_explanation.py": 20,
    "unit/test_fall.py": 9,
    "unit/test_films.py": 10,
    "unit/test_kinds.py": 7,
    "unit/test_labels.py": 12,
    "unit/test_marks.py": 12,
    "unit/test_observations.py": 1,
    "unit/test_programs.py": 18,
    "unit/test_refusal_pictures.py": 8,
    "unit/test_render.py": 10,
    "unit/test_studies.py": 18,
    "unit/test_ties.py": 5,
    "unit/test_tolerances.py": 1,
    "unit/test_written_files.py": 12,
}


def _inner(file: Path) -> list[str]:
    """Names that a file imports from modules that are no faces."""
    found = []
    for node in imports_of(file):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in ("solver", "blockvis"):
            names = FACES.get(node.module, set())
            found += [
                f"{node.module}.{alias.name}" for alias in node.names if names is not None and alias.name not in names
            ]
        elif isinstance(node, ast.Import):
            roots = [alias.name for alias in node.names if alias.name.split(".")[0] in ("solver", "blockvis")]
            found += [name for name in roots if name not in FACES]
    return found


def test_what_looks_inside_is_listed():
    found = {str(file.relative_to(TESTS).as_posix()): _inner(file) for file in sorted(TESTS.rglob("*.py"))}
    more = {file: names for file, names in found.items() if len(names) > WHITE_BOX.get(file, 0)}
    assert not more, "import what the faces have, or set it up with what structures.py has"
    fewer = {file: len(found.get(file, ())) for file, number in WHITE_BOX.items() if len(found.get(file, ())) < number}
    assert not fewer, "write the smaller number into the list, or take the file off it"
