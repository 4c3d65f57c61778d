"""Quality of the surrogates and what they respond to: CoP, Pearson, Sobol indices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.calibration.metamodel import Emulator, Metamodel
from greybed.calibration.parameters import Space

Array = NDArray[np.float64]

_BOOTSTRAP = 200
_SOBOL = 1024


@dataclass(frozen=True)
class Quality:
    """How well the surrogates of a measure predict runs that they have not seen.

    Attributes
    ----------
    label : str
        Experiment and measure.
    cop, cop_sd : float
        Coefficient of prognosis, 1 - SSE / SST of points left out, and its standard error [-].
    ceiling : float
        What the scatter of replicates leaves possible [-].
    noise : float
        Standard deviation of a single replicate, in the unit of the measure; of curves in units
        of their error, rms over the shapes.
    runs : int
        Points that it is fitted to [-].
    """

    label: str
    cop: float
    cop_sd: float
    ceiling: float
    noise: float
    runs: int


def quality(emulator: Emulator, seed: int) -> Quality:
    """Coefficient of prognosis of a measure; the shapes of a curve count by their variance.

    It is 1 - SSE / SST as in Most & Will (2008), with the error from a bootstrap of the points.
    """
    samples = [s.sample for s in emulator.surrogates]  # type: ignore[attr-defined]
    truth = np.column_stack([s.y for s in samples])
    left = np.column_stack([s.leave_out()[0] for s in emulator.surrogates])
    error, spread = (truth - left) ** 2, (truth - truth.mean(axis=0)) ** 2
    n = len(truth)
    rng = np.random.default_rng([seed, 81])
    picks = rng.integers(n, size=(_BOOTSTRAP, n))
    many = 1.0 - error[picks].sum(axis=(1, 2)) / np.maximum(spread[picks].sum(axis=(1, 2)), 1e-300)
    noise = np.array([s.noise for s in emulator.surrogates])
    counts = samples[0].counts
    floor = float((noise**2).sum() * (1.0 / counts).sum())
    total = max(float(spread.sum()), 1e-300)
    return Quality(
        emulator.response.label,
        1.0 - float(error.sum()) / total,
        float(many.std()),
        max(0.0, 1.0 - floor / total),
        float(np.sqrt((noise**2).sum())),
        n,
    )


def pearson(emulator: Emulator) -> Array:
    """Correlation of each parameter with a measure over the runs, (d,) [-1 to 1].

    Of a curve, that with its first shape.
    """
    sample = emulator.surrogates[0].sample  # type: ignore[attr-defined]
    x, y = sample.x - sample.x.mean(axis=0), sample.y - sample.y.mean()
    size = np.sqrt((x**2).sum(axis=0) * (y**2).sum())
    return np.asarray((x * y[:, None]).sum(axis=0) / np.where(size > 0.0, size, 1.0))


def sobol_indices(emulator: Emulator, space: Space, seed: int) -> tuple[Array, Array]:
    """First-order and total shares of the variance of a measure over the prior.

    Parameters
    ----------
    emulator : Emulator
        Surrogates of the measure.
    space : Space
        Prior.
    seed : int
        Of the points.

    Returns
    -------
    first, total : ndarray (d,)
        Saltelli's and Jansen's estimators (Saltelli et al., Comput. Phys. Commun. 181 (2010) 259,
        table 2) on the means of the surrogates [-]; of a curve the shapes count by variance.
    """
    from scipy.stats import qmc

    d = len(space)
    both = qmc.Sobol(2 * d, rng=np.random.default_rng([seed, 82])).random(_SOBOL)
    a, b = space.from_prior(both[:, :d]), space.from_prior(both[:, d:])
    fa, fb = emulator.predict(a)[0], emulator.predict(b)[0]
    variance = np.concatenate([fa, fb]).var(axis=0).sum()
    first, total = np.zeros(d), np.zeros(d)
    if variance <= 0.0:
        return first, total
    fb = fb - fa.mean(axis=0)
    fa = fa - fa.mean(axis=0)
    for k in range(d):
        mixed = a.copy()
        mixed[:, k] = b[:, k]
        fm = emulator.predict(mixed)[0] - emulator.predict(a)[0].mean(axis=0)
        first[k] = float((fb * (fm - fa)).mean(axis=0).sum()) / variance
        total[k] = float(0.5 * ((fa - fm) ** 2).mean(axis=0).sum()) / variance
    return first, total


@dataclass(frozen=True)
class Budget:
    """Variances of a measure at the answer, mean over the posterior, in units of their sum.

    Attributes
    ----------
    label : str
        Experiment and measure.
    measurement, replicates, surrogate : float
        Shares of the error of the measurement, of finite replicates, and of the surrogate [-].
    total : float
        Standard deviation, in the unit of the measure (curves: of their errors).
    """

    label: str
    measurement: float
    replicates: float
    surrogate: float
    total: float


def budget(emulator: Emulator, samples: Array) -> Budget:
    """Error budget of a measure over samples of the posterior."""
    _, sd = emulator.predict(samples)
    variance = sd**2
    share = np.column_stack([s.spread_of_replicates(samples) for s in emulator.surrogates])
    replicates = float((share * variance).sum(axis=1).mean())
    if emulator.response.single:
        replicates += float(sum(s.noise**2 for s in emulator.surrogates))
    measured = float(np.trace(emulator.response.covariance))
    rest = float(((1.0 - share) * variance).sum(axis=1).mean())
    total = measured + replicates + rest
    k = sd.shape[1]
    return Budget(
        emulator.response.label, measured / total, replicates / total, rest / total,
        float(np.sqrt(total / k)),
    )  # fmt: skip


def unresponsive(model: Metamodel) -> list[str]:
    """Measures whose runs show no response to any parameter beyond their scatter."""
    quiet = []
    for emulator in model.emulators:
        found = quality(emulator, 0)
        if found.cop < 2.0 * found.cop_sd and found.cop < 0.1:
            quiet.append(emulator.response.label)
    return quiet
