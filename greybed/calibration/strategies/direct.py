"""Direct search on the simulator: CMA-ES, and Bayesian optimisation of the misfit.

Both look at the misfit of single runs, with the errors of measurement and replicates, and know no
surrogate of the measures. All their runs are kept, so surrogates are fitted in the end as for any
other strategy, and the answer has the same form.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray
from scipy.special import erf

from greybed.calibration.designs import first_design
from greybed.calibration.experiment import Value
from greybed.calibration.responses import on_places
from greybed.calibration.search import Search
from greybed.calibration.study import Study
from greybed.calibration.surrogates import GaussianProcess, Sample

Array = NDArray[np.float64]

# Where a run fails its misfit is unknown; the search takes it to be as bad as the worst so far.
_UNKNOWN = math.inf


def misfit_of(study: Study, results: Mapping[str, Mapping[str, Value] | None]) -> float:
    """Mean squared error of runs against the data, in units of the measurement's errors.

    Parameters
    ----------
    study : Study
        With the data.
    results : mapping of str to results
        Of one run of each calibration experiment; None where it failed.

    Returns
    -------
    float
        Mean over the measures; infinite where a run failed [-].
    """
    parts = []
    for target in study.targets:
        if study.roles[target.experiment] != "calibration":
            continue
        found = results.get(target.experiment)
        if found is None:
            return _UNKNOWN
        value = found[target.measure]
        if target.at is None:
            off = (np.array([float(value)]) - target.value) / target.sd  # type: ignore[arg-type]
        else:
            off = (on_places(value, target.at) - target.value) / target.sd
        parts.append(float(np.mean(off**2)))
    return float(np.mean(parts))


class _Direct:
    """Misfits at points, one run of each experiment for each."""

    def __init__(self, search: Search) -> None:
        self.search = search
        self.names = search.study.with_role("calibration")

    @property
    def left(self) -> int:
        """Points that may still be run [-]."""
        return self.search.left // len(self.names)

    def misfits(self, points: Array) -> Array:
        """Misfit at each point, infinite where a run failed, (n,)."""
        search, names = self.search, self.names
        points = points[: self.left]
        counts: dict[tuple[float, ...], int] = {}
        for job, _ in search.campaign.finished:
            at = tuple(v for _, v in job.values)
            counts[at] = counts.get(at, 0) + (job.experiment == names[0])
        wanted = []
        for u in points:
            at = tuple(search.study.space.named(u).values())
            replicate = counts.get(at, 0)
            counts[at] = replicate + 1
            wanted += [(name, u, replicate) for name in names]
        outcomes = search.make(wanted)
        n = len(names)
        values = []
        for k in range(len(points)):
            some = outcomes[k * n : (k + 1) * n]
            values.append(misfit_of(search.study, {o.experiment: o.results for o in some}))
        return np.array(values)


def cma_es(search: Search) -> None:
    """Covariance matrix adaptation (Hansen, arXiv:1604.00772, with its default constants).

    Points outside the ranges are mirrored back into them.
    """
    direct, d = _Direct(search), len(search.study.space)
    rng = np.random.default_rng([search.study.options.seed, 71])
    size = 4 + int(3 * math.log(d))
    half = size // 2
    w = math.log((size + 1) / 2) - np.log(np.arange(1, half + 1))
    w /= w.sum()
    mass = 1.0 / float((w**2).sum())
    cs = (mass + 2) / (d + mass + 5)
    ds = 1 + 2 * max(0.0, math.sqrt((mass - 1) / (d + 1)) - 1) + cs
    cc = (4 + mass / d) / (d + 4 + 2 * mass / d)
    c1 = 2 / ((d + 1.3) ** 2 + mass)
    cmu = min(1 - c1, 2 * (mass - 2 + 1 / mass) / ((d + 2) ** 2 + mass))
    chi = math.sqrt(d) * (1 - 1 / (4 * d) + 1 / (21 * d**2))
    mean, step, covariance = np.full(d, 0.5), 0.25, np.eye(d)
    path_s, path_c = np.zeros(d), np.zeros(d)
    generation = 0
    while direct.left > 0:
        generation += 1
        scale, axes = np.linalg.eigh(covariance)
        root = axes * np.sqrt(np.maximum(scale, 1e-16))
        drawn = rng.standard_normal((size, d)) @ root.T
        points = mirrored(mean + step * drawn)
        values = direct.misfits(points)
        if len(values) < size:
            break
        order = np.argsort(values, kind="stable")[:half]
        # The steps that were taken, after mirroring.
        best = (points[order] - mean) / step
        move = w @ best
        mean = np.clip(mean + step * move, 0.0, 1.0)
        inverse = axes @ np.diag(1.0 / np.sqrt(np.maximum(scale, 1e-16))) @ axes.T
        path_s = (1 - cs) * path_s + math.sqrt(cs * (2 - cs) * mass) * (inverse @ move)
        length = float(np.linalg.norm(path_s))
        calm = length / math.sqrt(1 - (1 - cs) ** (2 * generation)) < (1.4 + 2 / (d + 1)) * chi
        path_c = (1 - cc) * path_c + calm * math.sqrt(cc * (2 - cc) * mass) * move
        covariance = (
            (1 - c1 - cmu + (1 - calm) * c1 * cc * (2 - cc)) * covariance
            + c1 * np.outer(path_c, path_c)
            + cmu * (best.T * w) @ best
        )
        step *= math.exp(min(1.0, cs / ds * (length / chi - 1)))
        step = min(step, 0.5)


def mirrored(x: Array) -> Array:
    """Points mirrored at the faces of the unit cube into it."""
    x = np.abs(np.mod(x, 2.0))
    return np.asarray(np.where(x > 1.0, 2.0 - x, x))


def bayesian_optimisation(search: Search) -> None:
    """Expected improvement of the logarithm of the misfit (Jones, Schonlau & Welch, 1998)."""
    direct, study = _Direct(search), search.study
    o, space = study.options, study.space
    first = first_design(o.design, search.first_points(), len(space), o.seed)
    points = space.from_prior(first)
    values = direct.misfits(points)
    points = points[: len(values)]
    hyper: Array | None = None
    rng = np.random.default_rng([o.seed, 72])
    while direct.left > 0:
        good = np.isfinite(values)
        if good.sum() < 3:
            new = rng.random((1, len(space)))
        else:
            worst = values[good].max()
            y = np.log(np.where(good, values, worst) + 0.05)
            model = GaussianProcess(Sample.of(points, y), hyper)
            hyper = model.hyper
            new = _most_promising(model, points[int(np.argmin(y))], rng)
        value = direct.misfits(new)
        points, values = np.concatenate([points, new]), np.concatenate([values, value])


def _most_promising(model: GaussianProcess, best: Array, rng: np.random.Generator) -> Array:
    """The candidate of largest expected improvement over the best mean so far, (1, d)."""
    d = len(best)
    near = np.clip(best + 0.08 * rng.standard_normal((400, d)), 0.0, 1.0)
    candidates = np.concatenate([rng.random((1200, d)), near])
    mean, sd = model.predict(candidates)
    least = float(model.predict(model.sample.x)[0].min())
    z = (least - mean) / sd
    cdf = 0.5 * (1.0 + erf(z / math.sqrt(2.0)))
    gain = (least - mean) * cdf + sd * np.exp(-0.5 * z**2) / math.sqrt(2.0 * math.pi)
    return candidates[[int(np.argmax(gain))]]
