"""Which runs to make next: those that would take most surrogate error out of the answer.

A run at a point lowers the variance of each Gaussian process elsewhere by its squared covariance
over the variance of the run (active learning: Cohn, Neural Netw. 9 (1996) 1071). Here that is
summed over samples of the present posterior, in units of the total error there, divided by the cost
of the experiment, and multiplied by the chance that the run succeeds: runs go where parameters are
still possible and the surrogate's error matters beside that of the measurement.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from greybed.calibration.metamodel import Emulator, Metamodel
from greybed.calibration.posterior import _temper
from greybed.calibration.surrogates import GaussianProcess

Array = NDArray[np.float64]

SAMPLES = 256
_EXPLORE = 24  # candidates from the whole range
_NEAR = 1e-6


def quick_posterior(model: Metamodel, seed: int, samples: int = SAMPLES) -> Array:
    """Rough samples of the posterior, enough to choose runs by, (n, d)."""
    rng = np.random.default_rng([seed, 61])
    return _temper(model.log_posterior, model.space, rng, samples)[0]


class _Variances:
    """Covariances of one surrogate between candidates and samples, as runs are added in mind."""

    def __init__(self, emulator: Emulator, k: int, candidates: Array, samples: Array) -> None:
        surrogate = emulator.surrogates[k]
        _, sd = emulator.predict(samples)
        self._total = emulator.covariances(sd)[:, k, k]
        if isinstance(surrogate, GaussianProcess):
            self._cross = surrogate.covariance(candidates, samples)
            self._own = surrogate.covariance(candidates, candidates)
            self._noise = surrogate.noise**2
        else:  # no covariance is known: a run helps at its own place only
            near = np.exp(-0.5 * _squares(candidates, samples) / 0.15**2)
            own = np.exp(-0.5 * _squares(candidates, candidates) / 0.15**2)
            at, here = surrogate.predict(candidates)[1], sd[:, k]
            self._cross = at[:, None] * near * here
            self._own = at[:, None] * own * at
            self._noise = max(surrogate.noise**2, 1e-3 * float(self._own.diagonal().mean()))

    def gain(self) -> Array:
        """Mean share of the total variance that a run at each candidate would take away."""
        less = self._cross**2 / (self._own.diagonal() + self._noise)[:, None]
        return np.asarray((less / self._total).mean(axis=1))

    def add(self, chosen: int) -> None:
        """Put a run at a candidate, in mind."""
        scale = self._own[chosen, chosen] + self._noise
        column = self._own[:, chosen].copy()
        self._cross -= np.outer(column, self._cross[chosen]) / scale
        self._own -= np.outer(column, column) / scale


def _squares(a: Array, b: Array) -> Array:
    return np.asarray(((a[:, None, :] - b) ** 2).sum(axis=2))


def choose(model: Metamodel, seed: int, count: int) -> list[tuple[str, Array]]:
    """Experiments and points of the next runs.

    Parameters
    ----------
    model : Metamodel
        The surrogates so far.
    seed : int
        Of the samples.
    count : int
        Runs to choose together [-].

    Returns
    -------
    list of (str, ndarray (d,))
        Experiment and point of each.
    """
    samples = quick_posterior(model, seed)
    rng = np.random.default_rng([seed, 62])
    explore = model.space.from_prior(rng.random((_EXPLORE, len(model.space))))
    candidates = np.unique(np.concatenate([samples, explore]).round(6), axis=0)
    names = model.study.with_role("calibration")
    parts: dict[str, list[_Variances]] = {name: [] for name in names}
    for emulator in model.emulators:
        for k in range(len(emulator.surrogates)):
            parts[emulator.response.experiment].append(_Variances(emulator, k, candidates, samples))
    chance = {
        n: model.feasible[n].chance(candidates) if n in model.feasible else np.ones(len(candidates))
        for n in names
    }
    cost = {name: max(model.study.experiments[name].relative_cost, 1e-9) for name in names}
    chosen = []
    for _ in range(count):
        scores = np.array(
            [sum(p.gain() for p in parts[n]) * chance[n] / cost[n] for n in names]
        ).reshape(len(names), -1)
        which, place = np.unravel_index(int(scores.argmax()), scores.shape)
        name = names[int(which)]
        chosen.append((name, candidates[int(place)]))
        for part in parts[name]:
            part.add(int(place))
    return chosen


def surrogate_share(model: Metamodel, samples: Array) -> float:
    """Largest share of surrogate error in the variance of a measure, mean over samples [-]."""
    worst = 0.0
    for emulator in model.emulators:
        _, sd = emulator.predict(samples)
        total = emulator.covariances(sd)
        k = np.arange(sd.shape[1])
        worst = max(worst, float((sd**2 / total[:, k, k]).mean(axis=0).max()))
    return worst
