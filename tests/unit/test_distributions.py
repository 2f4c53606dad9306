"""Distributions: quantiles against scipy's, bad numbers refused by name."""

import numpy as np
import pytest
import scipy.stats as st
import tomli_w
from structures import case_from

P = np.array([1e-6, 0.01, 0.2, 0.5, 0.77, 0.999])
SIGMA = np.sqrt(np.log1p(0.25))


def distribution(table):
    """The distribution of how far corners are off, in a case."""
    case = {
        "geometry": {"layout": "arch"},
        "settlement": {"direction": [1, 0]},
        "imperfections": {"kind": "vertices", **table},
    }
    return case_from(tomli_w.dumps(case)).imperfections[0].distribution


@pytest.mark.parametrize(
    ("table", "reference"),
    [
        ({"distribution": "uniform", "lower": -1, "upper": 3}, st.uniform(-1, 4)),
        ({"distribution": "loguniform", "lower": 0.1, "upper": 10}, st.loguniform(0.1, 10)),
        ({"distribution": "triangular", "lower": 1, "mode": 2, "upper": 5}, st.triang(0.25, 1, 4)),
        ({"distribution": "normal", "mean": 0.6, "deviation": 0.1}, st.norm(0.6, 0.1)),
        (
            {"distribution": "normal", "mean": 0.6, "deviation": 0.2, "lower": 0.5, "upper": 0.9},
            st.truncnorm(-0.5, 1.5, 0.6, 0.2),
        ),
        (
            {"distribution": "lognormal", "mean": 2.0, "deviation": 1.0},
            st.lognorm(SIGMA, scale=2.0 * np.exp(-(SIGMA**2) / 2)),
        ),
        ({"distribution": "beta", "alpha": 2, "beta": 5, "lower": 1, "upper": 3}, st.beta(2, 5, 1, 2)),
    ],
)
def test_quantiles_are_those_of_scipy(table, reference):
    found = distribution(table).quantile(P)
    np.testing.assert_allclose(found, reference.ppf(P), rtol=1e-9)


def test_mean_and_deviation_of_a_lognormal_are_its_own():
    p = (np.arange(200_000) + 0.5) / 200_000
    values = distribution({"distribution": "lognormal", "mean": 2.0, "deviation": 0.3}).quantile(p)
    assert values.mean() == pytest.approx(2.0, rel=1e-4)
    assert values.std() == pytest.approx(0.3, rel=1e-3)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ({"distribution": "nromal", "mean": 0, "deviation": 1}, ("nromal", "did you mean 'normal'")),
        ({"mean": 0}, ("distribution is missing", "uniform")),
        ({"distribution": "normal", "mean": 0.6}, ("deviation is missing",)),
        ({"distribution": "normal", "mean": 0.6, "deviation": 0.0}, ("deviation is 0", "above 0")),
        ({"distribution": "normal", "mean": "x", "deviation": 1}, ("mean is 'x'", "number")),
        ({"distribution": "normal", "mean": 0.6, "devation": 1}, ("did you mean 'deviation'",)),
        ({"distribution": "uniform", "lower": 2, "upper": 1}, ("lower is 2 and upper is 1",)),
        ({"distribution": "triangular", "lower": 0, "mode": 3, "upper": 1}, ("mode is 3", "between 0 and 1")),
        ({"distribution": "loguniform", "lower": 0, "upper": 1}, ("lower is 0", "above 0")),
        ({"distribution": "lognormal", "mean": -1, "deviation": 1}, ("mean is -1",)),
        ({"distribution": "beta", "alpha": 0, "beta": 1, "lower": 0, "upper": 1}, ("alpha is 0",)),
        ({"distribution": "normal", "mean": 0, "deviation": 1, "lower": 9, "upper": 10}, ("nothing lies between",)),
    ],
)
def test_impossible_distributions_are_refused(table, words):
    with pytest.raises(ValueError) as error:
        distribution(table)
    for word in ("[imperfections", *words):
        assert word in str(error.value)
