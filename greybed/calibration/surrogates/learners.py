"""Forest and small network by scikit-learn, with errors from folds and members."""

from __future__ import annotations

import warnings
from abc import abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from greybed.calibration.surrogates.base import Sample, Surrogate

Array = NDArray[np.float64]

FOLDS = 5
TREES = 100
MEMBERS = 5


class _Ensemble(Surrogate):
    """Members that differ in their draw; folds say how wrong their mean is."""

    def __init__(self, sample: Sample, seed: int = 0) -> None:
        self.sample, self._seed = sample, seed
        self._shift = float(sample.y.mean())
        self._scale = float(sample.y.std()) or 1.0
        self._model = self._fit(sample, seed)
        n = len(sample.y)
        folds = min(FOLDS, n)
        place = np.random.default_rng([seed, 31]).permutation(n) % folds
        mean = np.empty(n)
        for fold in range(folds):
            out = place == fold
            mean[out] = self._members(self._fit(sample.without(out), seed), sample.x[out]).mean(0)
        self._held_out = mean
        error = float(np.mean((mean - sample.y) ** 2))
        noise = sample.scatter / float(sample.counts.mean())
        # Held-out errors hold the noise of the runs, which is not an error of the mean.
        self._error = float(np.sqrt(max(error - noise, 0.05 * error)))
        self.noise = float(np.sqrt(sample.scatter)) if sample.freedom else 0.0

    @abstractmethod
    def _fit(self, sample: Sample, seed: int) -> Any:
        """Fitted members."""

    @abstractmethod
    def _members(self, model: Any, x: Array) -> Array:
        """Answers of the members, (m, n)."""

    def predict(self, x: Array) -> tuple[Array, Array]:
        """See :meth:`Surrogate.predict`: spread of the members and error of the folds."""
        answers = self._members(self._model, x)
        spread = answers.std(axis=0) / np.sqrt(len(answers))
        return answers.mean(axis=0), np.hypot(spread, self._error)

    def leave_out(self) -> tuple[Array, Array]:
        """See :meth:`Surrogate.leave_out`, by five folds."""
        return self._held_out, np.full(len(self._held_out), self._error)


class Forest(_Ensemble):
    """A forest of extremely random trees (Geurts, Ernst & Wehenkel, Mach. Learn. 63 (2006) 3)."""

    def _fit(self, sample: Sample, seed: int) -> Any:
        from sklearn.ensemble import ExtraTreesRegressor

        forest = ExtraTreesRegressor(
            n_estimators=TREES, min_samples_leaf=1, random_state=seed, n_jobs=1
        )
        forest.fit(sample.x, sample.y, sample_weight=sample.counts)
        return forest

    def _members(self, model: Any, x: Array) -> Array:
        return np.array([tree.predict(x) for tree in model.estimators_])


class Network(_Ensemble):
    """Five small networks of one hidden layer, each from its own first weights."""

    def _fit(self, sample: Sample, seed: int) -> Any:
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.neural_network import MLPRegressor

        members = []
        y = (sample.y - self._shift) / self._scale
        for k in range(MEMBERS):
            member = MLPRegressor(
                hidden_layer_sizes=(12,), activation="tanh", solver="lbfgs", alpha=0.03,
                max_iter=400, random_state=seed + k,
            )  # fmt: skip
            # Matrices this small take eight times as long where threads wait for each other.
            with threadpool_limits(1), warnings.catch_warnings():
                warnings.simplefilter("ignore", ConvergenceWarning)
                member.fit(2.0 * sample.x - 1.0, y)
            members.append(member)
        return members

    def _members(self, model: Any, x: Array) -> Array:
        return np.array([self._shift + self._scale * m.predict(2.0 * x - 1.0) for m in model])
