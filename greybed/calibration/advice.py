"""Which test would shrink the ambiguity most, what it carries over to, and held-out checks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2 as chi2_distribution

from greybed.calibration.identify import Direction, slopes
from greybed.calibration.metamodel import Emulator, Metamodel
from greybed.calibration.posterior import Posterior
from greybed.calibration.sensitivity import pearson

Array = NDArray[np.float64]

_SAMPLES = 600


@dataclass(frozen=True)
class NextTest:
    """A test that could be made, with what it is expected to tell.

    Attributes
    ----------
    name : str
        Of the experiment.
    repeat : bool
        Whether it is one that was made, measured once more.
    measures : tuple of str
        What would be measured.
    information : float
        Expected information on the parameters [nat].
    per_cost : float
        That over its cost [nat].
    left : ndarray (d,)
        Standard deviations of the parameters afterwards over those now [-].
    """

    name: str
    repeat: bool
    measures: tuple[str, ...]
    information: float
    per_cost: float
    left: Array


def next_tests(model: Metamodel, posterior: Posterior) -> list[NextTest]:
    """Candidates and repeats, the best one for its cost first.

    Over samples of the posterior a test's measures have the covariance C and would have the errors
    S: the information is 1/2 log det(1 + S^-1 C), as of a linear model with this covariance
    (Lindley, Ann. Math. Stat. 27 (1956) 986).
    """
    step = max(1, len(posterior.points) // _SAMPLES)
    points = posterior.points[::step]
    found = []
    for name in model.study.with_role("calibration", "candidate"):
        repeat = model.study.roles[name] == "calibration"
        emulators = [
            e for e in (model.emulators if repeat else model.others.values())
            if e.response.experiment == name
        ]  # fmt: skip
        if not emulators:
            continue
        means, errors = [], []
        for emulator in emulators:
            mean, sd = emulator.predict(points)
            means.append(mean)
            errors.append(emulator.response.covariance + np.diag((sd**2).mean(axis=0)))
        m = np.concatenate(means, axis=1)
        k = m.shape[1]
        s = np.zeros((k, k))
        at = 0
        for e in errors:
            s[at : at + len(e), at : at + len(e)] = e
            at += len(e)
        c = np.atleast_2d(np.cov(m, rowvar=False))
        gain = 0.5 * float(np.linalg.slogdet(np.eye(k) + np.linalg.solve(s, c))[1])
        x = points - points.mean(axis=0)
        across = x.T @ (m - m.mean(axis=0)) / (len(points) - 1)
        now = x.var(axis=0, ddof=1)
        less = np.einsum("ij,ij->i", across, np.linalg.solve(c + s, across.T).T)
        left = np.sqrt(np.maximum(now - less, 0.0) / np.maximum(now, 1e-12))
        cost = max(model.study.efforts.get(name, 1.0), 1e-9)
        measures = tuple(e.response.measure for e in emulators)
        found.append(NextTest(name, repeat, measures, gain, gain / cost, left))
    return sorted(found, key=lambda t: -t.per_cost)


@dataclass(frozen=True)
class Transfer:
    """Whether a process asks for what the data have determined.

    Attributes
    ----------
    label : str
        Process and measure.
    cosine : mapping of str to float
        With each calibration measure: of the correlations with the parameters, sign apart [-].
    covered : float
        Share of the process's squared slope at the answer in determined directions [-].
    interval : (float, float, float)
        5, 50 and 95 % of the prediction over the posterior, in its unit.
    before : (float, float)
        5 and 95 % over the prior.
    """

    label: str
    cosine: dict[str, float]
    covered: float
    interval: tuple[float, float, float]
    before: tuple[float, float]


def transfers(
    model: Metamodel, posterior: Posterior, best: Array, found: list[Direction], seed: int
) -> list[Transfer]:
    """Checks of all measures of the processes of a study."""
    rng = np.random.default_rng([seed, 91])
    step = max(1, len(posterior.points) // 2000)
    after, before = posterior.points[::step], model.space.draw(2048, seed)
    results = []
    for emulator in model.others.values():
        if model.study.roles[emulator.response.experiment] != "process":
            continue
        own = pearson(emulator)
        cosines = {}
        for other in model.emulators:
            theirs = pearson(other)
            size = float(np.linalg.norm(own) * np.linalg.norm(theirs))
            cosines[other.response.label] = abs(float(own @ theirs)) / size if size > 0.0 else 0.0
        slope = slopes(emulator, best, model.space.prior_sd)[0][0]
        known = sum(float(slope @ d.weights) ** 2 for d in found if d.determined)
        total = float(slope @ slope)
        q = np.quantile(_drawn(emulator, after, rng), [0.05, 0.5, 0.95])
        p = np.quantile(_drawn(emulator, before, rng), [0.05, 0.95])
        results.append(
            Transfer(
                emulator.response.label, cosines, known / total if total > 0.0 else 1.0,
                (float(q[0]), float(q[1]), float(q[2])), (float(p[0]), float(p[1])),
            )
        )  # fmt: skip
    return results


def _drawn(emulator: Emulator, points: Array, rng: np.random.Generator) -> Array:
    mean, sd = emulator.predict(points)
    return np.asarray(mean[:, 0] + sd[:, 0] * rng.standard_normal(len(points)))


@dataclass(frozen=True)
class Check:
    """A measured value against its prediction over the posterior.

    Attributes
    ----------
    label : str
        Experiment and measure.
    held_out : bool
        Whether it was not used to fit.
    measured, sd : float
        Value and its error; of a curve the root mean square of the difference and of its error.
    predicted, predicted_sd : float
        Mean and sd of the prediction; of a curve 0 and NaN.
    pull : float
        Difference over all errors together; of a curve the root of chi-squared over its freedom.
    p : float
        Chance of a difference as large [-].
    """

    label: str
    held_out: bool
    measured: float
    sd: float
    predicted: float
    predicted_sd: float
    pull: float
    p: float


def checks(model: Metamodel, posterior: Posterior) -> list[Check]:
    """All measured data against the posterior's predictions; held-out experiments last."""
    step = max(1, len(posterior.points) // 1000)
    points = posterior.points[::step]
    found = []
    held = [
        e for e in model.others.values()
        if model.study.roles[e.response.experiment] == "validation"
    ]  # fmt: skip
    for emulator in [*model.emulators, *held]:
        mean, sd = emulator.predict(points)
        k = mean.shape[1]
        spread = np.atleast_2d(np.cov(mean, rowvar=False)) if len(mean) > 1 else np.zeros((k, k))
        total = spread + np.diag((sd**2).mean(axis=0)) + emulator.response.covariance
        if emulator.response.single:
            total = total + np.diag([s.noise**2 for s in emulator.surrogates])
        off = mean.mean(axis=0) - emulator.response.value
        size = float(off @ np.linalg.solve(total, off))
        r = emulator.response
        p = float(chi2_distribution.sf(size + r.outside, k + r.outside_freedom))
        out = emulator in held
        if r.shapes is None:
            value, error = float(r.value[0]), float(np.sqrt(r.covariance[0, 0]))
            around = float(np.sqrt(max(total[0, 0] - error**2, 0.0)))
            predicted = float(mean.mean())
            found.append(
                Check(r.label, out, value, error, predicted, around,
                      (predicted - value) / float(np.sqrt(total[0, 0])), p)
            )  # fmt: skip
            continue
        assert r.sd is not None
        curve = r.shapes.T @ off * r.sd
        found.append(
            Check(r.label, out, float(np.sqrt(np.mean(curve**2))),
                  float(np.sqrt(np.mean(r.sd**2))), 0.0, float("nan"),
                  float(np.sqrt((size + r.outside) / (k + r.outside_freedom))), p)
        )  # fmt: skip
    return found


def what_limits(model: Metamodel, shares: dict[str, tuple[float, float, float]]) -> str:
    """Whether better data, more replicates or more runs would help, in words."""
    mean = np.array(list(shares.values())).mean(axis=0)
    which = int(mean.argmax())
    if which == 0:
        return (
            f"Errors of the measurements are {100.0 * mean[0]:.0f} % of the variance: more runs "
            "would tell little, another or a better measurement would."
        )
    if which == 1:
        return (
            f"The scatter of replicates is {100.0 * mean[1]:.0f} % of the variance: repeat runs "
            "near the best set, or take larger samples in the experiments."
        )
    return (
        f"The surrogates' error is {100.0 * mean[2]:.0f} % of the variance: more runs would narrow "
        "the answer."
    )
