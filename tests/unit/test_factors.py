"""Factors of the stiffness of contact points, of a band and by fronts: they solve with its matrix."""

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st
from structures import box

import solver
from blockvis import generators
from solver import mechanics


def rows_of(assembly, *, with_places=True):
    pose = solver.Pose.initial(assembly)
    contacts = mechanics.find_contacts(assembly, assembly.vertices, 1e-4)
    matrix = mechanics.wrench_matrix(contacts, pose, 1.0)
    return mechanics.ContactRows(matrix, assembly.free, assembly.centroids if with_places else None)


def error_of(rows, seed):
    """Of what is solved with random stiffnesses and a random diagonal, as a part of the right-hand side."""
    random = np.random.default_rng(seed)
    n, d = rows.blocks.shape[:2]
    roots = random.normal(size=(n, d, d))
    stiffness = np.matmul(roots, roots.transpose(0, 2, 1))
    diagonal, right = random.uniform(0.5, 2.0, rows.n_dof), random.normal(size=rows.n_dof)
    x = rows.factorised(stiffness, diagonal)(right)
    acts = sp.csr_array(rows.matrix)[:, : rows.n_dof]
    back = acts.T @ (sp.block_diag(list(stiffness)) @ (acts @ x)) + diagonal * x
    return np.abs(back - right).max() / np.abs(right).max()


@settings(max_examples=8, deadline=None)
@given(bricks=st.integers(2, 9), courses=st.integers(1, 6), seed=st.integers(0, 2**31))
def test_of_small_walls(bricks, courses, seed):
    assert error_of(rows_of(generators.wall(bricks=bricks, courses=courses)), seed) < 1e-10


@pytest.mark.parametrize("with_places", [True, pytest.param(False, marks=pytest.mark.thorough)])
def test_of_a_dome_of_wide_rings(with_places):
    """A band of 480 rows and more: by fronts."""
    rows = rows_of(generators.dome(lunes=80, courses=4), with_places=with_places)
    assert error_of(rows, 1) < 1e-10


@pytest.mark.slow
def test_of_two_walls_that_stand_apart():
    """The first cut is of no block."""
    cubes = [
        box((i, j + 100 * k, h), (i + 1, j + 100 * k + 1, h + 1))
        for k in (0, 1)
        for i in range(12)
        for j in range(12)
        for h in range(4)
    ]
    assert error_of(rows_of(solver.Assembly.from_solids(cubes)), 2) < 1e-10


def test_what_is_not_positive_is_no_stiffness():
    rows = rows_of(generators.dome(lunes=80, courses=4))
    stiffness = np.broadcast_to(-np.eye(3), (len(rows.blocks), 3, 3))
    with pytest.raises(mechanics.NotSolved, match="is not positive"):
        rows.factorised(stiffness, np.zeros(rows.n_dof))
