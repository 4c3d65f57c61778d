"""Parameters with ranges and priors, and the unit cube in which everything is fitted."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtr, ndtri
from scipy.stats import qmc

from greybed.core.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A number of the simulation: fixed, or free within a range.

    Parameters
    ----------
    name : str
        Its name in the experiments.
    value : float, optional
        Fixed at this number [SI].
    low, high : float, optional
        Range in which it is looked for [SI].
    log : bool
        Its logarithm is what is uniform; the range must be positive.
    mean, sd : float, optional
        Normal prior, cut at the range [SI; of the natural logarithm where ``log`` is set, the sd
        then being relative].
    group : int
        Stage of a sequential calibration, from 1.

    Raises
    ------
    InputError
        Without a value or a range, with both, or with bounds in the wrong order.
    """

    name: str
    value: float | None = None
    low: float | None = None
    high: float | None = None
    log: bool = False
    mean: float | None = None
    sd: float | None = None
    group: int = 1

    def __post_init__(self) -> None:
        me = f"parameter {self.name!r}"
        if self.value is not None:
            if self.low is not None or self.high is not None:
                raise InputError(f"{me} has a value and a range; keep one of the two.")
            return
        if self.low is None or self.high is None:
            raise InputError(f"{me} has no range; give low and high, or a value to fix it.")
        if not self.low < self.high:
            raise InputError(
                f"{me}: low = {self.low:g} must be below high = {self.high:g}; exchange them."
            )
        if self.log and self.low <= 0.0:
            raise InputError(
                f"{me}: low = {self.low:g} must be above 0 where log = true; raise it."
            )
        if (self.mean is None) != (self.sd is None):
            raise InputError(f"{me}: a prior has mean and sd; give both, or none.")
        if self.sd is not None and self.mean is not None:
            if not self.sd > 0.0:
                raise InputError(f"{me}: sd = {self.sd:g} of the prior must be above 0.")
            if not self.low <= self.mean <= self.high:
                raise InputError(
                    f"{me}: mean = {self.mean:g} of the prior must be within its range, "
                    f"{self.low:g} to {self.high:g}."
                )

    @property
    def free(self) -> bool:
        """Whether it is looked for."""
        return self.value is None

    def ends(self) -> tuple[float, float]:
        """Range on the scale on which it is uniform."""
        assert self.low is not None
        assert self.high is not None
        return (math.log(self.low), math.log(self.high)) if self.log else (self.low, self.high)

    def normal(self) -> tuple[float, float] | None:
        """Mean and sd of the prior in the unit interval; None where it is uniform [-]."""
        if self.mean is None or self.sd is None:
            return None
        a, b = self.ends()
        centre = math.log(self.mean) if self.log else self.mean
        return (centre - a) / (b - a), self.sd / (b - a)


class Space:
    """The free parameters as a unit cube; a row of it is a point ``u``.

    Parameters
    ----------
    parameters : sequence of Parameter
        Fixed and free ones [SI].

    Raises
    ------
    InputError
        If none is free, or a name is used twice.
    """

    def __init__(self, parameters: Sequence[Parameter]) -> None:
        names = [p.name for p in parameters]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(f"parameter {twice[0]!r} is there twice; keep one of them.")
        self.parameters = tuple(parameters)
        self.free = tuple(p for p in parameters if p.free)
        self.fixed = {p.name: float(p.value) for p in parameters if p.value is not None}
        if not self.free:
            raise InputError("no parameter is free; give at least one a range, low and high.")
        self.names = tuple(p.name for p in self.free)
        ends = np.array([p.ends() for p in self.free])
        self._low, self._width = ends[:, 0], ends[:, 1] - ends[:, 0]
        self._log = np.array([p.log for p in self.free])
        self._normal = [p.normal() for p in self.free]

    def __len__(self) -> int:
        return len(self.free)

    def values(self, u: ArrayLike) -> Array:
        """Points of the cube in SI, shape (n, d)."""
        x = self._low + np.atleast_2d(np.asarray(u, float)) * self._width
        return np.where(self._log, np.exp(np.where(self._log, x, 0.0)), x)

    def unit(self, values: ArrayLike) -> Array:
        """Points in SI as points of the cube, shape (n, d)."""
        x = np.atleast_2d(np.asarray(values, float))
        x = np.where(self._log, np.log(np.where(self._log, x, 1.0)), x)
        return np.asarray((x - self._low) / self._width)

    def named(self, u: ArrayLike) -> dict[str, float]:
        """All parameters at one point, free and fixed ones, by name [SI].

        Numbers have twelve digits, so that a file that is read again gives the same run.
        """
        row = self.values(u)[0]
        return {
            **self.fixed,
            **{n: float(f"{v:.12g}") for n, v in zip(self.names, row, strict=True)},
        }

    def of(self, named: Mapping[str, float]) -> Array:
        """The point of the cube with these values [SI], shape (d,)."""
        return self.unit([[named[name] for name in self.names]])[0]

    def log_prior(self, u: Array) -> Array:
        """Logarithm of the prior density up to a constant; -inf outside the cube, shape (n,)."""
        density = np.where(((u >= 0.0) & (u <= 1.0)).all(axis=1), 0.0, -np.inf)
        for k, normal in enumerate(self._normal):
            if normal is not None:
                density = density - 0.5 * ((u[:, k] - normal[0]) / normal[1]) ** 2
        return density

    def from_prior(self, uniform: Array) -> Array:
        """Uniform numbers to points that are distributed as the prior, shape (n, d)."""
        u = np.array(uniform, float)
        for k, normal in enumerate(self._normal):
            if normal is not None:
                a, b = ndtr((0.0 - normal[0]) / normal[1]), ndtr((1.0 - normal[0]) / normal[1])
                u[:, k] = normal[0] + normal[1] * ndtri(a + u[:, k] * (b - a))
        return np.clip(u, 0.0, 1.0)

    def draw(self, n: int, seed: int) -> Array:
        """Points of the prior, evenly spread (scrambled Sobol sequence), shape (n, d)."""
        power = max(1, math.ceil(math.log2(max(n, 2))))
        sampler = qmc.Sobol(len(self), rng=np.random.default_rng([seed, 11]))
        return self.from_prior(sampler.random_base2(power)[:n])

    @property
    def prior_sd(self) -> Array:
        """Standard deviation of the prior in the cube, shape (d,) [-]."""
        sds = []
        for normal in self._normal:
            if normal is None:
                sds.append(1.0 / math.sqrt(12.0))
                continue
            m, s = normal
            t = (np.arange(2000) + 0.5) / 2000.0
            w = np.exp(-0.5 * ((t - m) / s) ** 2)
            centre = float((w * t).sum() / w.sum())
            sds.append(math.sqrt(float((w * (t - centre) ** 2).sum() / w.sum())))
        return np.array(sds)
