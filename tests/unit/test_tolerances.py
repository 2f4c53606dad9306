"""The order of the tolerances: what must be finer than what, and that no other module has its own."""

import ast
from itertools import pairwise
from pathlib import Path

import pytest

import solver
from solver import tolerances as t

#: Each row from the finest to the coarsest, in one measure.
ORDERS = {
    "programs": (t.FEASIBILITY_TOLERANCE, t.AT_LIMIT, t.INTERIOR_TOLERANCE, t.LEFT_WEDGED),
    "balance": (t.FEASIBILITY_TOLERANCE, t.BALANCE_TOLERANCE, t.FALLING_FRACTION, t.LIGHTEST, t.ACCEPTED_VIOLATION),
    "certificate": (t.INTERIOR_TOLERANCE, t.ACCEPTED_GAP),
    "light blocks": (t.BALANCE_TOLERANCE, t.ROUNDED_OFF, t.LIGHT_BALANCE),
    "positions": (
        t.COORDINATE_ROUNDING,
        t.ROUNDING,
        t.GEOMETRY_TOLERANCE,
        t.GIVE_ACROSS,
        t.PENETRATION_LEFT,
        t.COMPUTED_GAP,
        t.STILL,
        t.CLOSED,
        t.JUMP,
        t.FARTHEST_FALL,
    ),
    "joints": (t.GIVE_ACROSS, t.COMPUTED_GAP, t.GIVE, t.CLOSED),
    "path": (t.FALLING_FRACTION, t.IMPERFECTION, t.DRAG),
    "drawings": (t.DRAWN_GAP, t.OVERLAP, t.PENETRATION_FRACTION),
    "corners": (t.ROUNDING, t.CORNER_TOLERANCE, t.LARGEST_DRIFT),
    "forces": (t.SMALLEST_FORCE, t.CARRYING_FRACTION, t.HOLDS),
    "motions": (t.SMALLEST_RATE, t.TOGETHER, t.NOTICEABLE),
}


@pytest.mark.parametrize("what", ORDERS)
def test_each_is_finer_than_the_next(what):
    order = ORDERS[what]
    assert all(fine < coarse for fine, coarse in pairwise(order)), order


def test_what_a_closed_pose_has_left_is_closed_for_a_limit_load():
    """Ten times the penetration of a small model is left in a large one, whose blocks are alike in size."""
    assert t.PENETRATION_LEFT < t.COMPUTED_GAP < 10.0 * t.PENETRATION_LEFT < t.STILL


def test_every_tolerance_stands_in_one_place_and_is_used():
    names = {name for name in vars(t) if name.isupper()}
    used, elsewhere = set(), {}
    for path in Path(solver.__file__).parent.rglob("*.py"):
        if path.name == "tolerances.py":
            continue
        tree = ast.parse(path.read_text(encoding="utf-8"))
        used |= {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load)}
        stored = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)}
        if stored & names:
            elsewhere[path.name] = stored & names
    assert elsewhere == {}
    assert names - used == set()
