"""Which directions and parameters the data determine, in numbers and in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from greybed.calibration.metamodel import Emulator, Metamodel
from greybed.calibration.posterior import Posterior
from greybed.calibration.surrogates import GaussianProcess

Array = NDArray[np.float64]
Word = Literal["determined", "one-sided", "open"]

# A direction or parameter is determined where its posterior variance is below this share of the
# prior one: half of the standard deviation.
DETERMINED = 0.25
_STEP = 0.04  # of finite differences in the unit cube
_END = 0.1  # share of the prior at an end of a range
_GONE, _KEPT = 0.1, 0.3  # posterior over prior mass there: excluded, kept


@dataclass(frozen=True)
class Direction:
    """An eigenvector of the information in units of the prior.

    Attributes
    ----------
    information : float
        Eigenvalue of J' S^-1 J with parameters in prior standard deviations [-].
    left : float
        Share of the prior variance that is left, 1 / (1 + information) [-].
    weights : ndarray (d,)
        Of the parameters, of unit length [-].
    words : str
        The combination.
    """

    information: float
    left: float
    weights: Array
    words: str

    @property
    def determined(self) -> bool:
        """Whether the data determine it."""
        return self.left <= DETERMINED


@dataclass(frozen=True)
class Verdict:
    """What is known of one parameter.

    Attributes
    ----------
    name : str
        Of the parameter.
    word : str
        ``determined``, ``one-sided`` or ``open``.
    shrink : float
        Posterior over prior standard deviation [-].
    sentence : str
        In words.
    """

    name: str
    word: Word
    shrink: float
    sentence: str


def slopes(emulator: Emulator, u: Array, scale: Array) -> tuple[Array, Array]:
    """Slopes of a measure's numbers at a point and their errors, per prior sd, each (k, d).

    Parameters
    ----------
    emulator : Emulator
        Surrogates of the measure.
    u : ndarray (d,)
        Point of the unit cube [-].
    scale : ndarray (d,)
        Prior standard deviations [-].
    """
    d = len(u)
    low = np.clip(u - _STEP * np.eye(d), 0.0, 1.0)
    high = np.clip(u + _STEP * np.eye(d), 0.0, 1.0)
    apart = np.diagonal(high - low)
    below, above = emulator.predict(low), emulator.predict(high)
    slope = ((above[0] - below[0]) / apart[:, None]).T * scale
    errors = np.zeros_like(slope)
    for k, surrogate in enumerate(emulator.surrogates):
        if isinstance(surrogate, GaussianProcess):
            both = surrogate.covariance(high, high) + surrogate.covariance(low, low)
            across = np.diagonal(surrogate.covariance(high, low))
            variance = np.maximum(np.diagonal(both) - 2.0 * across, 0.0)
            errors[k] = np.sqrt(variance) / apart * scale
    return slope, errors


def information(model: Metamodel, u: Array) -> Array:
    """J' S^-1 J of all measured data at a point, parameters in prior sds, (d, d) [-].

    Slopes that are smaller than their own error count as none.
    """
    scale = model.space.prior_sd
    total = np.zeros((len(scale), len(scale)))
    for emulator in model.emulators:
        slope, error = slopes(emulator, u, scale)
        slope = np.where(np.abs(slope) > error, slope, 0.0)
        _, sd = emulator.predict(u[None])
        total += slope.T @ np.linalg.solve(emulator.covariances(sd)[0], slope)
    return total


def directions(model: Metamodel, u: Array) -> list[Direction]:
    """Directions at a point, the best determined one first.

    Those that are open span a space in which any basis is as good: the one is taken that needs the
    fewest parameters for each (varimax: Kaiser, Psychometrika 23 (1958) 187).
    """
    matrix = information(model, u)
    values, vectors = np.linalg.eigh(matrix)
    left = 1.0 / (1.0 + np.maximum(values, 0.0)) > DETERMINED
    vectors[:, left] = _varimax(vectors[:, left])
    values = np.einsum("ij,ik,kj->j", vectors, matrix, vectors)
    found = []
    for k in np.argsort(-values, kind="stable"):
        size = max(float(values[k]), 0.0)
        weights = vectors[:, k] * np.sign(vectors[np.abs(vectors[:, k]).argmax(), k])
        found.append(
            Direction(size, 1.0 / (1.0 + size), weights, in_words(weights, model.space.names))
        )
    return found


def _varimax(basis: Array) -> Array:
    """An orthonormal basis (d, m) turned so that its squared entries are as unequal as can be."""
    m = basis.shape[1]
    if m < 2:
        return basis
    turned, before = basis, 0.0
    rotation = np.eye(m)
    for _ in range(200):
        turned = basis @ rotation
        slope = basis.T @ (turned**3 - turned * (turned**2).mean(axis=0))
        u, s, v = np.linalg.svd(slope)
        rotation = u @ v
        if s.sum() < before * (1.0 + 1e-10):
            break
        before = float(s.sum())
    return np.asarray(basis @ rotation)


def in_words(weights: Array, names: Sequence[str]) -> str:
    """A direction as ``a − 0.4 b``; weights below a tenth of the largest are left out."""
    top = float(np.abs(weights).max())
    parts: list[str] = []
    for k in np.argsort(-np.abs(weights), kind="stable"):
        share = float(weights[k]) / top
        if abs(share) < 0.1:
            continue
        number = "" if abs(share) > 0.95 else f"{abs(share):.1g} "
        sign = ("− " if share < 0.0 else "+ ") if parts else ("−" if share < 0.0 else "")
        parts.append(f"{sign}{number}{names[int(k)]}")
    return " ".join(parts)


def effective_number(found: Sequence[Direction]) -> float:
    """Parameters that the data are worth, the sum of information / (1 + information) [-]."""
    return float(sum(d.information / (1.0 + d.information) for d in found))


def verdicts(model: Metamodel, posterior: Posterior) -> list[Verdict]:
    """Per parameter: determined, one-sided or open, by its marginal posterior."""
    space = model.space
    prior = space.draw(4096, model.study.options.seed)
    found = []
    for k, parameter in enumerate(space.free):
        x, before = posterior.points[:, k], prior[:, k]
        shrink = float(x.std() / space.prior_sd[k])
        ends = np.quantile(before, [_END, 1.0 - _END])
        at_low = float((x <= ends[0]).mean()) / _END
        at_high = float((x >= ends[1]).mean()) / _END
        low, high = (f"{v:.4g}" for v in _values(model, k, np.quantile(x, [0.05, 0.95])))
        word: Word
        if shrink**2 <= DETERMINED:
            word = "determined"
            sentence = f"{parameter.name} is {low} to {high} (90 %)"
            if max(at_low, at_high) > 3.0:
                side = "low" if at_low > at_high else "high"
                sentence += f", at the {side} end of its range: widen it there"
        elif at_low >= _KEPT and at_high < _GONE:
            word, sentence = "one-sided", f"{parameter.name} is below {high} (95 %)"
        elif at_high >= _KEPT and at_low < _GONE:
            word, sentence = "one-sided", f"{parameter.name} is above {low} (95 %)"
        else:
            word = "open"
            sentence = f"the data leave {parameter.name} open: {low} to {high} (90 %)"
        found.append(Verdict(parameter.name, word, shrink, sentence + "."))
    return found


def _values(model: Metamodel, k: int, ends: Array) -> list[float]:
    points = np.full((len(ends), len(model.space)), 0.5)
    points[:, k] = ends
    return [float(v) for v in model.space.values(points)[:, k]]
