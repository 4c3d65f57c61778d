"""Surrogates against closed forms, brute force and scikit-learn."""

import numpy as np
import pytest

from greybed.calibration.surrogates import (
    Feasibility,
    Forest,
    GaussianProcess,
    Network,
    Quadratic,
    Sample,
)


def smooth(x):
    return np.sin(3.0 * x[:, 0]) + x[:, 1] ** 2 + 0.5 * x[:, 0] * x[:, -1]


@pytest.fixture(scope="module")
def noisy():
    rng = np.random.default_rng(1)
    x = rng.random((40, 3))
    x = np.concatenate([x, x[:10], x[:10]])
    return Sample.of(x, smooth(x) + 0.05 * rng.standard_normal(len(x)))


def test_replicates_are_put_together_in_the_order_of_runs(noisy):
    assert noisy.x.shape == (40, 3)
    assert noisy.counts.tolist() == [3.0] * 10 + [1.0] * 30
    assert noisy.freedom == 20
    # Pooled variance of 20 degrees of freedom: sd 16 % at 1 sigma, here within 3.
    assert noisy.scatter**0.5 == pytest.approx(0.05, rel=0.48)


def test_the_gradient_of_the_evidence_is_that_of_differences(noisy):
    gp = GaussianProcess(noisy)
    at = gp.hyper + 0.1
    step = 1e-5 * np.eye(len(at))
    numeric = [(gp._objective(at + e)[0] - gp._objective(at - e)[0]) / 2e-5 for e in step]
    np.testing.assert_allclose(gp._objective(at)[1], numeric, rtol=1e-4, atol=1e-4)


def test_without_noise_it_interpolates():
    x = np.random.default_rng(2).random((25, 2))
    gp = GaussianProcess(Sample.of(x, smooth(x)))
    mean, sd = gp.predict(x)
    np.testing.assert_allclose(mean, smooth(x), atol=5e-3)
    far = np.array([[0.5, 0.5]])
    assert gp.predict(far)[1][0] > sd.max() * 0.5
    assert gp.noise < 0.02


def test_it_finds_the_noise_of_replicates(noisy):
    assert GaussianProcess(noisy).noise == pytest.approx(0.05, rel=0.4)


def test_leaving_out_is_what_leaving_out_gives(noisy):
    gp = GaussianProcess(noisy)
    mean, sd = gp.leave_out()
    for k in (0, 7, 33):
        mask = np.arange(len(noisy.y)) == k
        rest = noisy.without(mask)
        # The same standardisation and hyperparameters, by hand: a fit without tuning differs only
        # in shift and scale, which the wide prior of the mean makes nearly irrelevant.
        other = GaussianProcess(rest, gp.hyper, tune=False)
        m, s = other.predict(noisy.x[mask])
        assert m[0] == pytest.approx(mean[k], abs=0.02)
        assert s[0] == pytest.approx(sd[k], rel=0.15)


def test_covariance_has_the_variance_of_predictions_on_its_diagonal(noisy):
    gp = GaussianProcess(noisy)
    x = np.random.default_rng(5).random((6, 3))
    _, sd = gp.predict(x)
    np.testing.assert_allclose(np.diag(gp.covariance(x, x)), sd**2, rtol=1e-6)
    share = gp.spread_of_replicates(x)
    assert ((share > 0.0) & (share <= 1.0)).all()


def test_errors_are_neither_too_small_nor_too_large():
    """Standardised errors over 30 draws of noisy runs: their rms is near 1."""
    squares = []
    for seed in range(30):
        rng = np.random.default_rng([seed, 9])
        x = rng.random((24, 2))
        gp = GaussianProcess(Sample.of(x, smooth(x) + 0.1 * rng.standard_normal(24)))
        at = rng.random((50, 2))
        mean, sd = gp.predict(at)
        squares.append(np.mean(((mean - smooth(at)) / sd) ** 2))
    # 1500 correlated errors, about 5 independent ones a draw: 10 % at one sigma.
    assert 0.6 < np.sqrt(np.mean(squares)) < 1.3


def test_it_is_as_good_as_a_tuned_one_of_scikit_learn():
    """The bar of the project: CoP within 0.02 on a stored grid with 100 runs."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

    from greybed.calibration.twins import DrawDownTwin

    rng = np.random.default_rng(7)
    grid = np.stack(np.meshgrid(*[np.linspace(0.0, 1.0, 21)] * 2), axis=-1).reshape(-1, 2)
    names = ("friction", "rolling_friction")
    rows = [DrawDownTwin.exact(dict(zip(names, 0.05 + 0.85 * u, strict=True))) for u in grid]
    y = np.array([row["repose_angle"] for row in rows])
    chosen = rng.permutation(len(grid))[:100]
    runs = y[chosen] + 0.8 * rng.standard_normal(100)
    rest = np.setdiff1d(np.arange(len(grid)), chosen)
    gp = GaussianProcess(Sample.of(grid[chosen], runs))
    kernel = ConstantKernel(1.0) * Matern([0.5, 0.5], nu=2.5) + WhiteKernel(0.01)
    other = GaussianProcessRegressor(kernel, normalize_y=True, n_restarts_optimizer=5,
                                     random_state=0)  # fmt: skip
    other.fit(grid[chosen], runs)

    def cop(predicted):
        return 1.0 - ((predicted - y[rest]) ** 2).sum() / ((y[rest] - y[rest].mean()) ** 2).sum()

    ours, theirs = cop(gp.predict(grid[rest])[0]), cop(other.predict(grid[rest]))
    assert ours > theirs - 0.02
    assert ours > 0.98


def test_a_quadratic_surface_finds_a_quadratic():
    rng = np.random.default_rng(0)
    x = rng.random((20, 2))
    y = 1.0 + 2.0 * x[:, 0] - x[:, 1] + 3.0 * x[:, 0] * x[:, 1] - 2.0 * x[:, 1] ** 2
    surface = Quadratic(Sample.of(x, y))
    at = rng.random((50, 2))
    truth = 1.0 + 2.0 * at[:, 0] - at[:, 1] + 3.0 * at[:, 0] * at[:, 1] - 2.0 * at[:, 1] ** 2
    np.testing.assert_allclose(surface.predict(at)[0], truth, atol=1e-9)
    np.testing.assert_allclose(surface.leave_out()[0], y, atol=1e-8)


def test_leaving_out_of_a_quadratic_by_its_leverages_is_exact():
    rng = np.random.default_rng(3)
    x = rng.random((15, 1))
    sample = Sample.of(x, np.sin(4.0 * x[:, 0]))
    mean, _ = Quadratic(sample).leave_out()
    mask = np.arange(15) == 4
    again = Quadratic(sample.without(mask)).predict(sample.x[mask])[0]
    assert mean[4] == pytest.approx(again[0], rel=1e-9)


@pytest.mark.parametrize(("kind", "least"), [(Forest, 0.6), (Network, 0.9)])
def test_learners_predict_what_they_have_not_seen(kind, least):
    rng = np.random.default_rng(0)
    x = rng.random((60, 2))
    model = kind(Sample.of(x, smooth(x)), seed=1)
    at = rng.random((200, 2))
    mean, sd = model.predict(at)
    assert 1.0 - np.var(mean - smooth(at)) / np.var(smooth(at)) > least
    assert np.sqrt(np.mean(((mean - smooth(at)) / sd) ** 2)) < 2.0
    np.testing.assert_array_equal(kind(Sample.of(x, smooth(x)), seed=1).predict(at)[0], mean)


def test_feasibility_knows_where_runs_fail():
    x = np.random.default_rng(0).random((60, 2))
    chance = Feasibility(x, x[:, 0] < 0.6).chance(np.array([[0.2, 0.5], [0.95, 0.5]]))
    assert chance[0] > 0.9
    assert chance[1] < 0.2


def test_feasibility_of_accidents_is_flat():
    rng = np.random.default_rng(0)
    x = rng.random((200, 2))
    chance = Feasibility(x, rng.random(200) > 0.2).chance(rng.random((100, 2)))
    # 80 % of 200: 2.8 % at one sigma for all, about three times that for a quarter of the range.
    assert abs(chance.mean() - 0.8) < 0.08
    assert np.ptp(chance) < 0.35
    assert (Feasibility(x, np.ones(200, bool)).chance(x) == 1.0).all()
