"""Honest error bars: how often 95 % intervals cover the truth, over hundreds of seeds."""

from __future__ import annotations

import numpy as np

from greybed.core import Packing
from greybed.core.sizes import Uniform
from greybed.datasets.containers import Box
from greybed.datasets.generate import random_packing
from greybed.raytrace import standard_error, view_factors

REPLICATES = 200
RAYS = 2_000
Z = 1.959964


def test_coverage_in_a_polydisperse_packing():
    packing = random_packing(36, 0.35, Uniform(1e-3, 2e-3), container=Box(), seed=4)
    # 100 times the rays of a replicate: its own error widens the spread by half a percent.
    reference = view_factors(packing, rays=100 * RAYS, seed=10_000)
    truth = np.hstack([reference.factors.toarray(), reference.wall_factors])
    # Below ten expected hits no symmetric interval can keep its promise.
    fair = truth * RAYS >= 10.0
    inside = np.zeros(truth.shape)
    for seed in range(REPLICATES):
        run = view_factors(packing, rays=RAYS, seed=seed)
        value = np.hstack([run.factors.toarray(), run.wall_factors])
        # A pair that was never hit has no entry; its error is that of a count of zero.
        error = np.hstack([run.stderr.toarray(), run.wall_stderr])
        error[error == 0.0] = standard_error(0, RAYS)
        inside += np.abs(value - truth) <= Z * error
    inside /= REPLICATES
    assert fair.sum() > 400
    assert 0.93 <= inside[fair].mean() <= 0.97
    for low, high in ((10, 30), (30, 100), (100, 1000)):
        decade = fair & (truth * RAYS >= low) & (truth * RAYS < high)
        assert decade.sum() > 30
        assert 0.93 <= inside[decade].mean() <= 0.97, (low, high)


def test_coverage_of_the_exact_pair():
    exact = 0.0755868184216
    pair = Packing([[0, 0, 0], [2, 0, 0]], 1.0)
    inside = []
    for seed in range(500):
        run = view_factors(pair, rays=RAYS, seed=seed, threads=1)
        value = np.array([run.factors[0, 1], run.factors[1, 0]])
        error = np.array([run.stderr[0, 1], run.stderr[1, 0]])
        inside.extend(np.abs(value - exact) <= Z * error)
    # 1000 independent intervals: 95 % within 2 % is three standard deviations.
    assert 0.93 <= np.mean(inside) <= 0.97


def test_pooled_error_matches_the_spread():
    """Standard deviation over seeds against the mean stated error, for the same packing."""
    pair = Packing([[0, 0, 0], [2.5, 0, 0]], [1.0, 1.4])
    runs = [view_factors(pair, rays=1000, seed=seed, threads=1) for seed in range(300)]
    spread = np.std([run.factors[0, 1] for run in runs])
    stated = np.mean([run.stderr[0, 1] for run in runs])
    # The spread of 300 values is itself uncertain by 4 %.
    assert abs(spread / stated - 1.0) < 0.16
