"""Heat of a case in the words of LAMMPS, and the temperatures that it gives back."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.dem.runner import ParticleRun

Array = NDArray[np.float64]


def conduction(run: ParticleRun, first: int, second: int) -> str:
    """Heat through contacts of two materials: 2 k a dT in both engines, k their harmonic mean."""
    heat = run.heat
    if heat is None:
        return ""
    a, b = heat._conductivity[[first, second]]
    return f" heat radius {float(2.0 * a * b / (a + b) * heat._narrower)!r}"


def temperatures(run: ParticleRun) -> list[str]:
    """Temperatures at the start, and what changes them."""
    heat = run.heat
    if heat is None:
        return []
    lines = ["compute warm all property/atom temperature"]
    labels = run.simulation.labels
    by_label = sorted(zip((labels + 1).tolist(), heat.temperatures.tolist(), strict=True))
    for value, group in itertools.groupby(by_label, key=lambda pair: pair[1]):
        names = [name for name, _ in group]
        lines.append(f"set atom {names[0]}*{names[-1]} temperature {value!r}")
    words = " ".join(f"{float(c)!r}" for c in heat._capacity)
    return [*lines, f"fix flow all heat/flow type {words}"]


class Warmth:
    """Temperatures of a run by LAMMPS, by the names of :class:`greybed.dem.heat.Heat`.

    Parameters
    ----------
    run : LammpsRun
        Whose last state counts; its rows have the temperature [K] last.
    capacity : ndarray, shape (materials,)
        [J/kg/K]
    warm : list of bool
        Which walls have a temperature: one at most, so that it has given what is there.
    beside : str
        What else gives heat, in words: a fix that radiates is in the same sum.
    """

    def __init__(self, run: Any, capacity: Array, warm: list[bool], beside: str = "") -> None:
        self.beside = beside
        self._run, self._capacity, self._warm = run, capacity, np.array(warm, dtype=bool)
        self._start = self._content()

    def _content(self) -> float:
        """Heat of all particles over 0 K [J]."""
        return float(self.capacities @ self.temperatures)

    @property
    def temperatures(self) -> Array:
        """Shape (n,) [K]."""
        return self._run.simulation.rows[:, -1].copy()

    @property
    def capacities(self) -> Array:
        """Heat capacities of the particles, shape (n,) [J/K]."""
        sim = self._run.simulation
        return sim.masses * self._capacity[sim.kinds]

    @property
    def mean(self) -> float:
        """Mean temperature, weighted by heat capacity [K]."""
        return self._content() / float(self.capacities.sum())

    @property
    def from_walls(self) -> Array:
        """Heat that each wall has given, shape (walls,) [J]."""
        return np.where(self._warm, self._content() - self._start, 0.0)
