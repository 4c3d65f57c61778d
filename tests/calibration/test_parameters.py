"""Parameters: ranges, priors, the unit cube; what is refused."""

import numpy as np
import pytest

from greybed.calibration import Parameter, Space
from greybed.core.errors import InputError


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({}, "has no range; give low and high"),
        ({"low": 0.1}, "has no range"),
        ({"low": 0.9, "high": 0.1}, "low = 0.9 must be below high = 0.1; exchange them"),
        ({"low": 0.0, "high": 1.0, "log": True}, "low = 0 must be above 0 where log = true"),
        ({"value": 1.0, "low": 0.0, "high": 2.0}, "has a value and a range"),
        ({"low": 0.0, "high": 1.0, "mean": 0.5}, "a prior has mean and sd"),
        ({"low": 0.0, "high": 1.0, "mean": 0.5, "sd": 0.0}, "sd = 0 of the prior must be above 0"),
        ({"low": 0.0, "high": 1.0, "mean": 2.0, "sd": 0.1}, "mean = 2 of the prior must be within"),
    ],
)
def test_refusals(given, said):
    with pytest.raises(InputError, match=said):
        Parameter(name="friction", **given)


def test_a_study_without_a_free_parameter_is_refused():
    with pytest.raises(InputError, match="no parameter is free"):
        Space([Parameter(name="a", value=1.0)])
    with pytest.raises(InputError, match="'a' is there twice"):
        Space([Parameter(name="a", low=0, high=1), Parameter(name="a", value=1.0)])


SPACE = Space(
    [
        Parameter(name="friction", low=0.1, high=0.9),
        Parameter(name="modulus", low=1e5, high=1e8, log=True),
        Parameter(name="restitution", low=0.0, high=1.0, mean=0.4, sd=0.1),
        Parameter(name="density", value=2500.0),
    ]
)


def test_the_cube_and_back():
    u = np.random.default_rng(0).random((20, 3))
    np.testing.assert_allclose(SPACE.unit(SPACE.values(u)), u, atol=1e-12)
    middle = SPACE.values([[0.5, 0.5, 0.5]])[0]
    np.testing.assert_allclose(middle, [0.5, np.sqrt(1e5 * 1e8), 0.5])
    named = SPACE.named(np.array([0.0, 1.0, 0.5]))
    assert named == {"density": 2500.0, "friction": 0.1, "modulus": 1e8, "restitution": 0.5}
    np.testing.assert_allclose(SPACE.of(named), [0.0, 1.0, 0.5], atol=1e-11)


def test_draws_follow_the_prior():
    u = SPACE.draw(4096, seed=3)
    # A Sobol sequence has its means to about 1/n; 1e-3 is far below the 0.4 % of random numbers.
    np.testing.assert_allclose(u[:, :2].mean(axis=0), 0.5, atol=1e-3)
    np.testing.assert_allclose(u[:, 2].mean(), 0.4, atol=1e-3)
    np.testing.assert_allclose(u.std(axis=0), SPACE.prior_sd, rtol=5e-3)
    assert SPACE.prior_sd[2] == pytest.approx(0.1, rel=2e-3)  # the ends cut off little


def test_log_prior_is_that_of_a_normal_in_the_range():
    inside = SPACE.log_prior(np.array([[0.5, 0.5, 0.4], [0.5, 0.5, 0.6]]))
    assert inside[0] - inside[1] == pytest.approx(0.5 * 2.0**2)
    assert SPACE.log_prior(np.array([[0.5, 1.01, 0.4]]))[0] == -np.inf
