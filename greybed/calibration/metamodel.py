"""All surrogates of a study together: what runs would give, how sure that is, and the misfit."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from greybed.calibration.experiment import Value
from greybed.calibration.parameters import Space
from greybed.calibration.responses import Response, response_of, unmeasured
from greybed.calibration.runs import Job, cost_of
from greybed.calibration.store import Outcome
from greybed.calibration.study import Study
from greybed.calibration.surrogates import (
    Feasibility,
    Forest,
    GaussianProcess,
    Network,
    Quadratic,
    Sample,
    Surrogate,
)
from greybed.core.errors import InputError

Array = NDArray[np.float64]
Runs = Sequence[tuple[Job, Sequence[Outcome]]]

# Fewer runs of an experiment than this leave its response unknown.
LEAST_RUNS = 4


@dataclass
class Rows:
    """Runs of one experiment: points of the cube, results, whether they came to their end."""

    points: Array
    results: list[Mapping[str, Value]]
    all_points: Array
    good: NDArray[np.bool_]
    costs: Array


def rows_of(space: Space, runs: Runs, experiment: str) -> Rows:
    """Finished runs of an experiment; each attempt counts for the chance of success."""
    points: list[Array] = []
    tries: list[Array] = []
    results: list[Mapping[str, Value]] = []
    good: list[bool] = []
    costs: list[float] = []
    for job, outcomes in runs:
        if job.experiment != experiment:
            continue
        u = space.of(job.named)
        for outcome in outcomes:
            tries.append(u)
            good.append(outcome.results is not None)
            if outcome.results is not None:
                points.append(u)
                results.append(outcome.results)
                costs.append(cost_of(outcome))
    d = len(space)
    return Rows(
        np.array(points).reshape(-1, d), results, np.array(tries).reshape(-1, d),
        np.array(good, bool), np.array(costs),
    )  # fmt: skip


@dataclass
class Emulator:
    """A response with the surrogates of its numbers."""

    response: Response
    surrogates: list[Surrogate]
    fixed: Array = field(default_factory=lambda: np.zeros(0))

    def predict(self, u: Array) -> tuple[Array, Array]:
        """Means and sds of the numbers, each (n, k)."""
        pairs = [s.predict(u) for s in self.surrogates]
        return np.column_stack([p[0] for p in pairs]), np.column_stack([p[1] for p in pairs])

    def covariances(self, sd: Array) -> Array:
        """Measurement and surrogate together, (n, k, k)."""
        extra = sd**2
        if self.response.single:
            extra = extra + np.array([s.noise**2 for s in self.surrogates])
        k = sd.shape[1]
        return np.asarray(self.response.covariance + extra[:, :, None] * np.eye(k))

    def misfit(self, u: Array) -> tuple[Array, Array]:
        """Chi-squared and log determinant at points, each (n,)."""
        mean, sd = self.predict(u)
        off = mean - self.response.value
        if off.shape[1] == 1:
            variance = self.covariances(sd)[:, 0, 0]
            return off[:, 0] ** 2 / variance, np.log(variance)
        lower = np.linalg.cholesky(self.covariances(sd))
        white = np.linalg.solve(lower, off[:, :, None])[:, :, 0]
        determinant = 2.0 * np.log(np.diagonal(lower, axis1=1, axis2=2)).sum(axis=1)
        return (white**2).sum(axis=1), determinant


class Metamodel:
    """Surrogates of all measures, fitted to the runs so far.

    Parameters
    ----------
    study : Study
        What is asked.
    runs : sequence of (Job, list of Outcome)
        Finished runs.
    before : Metamodel, optional
        An earlier one: its hyperparameters are where the fit begins.
    tune : bool
        Whether hyperparameters are looked for anew.
    axes : tuple of int, optional
        Axes that quadratic surfaces depend on.

    Raises
    ------
    InputError
        If so many runs have failed that nothing can be fitted.
    """

    def __init__(
        self,
        study: Study,
        runs: Runs,
        before: Metamodel | None = None,
        *,
        tune: bool = True,
        axes: tuple[int, ...] | None = None,
    ) -> None:
        self.study, self.space = study, study.space
        self.rows = {name: rows_of(study.space, runs, name) for name in study.experiments}
        self._axes = axes
        self._before, self._tuned = before, tune
        self.emulators: list[Emulator] = []  # of measured responses, in the order of the targets
        self.others: dict[str, Emulator] = {}  # of responses without data, by label
        for target in study.targets:
            rows = self.rows[target.experiment]
            role = study.roles[target.experiment]
            if len(rows.results) < LEAST_RUNS:
                if role == "validation":
                    continue
                raise InputError(
                    f"experiment {target.experiment!r}: only {len(rows.results)} of "
                    f"{len(rows.good)} runs came to their end; widen what it allows, narrow the "
                    "ranges, or see the reasons in runs.sqlite."
                )
            values = [result[target.measure] for result in rows.results]
            emulator = self._fit(response_of(target, values), rows)
            if role == "calibration":
                self.emulators.append(emulator)
            else:
                self.others[emulator.response.label] = emulator
        for name in study.with_role("candidate", "process"):
            for measure in study.experiments[name].measures.values():
                label = f"{name}.{measure.name}"
                if measure.kind != "scalar" or len(self.rows[name].results) < LEAST_RUNS:
                    continue
                if study.roles[name] == "candidate" and label not in study.planned:
                    continue
                response = unmeasured(name, measure.name, study.planned.get(label, 1.0))
                self.others[label] = self._fit(response, self.rows[name])
        self.feasible = {
            name: Feasibility(rows.all_points, rows.good)
            for name, rows in self.rows.items()
            if len(rows.good)
        }

    def _fit(self, response: Response, rows: Rows) -> Emulator:
        numbers = np.array([response.numbers(r[response.measure]) for r in rows.results])
        before = None
        if self._before is not None:
            known = [e for e in self._before.emulators if e.response.label == response.label]
            known += [e for k, e in self._before.others.items() if k == response.label]
            before = known[0] if known and len(known[0].surrogates) == numbers.shape[1] else None
        made = []
        for k in range(numbers.shape[1]):
            old = before.surrogates[k] if before is not None else None
            made.append(self._surrogate(Sample.of(rows.points, numbers[:, k]), old))
        return Emulator(response, made)

    def _surrogate(self, sample: Sample, old: Surrogate | None) -> Surrogate:
        kind, seed = self.study.options.surrogate, self.study.options.seed
        if kind == "quadratic":
            return Quadratic(sample, self._axes)
        if kind == "forest":
            return Forest(sample, seed)
        if kind == "mlp":
            return Network(sample, seed)
        start = old.hyper if isinstance(old, GaussianProcess) else None
        return GaussianProcess(sample, start, tune=self._tuned or start is None)

    # -- likelihood -------------------------------------------------------------------------

    def log_likelihood(self, u: Array) -> Array:
        """Of all measured data, with the errors of measurement and surrogates, (n,)."""
        total = np.zeros(len(u))
        for emulator in self.emulators:
            chi2, determinant = emulator.misfit(u)
            total -= 0.5 * (chi2 + determinant)
        for name in self.study.with_role("calibration"):
            if name in self.feasible:
                total += np.log(np.maximum(self.feasible[name].chance(u), 1e-12))
        return total

    def log_posterior(self, u: Array) -> Array:
        """Up to a constant, (n,); -inf outside the ranges."""
        prior = self.space.log_prior(u)
        inside = np.isfinite(prior)
        result = np.full(len(u), -np.inf)
        if inside.any():
            result[inside] = prior[inside] + self.log_likelihood(u[inside])
        return result

    def chi2(self, u: Array) -> Array:
        """Misfit of the means with all errors, curves with what no parameter reaches, (n,)."""
        total = np.full(len(u), self.outside[0])
        for emulator in self.emulators:
            total += emulator.misfit(u)[0]
        return total

    @property
    def outside(self) -> tuple[float, int]:
        """Chi-squared of measured curves that no parameter set reaches, and its freedom [-]."""
        return (
            sum(e.response.outside for e in self.emulators),
            sum(e.response.outside_freedom for e in self.emulators),
        )

    @property
    def numbers(self) -> int:
        """Measured numbers that parameters are fitted to [-]."""
        return sum(len(e.surrogates) for e in self.emulators)

    def log_cost(self, u: Array) -> Array:
        """Logarithm of the work of one run of each calibration experiment, against the least."""
        total = np.zeros(len(u))
        for name in self.study.with_role("calibration"):
            rows = self.rows[name]
            logs = np.log(np.maximum(rows.costs, 1e-12))
            if len(logs) < len(self.space) + 3 or math.isclose(logs.min(), logs.max()):
                continue
            surface = Quadratic(Sample.of(rows.points, logs))
            total += surface.predict(u)[0] - logs.min()
        return total
