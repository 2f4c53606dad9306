"""The import graph: which module may know which, lazy imports inside functions included."""

import ast
import subprocess
import sys
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest
from structures import imports_of

import blockvis
import solver

ROOT = Path(__file__).parents[2]

#: The rooms of both packages, highest first, each named once: a room imports itself and rooms below it. The kinds of
#: analysis read their own keys of a case file and lie below its reader; a run draws what came out and lies above the
#: pictures and the report.
ORDER = (
    "blockvis.__main__",
    "blockvis.cli",
    "blockvis.explanation",
    "blockvis.comparison",
    "blockvis.studies",
    "blockvis.runs",
    "blockvis.views",
    "blockvis.report",
    "blockvis.pyvista_plugin",
    "blockvis.pictures",
    "blockvis.case_files",
    "blockvis.kinds",
    "blockvis.results",
    "blockvis.dynamics",
    "blockvis.cases",
    "blockvis.generators",
    "blockvis.formats",
    "blockvis.layout",
    "blockvis.text",
    "blockvis.system",
    "solver.mechanics",
    "solver.structure",
    "solver.analysis",
    "solver.paper_method",
    "solver.path",
    "solver.program",
    "solver.contact_step",
    "solver.programs",
    "solver.results",
    "solver.surface_loads",
    "solver.phases",
    "solver.loads",
    "solver.backfill",
    "solver.ties",
    "solver.equilibrium",
    "solver.kinematics",
    "solver.interfaces",
    "solver.assembly",
    "solver.geometry",
    "solver.views",
    "solver.ordering",
    "solver.tolerances",
    "solver.words",
)

#: Beyond the order: rooms that must not know each other although one lies above the other.
APART = (
    ("blockvis.results", "blockvis.cases"),
    ("blockvis.results", "blockvis.formats"),
    ("blockvis.results", "blockvis.generators"),
    ("blockvis.pictures", "blockvis.cases"),
    ("blockvis.pictures", "blockvis.case_files"),
    ("blockvis.pictures", "blockvis.kinds"),
    ("blockvis.pictures", "blockvis.formats"),
    ("blockvis.pictures", "blockvis.runs"),
    ("blockvis.report", "blockvis.cases"),
    ("solver.programs", "solver.results"),
    ("solver.programs", "solver.assembly"),
    ("solver.contact_step", "solver.assembly"),
    ("solver.contact_step", "solver.kinematics"),
    ("solver.contact_step", "solver.programs"),
)


def _name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


FILES = {_name(path): path for top in ("solver", "blockvis") for path in sorted((ROOT / top).rglob("*.py"))}


@cache
def _imported(module: str) -> set[str]:
    """Modules of the two packages, and other packages, that a module imports anywhere."""
    path, found = FILES[module], set()
    package = module if path.name == "__init__.py" else module.rpartition(".")[0]
    for node in imports_of(path):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - (node.level - 1)] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            found |= {f"{base}.{a.name}" if f"{base}.{a.name}" in FILES else base for a in node.names}
    return found - {module}


#: The public faces say where things live and import them when they are asked for: they are no part of the graph.
FACES = {"blockvis": blockvis, "solver": solver}


@cache
def _graph() -> dict[str, set[str]]:
    """The modules that each one imports, in the two packages without their faces."""
    graph = {module: _imported(module) & set(FILES) - set(FACES) for module in set(FILES) - set(FACES)}
    # Readers and writers are imported by the names that the table of formats has.
    read = "blockvis.formats.read"
    graph[read] |= {module for module in FILES if module.startswith("blockvis.formats.")} - {read}
    return graph


def _room(module: str) -> str:
    return max((room for room in ORDER if f"{module}.".startswith(f"{room}.")), key=len)


def _circle(graph: dict[str, set[str]]) -> list[str]:
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1])
    return []


def test_no_modules_import_each_other_in_a_circle():
    assert _circle(_graph()) == []


def test_no_rooms_import_each_other_in_a_circle():
    rooms: dict[str, set[str]] = {}
    for module, others in _graph().items():
        rooms.setdefault(_room(module), set()).update({_room(other) for other in others} - {_room(module)})
    assert _circle(rooms) == []


@pytest.mark.parametrize("room", ORDER)
def test_a_room_imports_only_rooms_below_it(room):
    modules = [module for module in _graph() if _room(module) == room]
    assert modules, f"{room} is no room"
    allowed = ORDER[ORDER.index(room) :]
    wrong = [(module, other) for module in modules for other in _graph()[module] if _room(other) not in allowed]
    assert wrong == []


@pytest.mark.parametrize(("room", "other"), APART)
def test_rooms_that_must_not_know_each_other(room, other):
    links = [
        (module, to)
        for module in _graph()
        if module.startswith(room)
        for to in _graph()[module]
        if to.startswith(other)
    ]
    assert links == []


@pytest.mark.parametrize(("package", "user"), [("highspy", "highs"), ("clarabel", "clarabel")])
def test_one_module_imports_each_solver(package, user):
    users = [module for module in FILES if any(name.split(".")[0] == package for name in _imported(module))]
    assert users == [f"solver.programs.{user}"]


def test_solver_never_imports_blockvis_and_blockvis_takes_public_names_of_solver():
    for module in FILES:
        names = _imported(module)
        if module.startswith("solver"):
            assert not [name for name in names if name.startswith("blockvis") or name == "solver"], module
        else:
            assert not {name for name in names if name.startswith("solver.")} - {"solver.mechanics"}, module


def test_solver_imports_nothing_but_its_own_and_six_libraries():
    allowed = {"numpy", "scipy", "highspy", "clarabel", "manifold3d", "threadpoolctl", "solver"}
    for module in FILES:
        if module.startswith("solver"):
            used = {name.split(".")[0] for name in _imported(module)}
            assert used <= allowed | sys.stdlib_module_names, module


@pytest.mark.parametrize("face", FACES)
def test_type_checkers_see_every_public_name_where_it_lives(face):
    seen = {}
    for node in ast.parse(FILES[face].read_text(encoding="utf-8")).body:
        if isinstance(node, ast.If):
            seen |= {alias.asname: part.module for part in ast.walk(node) if isinstance(part, ast.ImportFrom)
                     for alias in part.names}  # fmt: skip
    assert seen == FACES[face]._HOMES


def test_the_faces_import_no_package_that_takes_long():
    """Of what is loaded, not of seconds: those of a name are paid when it is used first."""
    code = "import sys; before = set(sys.modules); import solver, blockvis; print(*sorted(set(sys.modules) - before))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT).stdout
    assert {"solver", "blockvis"} <= set(loaded.split())
    assert {name.split(".")[0] for name in loaded.split()} <= {"solver", "blockvis", *sys.stdlib_module_names}
