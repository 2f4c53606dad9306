"""Factors of the model's constants that a path is given: compliance of the joints, imperfection."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import solver
from blockvis.generators import build
from solver import mechanics


def stepper(**factors):
    arch = build("arch", {"voussoirs": 6})
    model = mechanics.model_of(arch, solver.self_weight(arch), solver.Interfaces(), solver.Controls(**factors))
    to_the_right = np.tile([1.0, 0.0, 0.0], (arch.n_blocks, 1))
    driver = SimpleNamespace(lever=lambda model: arch.block_size, rate=lambda s: to_the_right)
    return mechanics.Stepper(model, driver), solver.Pose.initial(arch)


def test_the_compliance_of_all_joints_is_multiplied():
    (plain, start), (soft, _) = stepper(), stepper(compliance_factor=3.0)
    contacts = plain.contacts(start)
    softer, stiffer = (one.joint_compliance(contacts, one.model.compliance) for one in (soft, plain))
    assert np.array_equal(softer, 3.0 * stiffer)
    assert np.array_equal(soft.imperfection, plain.imperfection)


@pytest.mark.parametrize("factor", [0.0, 2.0])
def test_the_imperfection_is_multiplied(factor):
    (plain, _), (other, _) = stepper(), stepper(imperfection_factor=factor)
    assert np.abs(plain.imperfection).max() > 0.0
    assert np.array_equal(other.imperfection, factor * plain.imperfection)


def test_motions_that_cancel_choose_no_direction():
    squares = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) + np.arange(3)[:, None, None]
    assembly = solver.Assembly.from_outlines(squares, roles=["moving", "moving", "free"])
    model = mechanics.model_of(assembly, solver.self_weight(assembly), solver.Interfaces(), solver.Controls())

    def largest(left, right):
        motions = np.array([[left, 0.0, 0.0], [right, 0.0, 0.0], [0.0, 0.0, 0.0]])
        return np.abs(
            mechanics.Stepper(model, SimpleNamespace(lever=lambda model: 1.0, rate=lambda s: motions)).imperfection
        ).max()

    assert largest(-1.0, 1.0 + 1e-15) < 1e-12 * largest(1.0, 1.0)


@pytest.mark.parametrize(
    ("factors", "words"),
    [
        ({"compliance_factor": 0.0}, "compliance_factor is 0; it is a number above 0, by default 1"),
        ({"compliance_factor": float("inf")}, "compliance_factor is inf; it is a number above 0"),
        ({"imperfection_factor": -1.0}, "imperfection_factor is -1; it is a number of at least 0, by default 1"),
        ({"imperfection_factor": float("nan")}, "imperfection_factor is nan; give a number"),
    ],
)
def test_a_factor_that_is_none_is_refused(factors, words):
    with pytest.raises(ValueError) as error:
        solver.Controls(**factors)
    assert str(error.value).startswith(words)


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("nearer", [0.0, 1e-4])
def test_a_contact_point_that_vanishes_hands_its_forces_to_the_one_whose_normal_it_has(swapped, nearer):
    one, start = stepper()
    before = one.contacts(start)[:3]
    # Where the first was there are two now, of other names: one with its normal, one turned by 0.4, as near or nearer.
    turn = np.array([[np.cos(0.4), np.sin(0.4)], [-np.sin(0.4), np.cos(0.4)]])
    points = [before.points[0] + nearer * one.model.length, before.points[0]]
    frames = np.stack([before.frames[0], before.frames[0] @ turn])
    blocks, sense = (before.block_a[[0, 0]], before.block_b[[0, 0]]), -1.0 if swapped else 1.0
    changed = replace(
        before[np.array([0, 0])],
        features=before.features[[0, 0]] + [[0, 0, 1000, 0], [0, 0, 1001, 0]],
        block_a=blocks[int(swapped)],
        block_b=blocks[1 - int(swapped)],
        points=np.array(points),
        frames=sense * frames,
    )
    now = mechanics.joined_contacts([before[1:], changed])
    forces = np.array([[5.0, 2.0], [1.0, 0.0], [1.0, 0.0]])
    place = mechanics.Place(0.0, start, before, forces, forces, forces[:, 0])
    handed, _, followed, is_new = one.transferred(place, now)
    assert handed == pytest.approx(np.array([[1.0, 0.0], [1.0, 0.0], [5.0, 2.0], [0.0, 0.0]]))
    assert followed == pytest.approx([1.0, 1.0, 5.0, 0.0])
    assert is_new.tolist() == [False, False, False, True]
