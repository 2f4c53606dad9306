"""The order of the tolerances: what must be finer than what, and that no other module has its own."""

import ast
from itertools import pairwise
from pathlib import Path

import pytest

import solver
from solver import tolerances as t

#: Each row from the finest to the coarsest, in one measure.
ORDERS = {
    "programs": (t.FEASIBILITY_TOLERANCE, t.AT_LIMIT, t.INTERIOR_TOLERANCE, t.ACCEPTED_ERROR),
    "balance": (t.FEASIBILITY_TOLERANCE, t.BALANCE_TOLERANCE, t.FALLING_FRACTION, t.ACCEPTED_ERROR),
    "positions": (t.GEOMETRY_TOLERANCE, t.COMPUTED_GAP, t.CLOSED, t.JUMP, t.FARTHEST_FALL),
    "joints": (t.COMPLIANCE, t.COMPUTED_GAP, t.SHEAR_COMPLIANCE, t.CLOSING_GAP, t.CLOSED),
    "memories": (t.SHEAR_COMPLIANCE, t.FRICTION_MEMORY, t.VELOCITY_MEMORY),
    "path": (t.FALLING_FRACTION, t.IMPERFECTION, t.VISCOSITY),
    "drawings": (t.DRAWN_GAP, t.OVERLAP, t.PENETRATION_FRACTION),
    "corners": (t.FEASIBILITY_TOLERANCE, t.CORNER_TOLERANCE),
    "forces": (t.SMALLEST_FORCE, t.CARRYING_FRACTION),
    "motions": (t.SMALLEST_RATE, t.NOTICEABLE),
}


@pytest.mark.parametrize("what", ORDERS)
def test_each_is_finer_than_the_next(what):
    order = ORDERS[what]
    assert all(fine < coarse for fine, coarse in pairwise(order)), order


def test_every_tolerance_stands_in_one_place_and_is_used():
    names = {name for name in vars(t) if name.isupper()}
    used, elsewhere = set(), {}
    for path in Path(solver.__file__).parent.rglob("*.py"):
        if path.name == "tolerances.py":
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        used |= {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)}
        used |= {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
        stored = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
        if stored & names:
            elsewhere[path.name] = stored & names
    assert elsewhere == {}
    assert names - used == set()
