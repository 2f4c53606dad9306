"""The matrix of a step, block by block, and what solves with it, against one that is written out in full."""

import numpy as np
import pytest

from solver.program.factors import DENSE, Singular, coupling


def written_out(pairs, n_blocks, dof, each, diagonal):
    matrix = np.diag(diagonal)
    for (a, b), entries in zip(pairs, each, strict=True):
        rows = np.concatenate([a * dof + np.arange(dof), b * dof + np.arange(dof)])
        free = rows >= 0
        matrix[np.ix_(rows[free], rows[free])] += entries[np.ix_(free, free)]
    return matrix


@pytest.mark.parametrize("open_part", [0.0, 0.7], ids=["closed", "mostly open"])
@pytest.mark.parametrize(("n_blocks", "dof", "points"), [(5, 3, 14), (90, 3, 300), (60, 6, 300), (1, 6, 4)])
def test_what_solves_with_contact_points_is_that_of_the_whole_matrix(n_blocks, dof, points, open_part):
    random = np.random.default_rng(n_blocks)
    # Also points of a block on a support, which has no freedom.
    pairs = random.integers(-1, n_blocks, (points, 2))
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]
    each = random.normal(size=(len(pairs), 2 * dof, 2 * dof))
    each = each @ each.transpose(0, 2, 1) + 0.1 * random.normal(size=each.shape)
    diagonal, right = 1.0 + random.random(n_blocks * dof), random.normal(size=n_blocks * dof)
    found = coupling(pairs, n_blocks, dof)
    # First with open joints: what is left out then must be there again where they are closed.
    for part in (open_part, 0.0):
        values = each * (random.random(len(pairs)) >= part)[:, None, None]
        whole = written_out(np.where(pairs < 0, -2, pairs), n_blocks, dof, values, diagonal)
        solved = found.factorised(values, diagonal)(right)
        assert np.abs(whole @ solved - right).max() < 1e-9
    assert found.dense == (n_blocks * dof <= DENSE)
    assert coupling(pairs.copy(), n_blocks, dof) is found


@pytest.mark.parametrize("n_blocks", [3, 60], ids=["dense", "sparse"])
def test_nothing_on_the_diagonal_has_no_inverse(n_blocks):
    found = coupling(np.array([[0, 1]]), n_blocks, 3)
    with pytest.raises(Singular):
        found.factorised(np.zeros((1, 6, 6)), np.zeros(3 * n_blocks))
