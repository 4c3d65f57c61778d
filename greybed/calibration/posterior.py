"""Samples of the posterior on the surrogates: tempering, then chains that are checked.

Points of the prior are tempered towards the posterior (sequential Monte Carlo: Del Moral, Doucet &
Jasra, J. R. Stat. Soc. B 68 (2006) 411); chains that start there move by differences of two of the
tempered points (ter Braak & Vrugt, Stat. Comput. 18 (2008) 435), which follow curved valleys and
jump between separate ones; a fifth of the moves are drawn anew from a kernel density of these
points (an independence sampler), so that none stays in a tail. R-hat and the effective size are
those of split chains (Gelman et al., Bayesian Data Analysis, 3rd ed., section 11.4-5; Vehtari et
al., Bayesian Anal. 16 (2021) 667).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import minimum_spanning_tree

from greybed.calibration.parameters import Space

Array = NDArray[np.float64]
Density = Callable[[Array], Array]

PARTICLES = 1024
CHAINS = 32
STEPS = 900  # of each chain, of which the first third is dropped
_MOVES = 3  # of each particle at each temperature
_ANEW = 0.2  # share of steps that draw from the kernel density
_JUMP = 0.1  # share of moves of full length, which may change the valley
_WIDE, _TAIL = 0.1, 3.0  # share and width of the wide kernels
REGION = 0.9


@dataclass(frozen=True)
class Posterior:
    """Samples and how good they are.

    Attributes
    ----------
    points : ndarray (n, d)
        In the unit cube.
    density : ndarray (n,)
        Logarithm of the posterior density up to a constant.
    r_hat : ndarray (d,)
        Near 1 where chains agree [-].
    effective : float
        Independent samples that the means are worth, the least over the axes [-].
    """

    points: Array
    density: Array
    r_hat: Array
    effective: float

    @property
    def best(self) -> Array:
        """The sample of highest density, (d,)."""
        return self.points[int(self.density.argmax())]

    def interval(self, share: float = REGION) -> Array:
        """Central intervals of each axis, (d, 2) [-]."""
        ends = [0.5 - 0.5 * share, 0.5 + 0.5 * share]
        return np.quantile(self.points, ends, axis=0).T

    def level(self, share: float = REGION) -> float:
        """Log density above which the region of highest density with this share lies."""
        return float(np.quantile(self.density, 1.0 - share))

    def modes(self, share: float = REGION) -> int:
        """Separate parts of the region of highest density [-]."""
        inside = self.points[self.density >= self.level(share)]
        step = max(1, len(inside) // 400)
        x = inside[::step] / np.maximum(self.points.std(axis=0), 1e-9)
        if len(x) < 20:
            return 1
        apart = np.sqrt(((x[:, None, :] - x) ** 2).sum(axis=2)) + 1e-12
        edges = np.sort(minimum_spanning_tree(apart).data)
        # In one cloud neighbours in the tree are about equally far; a gap is many times as wide.
        gap = max(6.0 * float(np.quantile(edges, 0.9)), 0.5)
        return 1 + int((edges > gap).sum())


def sample_posterior(
    density: Density, space: Space, seed: int, *, particles: int = PARTICLES, steps: int = STEPS
) -> Posterior:
    """Sample a posterior density over the unit cube.

    Parameters
    ----------
    density : callable
        Logarithm of prior times likelihood at points (n, d), up to a constant.
    space : Space
        Where, and the prior to begin with.
    seed : int
        Of the random numbers.
    particles, steps : int
        Tempered points, steps of each chain [-].
    """
    rng = np.random.default_rng([seed, 41])
    cloud, values = _temper(density, space, rng, particles)
    chains = rng.choice(len(cloud), CHAINS, replace=False)
    x, f = cloud[chains].copy(), values[chains].copy()
    kept, heights = [], []
    kernels = _Kernels(cloud)
    for step in range(steps):
        if rng.random() < _ANEW:
            x, f = kernels.move(density, x, f, rng)
        else:
            x, f = _move(density, x, f, cloud, rng)
        if step >= steps // 3:
            kept.append(x.copy())
            heights.append(f.copy())
    track = np.array(kept)  # (steps, chains, d)
    r_hat, size = convergence(track)
    return Posterior(
        track.reshape(-1, track.shape[2]), np.array(heights).ravel(), r_hat, float(size.min())
    )


def _temper(
    density: Density, space: Space, rng: np.random.Generator, particles: int
) -> tuple[Array, Array]:
    """Points of the prior, brought to the posterior by degrees."""
    x = space.draw(particles, int(rng.integers(2**31)))
    f = density(x)
    prior = space.log_prior(x)
    beta = 0.0
    while beta < 1.0:
        like = f - prior
        finite = np.where(np.isfinite(like), like, -np.inf)
        step = _next_step(finite, 1.0 - beta)
        weight = np.exp(step * (finite - finite.max()))
        beta = min(1.0, beta + step)
        places = (np.arange(particles) + rng.random()) / particles
        chosen = np.searchsorted(np.cumsum(weight) / weight.sum(), places)
        chosen = np.minimum(chosen, particles - 1)
        x, f, prior = x[chosen], f[chosen], prior[chosen]
        for _ in range(_MOVES):
            tempered = prior + beta * (f - prior)
            new, value, take = _proposed(density, x, tempered, x.copy(), rng, space, beta)
            x = np.where(take[:, None], new, x)
            f = np.where(take, value, f)
            prior = space.log_prior(x)
    return x, f


def _next_step(like: Array, most: float) -> float:
    """The step of temperature that leaves half of the points effective."""

    def effective(step: float) -> float:
        w = np.exp(step * (like - like.max()))
        return float(w.sum() ** 2 / (w**2).sum())

    goal = 0.5 * len(like)
    if effective(most) >= goal:
        return most
    low, high = 0.0, most
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if effective(middle) >= goal else (low, middle)
    return max(high, 1e-6)


def _proposal(x: Array, cloud: Array, rng: np.random.Generator) -> Array:
    n, d = x.shape
    a, b = rng.integers(len(cloud), size=(2, n))
    length = np.where(rng.random(n) < _JUMP, 1.0, 2.38 / np.sqrt(2.0 * d) * rng.random(n) ** 0.3)
    jitter = 1e-4 * rng.standard_normal((n, d))
    return np.asarray(x + length[:, None] * (cloud[a] - cloud[b]) + jitter)


def _proposed(
    density: Density, x: Array, tempered: Array, cloud: Array, rng: np.random.Generator,
    space: Space, beta: float,
) -> tuple[Array, Array, NDArray[np.bool_]]:  # fmt: skip
    new = _proposal(x, cloud, rng)
    value = density(new)
    prior = space.log_prior(new)
    with np.errstate(invalid="ignore"):
        height = np.where(np.isfinite(value), prior + beta * (value - prior), -np.inf)
    take = np.log(rng.random(len(x))) < height - tempered
    return new, value, take


def _move(
    density: Density, x: Array, f: Array, cloud: Array, rng: np.random.Generator
) -> tuple[Array, Array]:
    new = _proposal(x, cloud, rng)
    value = density(new)
    take = np.log(rng.random(len(x))) < value - f
    return np.where(take[:, None], new, x), np.where(take, value, f)


class _Kernels:
    """Normal kernels around points (Silverman's width), one in ten of three times the width."""

    def __init__(self, points: Array) -> None:
        n, d = points.shape
        self._points = points
        spread = np.atleast_2d(np.cov(points, rowvar=False)) + 1e-10 * np.eye(d)
        width = (4.0 / (d + 2.0) / n) ** (1.0 / (d + 4.0))
        self._root = np.linalg.cholesky(spread) * width

    def _log(self, x: Array) -> Array:
        """Log density up to a constant, (n,)."""
        z = np.linalg.solve(self._root, np.concatenate([x, self._points]).T).T
        a, b = z[: len(x)], z[len(x) :]
        square = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - 2.0 * a @ b.T
        d = x.shape[1]
        wide = _WIDE / _TAIL**d * np.exp(-0.5 * square / _TAIL**2)
        return np.asarray(np.log(((1.0 - _WIDE) * np.exp(-0.5 * square) + wide).sum(axis=1)
                                 + 1e-300))  # fmt: skip

    def move(
        self, density: Density, x: Array, f: Array, rng: np.random.Generator
    ) -> tuple[Array, Array]:
        """A step of the independence sampler."""
        n, d = x.shape
        length = np.where(rng.random(n) < _WIDE, _TAIL, 1.0)[:, None]
        new = self._points[rng.integers(len(self._points), size=n)] + length * (
            rng.standard_normal((n, d)) @ self._root.T
        )
        value = density(new)
        take = np.log(rng.random(n)) < value - f + self._log(x) - self._log(new)
        return np.where(take[:, None], new, x), np.where(take, value, f)


def convergence(track: Array) -> tuple[Array, Array]:
    """R-hat and effective size of chains.

    Parameters
    ----------
    track : ndarray (steps, chains, d)
        Samples [-].

    Returns
    -------
    r_hat, effective : ndarray (d,)
        Of split chains [-].
    """
    half = len(track) // 2
    split = np.concatenate([track[:half], track[half : 2 * half]], axis=1)
    n, m, d = split.shape
    within = split.var(axis=0, ddof=1).mean(axis=0)
    between = n * split.mean(axis=0).var(axis=0, ddof=1)
    total = (n - 1) / n * within + between / n
    safe = np.where(within > 0.0, within, 1.0)
    r_hat = np.where(within > 0.0, np.sqrt(total / safe), 1.0)
    centred = split - split.mean(axis=0)
    size = 2 ** int(np.ceil(np.log2(2 * n)))
    power = np.abs(np.fft.rfft(centred, size, axis=0)) ** 2
    covariance = np.fft.irfft(power, size, axis=0)[:n].mean(axis=1) / n
    effective = np.empty(d)
    for k in range(d):
        if total[k] <= 0.0:
            effective[k] = n * m
            continue
        rho = 1.0 - (within[k] - covariance[:, k] * n / (n - 1)) / total[k]
        pairs = rho[1 : n - n % 2 - 1 : 2] + rho[2 : n - n % 2 : 2]
        stop = int(np.argmax(pairs < 0.0)) if (pairs < 0.0).any() else len(pairs)
        pairs = np.minimum.accumulate(pairs[:stop]) if stop else pairs[:0]
        effective[k] = n * m / max(1.0 + 2.0 * float(pairs.sum()), 1.0 / np.log10(n * m))
    return r_hat, effective
