"""Factors of the model's constants that a path is given: compliance of the joints, imperfection."""

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
    driver = SimpleNamespace(lever=arch.block_size, rate=lambda s: to_the_right)
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


@pytest.mark.parametrize(
    ("factors", "words"),
    [
        ({"compliance_factor": 0.0}, "compliance_factor is 0; it is a number above 0, by default 1"),
        ({"compliance_factor": float("inf")}, "compliance_factor is inf; it is a number above 0"),
        ({"imperfection_factor": -1.0}, "imperfection_factor is -1; it is a number of at least 0, by default 1"),
        ({"imperfection_factor": float("nan")}, "imperfection_factor is nan; it is a number of at least 0"),
    ],
)
def test_a_factor_that_is_none_is_refused(factors, words):
    with pytest.raises(ValueError) as error:
        solver.Controls(**factors)
    assert str(error.value).startswith(words)
