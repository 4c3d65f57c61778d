"""A study as numbers: usable rows, transformed responses, parameters, directions of errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError
from greybed.residual.model import ForwardModel
from greybed.residual.study import Study

Array = NDArray[np.float64]

FREE_SD = 2.0  # of the logarithm of a free parameter: within a factor of 50 either way
STEP = 1e-4  # of finite differences, relative
FEWEST_ROWS = 5
FEWEST_TO_DEFINE = 8
DEFINES = 1e-4  # relative: closer than this, a column is part of the response's definition


@dataclass(frozen=True)
class Problem:
    """Rows in use and what is needed to predict them.

    Attributes
    ----------
    study, model
        What it was made from.
    index : ndarray (n,), int
        Rows of the study's table in use.
    z : ndarray (n,)
        Transformed responses: logarithms, or the responses themselves.
    columns : mapping of str to ndarray, each (n,)
        Conditions in SI.
    group : ndarray (n,), int
        Group of each row; every row its own where the study has none.
    labels : mapping of str to tuple of str
        Words of each row.
    names : tuple of str
        Uncertain parameters, measured or free; p of them.
    scale : ndarray (p,)
        What one unit of the internal coordinate t means: relative where positive.
    prior_sd : ndarray (p,)
        Of t: 1 where measured, ``FREE_SD`` where free.
    left_out : tuple of mappings
        Rows that cannot be used, with the reason.
    used : frozenset of str
        Columns that the base model depends on.
    defining : tuple of str
        Columns that the response was computed from; they explain nothing.
    """

    study: Study
    model: ForwardModel
    index: NDArray[np.int64]
    z: Array
    columns: Mapping[str, Array]
    group: NDArray[np.int64]
    labels: Mapping[str, tuple[str, ...]]
    names: tuple[str, ...]
    scale: Array
    prior_sd: Array
    left_out: tuple[Mapping[str, Any], ...] = ()
    used: frozenset[str] = frozenset()
    defining: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.z)

    @property
    def grouped(self) -> bool:
        """Whether rows share settings."""
        return bool(self.study.group)

    def parameters(self, t: Array) -> dict[str, float]:
        """All parameters in SI at internal coordinates ``t``, shape (p,)."""
        values = {name: item.value for name, item in self.study.parameters.items()}
        for name, scale, coordinate in zip(self.names, self.scale, t, strict=True):
            value = values[name]
            if value > 0.0:
                values[name] = value * float(np.exp(scale * coordinate))
            else:
                values[name] = value + scale * float(coordinate)
        return values

    def predict(
        self,
        t: Array,
        amplitudes: Mapping[str, float],
        columns: Mapping[str, Array] | None = None,
    ) -> Array:
        """Transformed prediction, shape (n,); NaN where the model fails."""
        columns = self.columns if columns is None else columns
        with np.errstate(all="ignore"):
            response = self.model.predict(columns, self.parameters(t), amplitudes)
            return np.log(response) if self.model.transform == "log" else response

    def slopes(self, t: Array, amplitudes: Mapping[str, float]) -> Array:
        """Derivative of the transformed prediction by t, shape (n, p)."""
        slopes = np.empty((len(self), len(self.names)))
        for j, scale in enumerate(self.scale):
            step = np.zeros(len(self.names))
            step[j] = STEP / max(scale, STEP) if scale < 1.0 else STEP
            slopes[:, j] = (
                self.predict(t + step, amplitudes) - self.predict(t - step, amplitudes)
            ) / (2.0 * step[j])
        return slopes

    def systematic(self, t: Array) -> Array:
        """Covariance of the transformed responses from stated systematic errors, (n, n)."""
        size = len(self)
        covariance = np.zeros((size, size))
        for name, sd in self.study.noise.systematic.items():
            if name == self.study.response:
                slope = np.ones(size) if self.model.transform == "log" else np.abs(self.z)
                shared = self.group
            elif name in self.columns:
                column = self.columns[name]
                up = self.predict(t, {}, {**self.columns, name: column * (1.0 + STEP)})
                down = self.predict(t, {}, {**self.columns, name: column * (1.0 - STEP)})
                slope = (up - down) / (2.0 * STEP)
                # one instrument setting for the whole table has one error
                constant = np.ptp(column) <= 1e-12 * np.max(np.abs(column))
                shared = np.zeros_like(self.group) if constant else self.group
            else:
                continue
            same = shared[:, None] == shared[None, :]
            covariance += np.where(same, sd**2 * np.outer(slope, slope), 0.0)
        if self.model.noise is not None:
            covariance[np.diag_indices(size)] += self.model.noise[self.index] ** 2
        return covariance

    def covariates(self) -> dict[str, Array]:
        """Numeric columns that vary, each (n,), without response and replicate counter."""
        skip = {self.study.response, self.study.replicate, *self.defining}
        return {
            name: column
            for name, column in self.columns.items()
            if name not in skip and np.ptp(column) > 1e-9 * np.max(np.abs(column))
        }

    def take(self, keep: NDArray[np.bool_] | NDArray[np.int64]) -> Problem:
        """The same problem with some of its rows."""
        rows = np.flatnonzero(keep) if keep.dtype == np.bool_ else keep
        return replace(
            self,
            index=self.index[rows],
            z=self.z[rows],
            columns={name: column[rows] for name, column in self.columns.items()},
            group=self.group[rows],
            labels={name: tuple(words[i] for i in rows) for name, words in self.labels.items()},
        )


def _groups(study: Study) -> NDArray[np.int64]:
    if not study.group:
        return np.arange(len(study.table), dtype=np.int64)
    keys: list[Sequence[Any]] = []
    for name in study.group:
        if name in study.table.labels:
            keys.append(study.table.labels[name])
        else:
            keys.append([f"{value:.9g}" for value in study.table.columns[name]])
    seen: dict[tuple[Any, ...], int] = {}
    return np.array([seen.setdefault(key, len(seen)) for key in zip(*keys, strict=True)])


def state(study: Study, model: ForwardModel) -> Problem:
    """Bring a study and its model into numbers.

    Parameters
    ----------
    study : Study
        As read.
    model : ForwardModel
        Built for the study's table and parameters.

    Returns
    -------
    problem : Problem
        With the rows at which both measurement and model give a number.

    Raises
    ------
    InputError
        If too few rows are left, or fewer than parameters to be found.
    """
    table = study.table
    where = str(table.file or study.file or "study")
    uncertain = [name for name, item in study.parameters.items() if item.free or item.sd > 0.0]
    scale, prior = [], []
    for name in uncertain:
        item = study.parameters[name]
        if item.free:
            scale.append(1.0 if item.value > 0.0 else max(abs(item.value), 1.0))
            prior.append(FREE_SD)
        else:
            scale.append(item.sd / item.value if item.value > 0.0 else item.sd)
            prior.append(1.0)
    response = table.columns[study.response]
    problem = Problem(
        study,
        model,
        np.arange(len(table), dtype=np.int64),
        response,
        dict(table.columns),
        _groups(study),
        dict(table.labels),
        tuple(uncertain),
        np.array(scale),
        np.array(prior),
    )
    measured = response > 0.0 if model.transform == "log" else np.isfinite(response)
    if not measured.all():
        row = int(np.flatnonzero(~measured)[0])
        raise InputError(
            f"{where}: line {table.rows[row]}: {study.response} = {response[row]:g} "
            f"[{table.units.get(study.response, '-')}] must be above 0, because this model's "
            "errors are relative; mend or remove the row."
        )
    predicted = problem.predict(np.zeros(len(uncertain)), {})
    good = np.isfinite(predicted)
    left_out = tuple(
        {
            "row": int(table.rows[i]),
            "reason": f"the model {model.name} gives no number at these conditions",
        }
        for i in np.flatnonzero(~good)
    )
    free = sum(item.free for item in study.parameters.values())
    needed = max(FEWEST_ROWS, free + 3)
    if good.sum() < needed:
        raise InputError(
            f"{where}: {good.sum()} rows can be used ({len(left_out)} left out because the model "
            f"fails there), but {free} free parameters and an effect need at least {needed}; "
            "measure more, or fix parameters."
        )
    z = np.log(response) if model.transform == "log" else response.copy()
    problem = replace(problem, z=z, used=_used(problem, predicted))
    problem = replace(problem.take(good), left_out=left_out)
    return replace(problem, defining=_defining(problem))


def _used(problem: Problem, base: Array) -> frozenset[str]:
    """Columns that change the base model's prediction."""
    t = np.zeros(len(problem.names))
    used = set()
    for name, column in problem.columns.items():
        changed = problem.predict(t, {}, {**problem.columns, name: column * 1.01})
        if not np.array_equal(base, changed, equal_nan=True):
            used.add(name)
    return frozenset(used)


def _defining(problem: Problem) -> tuple[str, ...]:
    """Columns that the response was computed from, such as the distance and time of a velocity.

    One or two columns whose powers give the response to far more digits than any measurement
    repeats are its definition.
    """
    covariates = problem.covariates()
    names = [n for n, v in covariates.items() if n not in problem.used and (v > 0.0).all()]
    response = problem.columns[problem.study.response]
    if not names or len(problem) < FEWEST_TO_DEFINE or not (response > 0.0).all():
        return ()
    y = np.log(response) - np.log(response).mean()
    for size in (1, 2):
        for group in combinations(names, size):
            x = np.column_stack([np.log(covariates[n]) for n in group])
            x = x - x.mean(axis=0)
            rest = y - x @ np.linalg.lstsq(x, y, rcond=None)[0]
            if np.sqrt(np.mean(rest**2)) < DEFINES:
                return group
    return ()
