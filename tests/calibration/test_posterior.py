"""Samples of posteriors that are known."""

import numpy as np
import pytest

from greybed.calibration import Parameter, Space
from greybed.calibration.posterior import convergence, sample_posterior

SPACE = Space([Parameter(name=n, low=0.0, high=1.0) for n in "ab"])


def gaussian(u, centre=(0.45, 0.55), sd=(0.05, 0.08), rho=0.8):
    z = (u - centre) / sd
    return -0.5 * (z[:, 0] ** 2 - 2 * rho * z[:, 0] * z[:, 1] + z[:, 1] ** 2) / (1 - rho**2)


def bounded(density):
    return lambda u: np.where(((u >= 0) & (u <= 1)).all(axis=1), density(u), -np.inf)


def test_a_correlated_normal_is_found():
    found = sample_posterior(bounded(gaussian), SPACE, seed=1)
    assert found.r_hat.max() < 1.02
    assert found.effective > 800
    error = 4.0 / np.sqrt(found.effective)  # four sigmas of a mean, in sds
    np.testing.assert_allclose(found.points.mean(axis=0), [0.45, 0.55], atol=0.08 * error)
    np.testing.assert_allclose(found.points.std(axis=0), [0.05, 0.08], rtol=error)
    assert np.corrcoef(found.points.T)[0, 1] == pytest.approx(0.8, abs=2.0 * error)
    # The 90 % region of two axes is where the density has fallen by 2.303.
    level = found.density.max() - found.level()
    assert level == pytest.approx(-np.log(0.1), abs=0.25)
    assert found.modes() == 1


def test_two_valleys_are_both_found_and_counted():
    def two(u):
        return np.logaddexp(
            gaussian(u, (0.2, 0.2), (0.03, 0.03), 0.0), gaussian(u, (0.8, 0.75), (0.03, 0.03), 0.0)
        )

    found = sample_posterior(bounded(two), SPACE, seed=2)
    share = (found.points[:, 0] < 0.5).mean()
    assert 0.3 < share < 0.7
    assert found.modes() == 2


def test_a_curved_valley_is_followed():
    def banana(u):
        return -0.5 * ((u[:, 0] * u[:, 1] - 0.15) / 0.01) ** 2

    found = sample_posterior(bounded(banana), SPACE, seed=3)
    fine = np.stack(np.meshgrid(*[(np.arange(800) + 0.5) / 800] * 2), axis=-1).reshape(-1, 2)
    weight = np.exp(banana(fine))
    mean = (fine * weight[:, None]).sum(axis=0) / weight.sum()
    np.testing.assert_allclose(found.points.mean(axis=0), mean, atol=0.05)
    assert found.modes() == 1


def test_seeds_decide_everything():
    one = sample_posterior(bounded(gaussian), SPACE, seed=4, steps=60)
    two = sample_posterior(bounded(gaussian), SPACE, seed=4, steps=60)
    np.testing.assert_array_equal(one.points, two.points)
    assert (sample_posterior(bounded(gaussian), SPACE, seed=5, steps=60).points != one.points).any()


def test_convergence_of_chains_with_a_known_memory():
    """First-order autoregressive chains: n (1 - a) / (1 + a) independent samples."""
    rng = np.random.default_rng(0)
    a, steps, chains = 0.8, 2000, 16
    x = np.empty((steps, chains, 1))
    x[0] = rng.standard_normal((chains, 1))
    for k in range(1, steps):
        x[k] = a * x[k - 1] + np.sqrt(1 - a**2) * rng.standard_normal((chains, 1))
    r_hat, size = convergence(x)
    assert size[0] == pytest.approx(steps * chains * (1 - a) / (1 + a), rel=0.15)
    assert r_hat[0] < 1.02
    x[:, :4] += 2.0
    assert convergence(x)[0][0] > 1.2
