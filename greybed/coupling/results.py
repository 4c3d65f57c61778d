"""What a thermal solve gives back: temperatures, heat flows, and how the solve ended."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import GreybedError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Status:
    """How a solve ended.

    Attributes
    ----------
    converged : bool
        Whether the residual reached the tolerance.
    reason : str
        Why it ended.
    remedy : str
        What to change if it did not converge; empty if it did.
    iterations : int
        Newton iterations in all [-].
    residual : float
        Last residual: sum over spheres of the heat not accounted for, over the heat exchanged [-].
    """

    converged: bool
    reason: str
    remedy: str
    iterations: int
    residual: float


class SolverError(GreybedError, RuntimeError):
    """A solve that did not converge; ``status`` tells more."""

    def __init__(self, status: Status) -> None:
        super().__init__(f"thermal bed: {status.reason}; {status.remedy}.")
        self.status = status


@dataclass(frozen=True, eq=False, kw_only=True)
class ThermalResult:
    """Outcome of a steady or transient solve.

    Attributes
    ----------
    temperatures : array, shape (n,)
        [K].
    wall_conduction, wall_radiation : array, shape (n_walls,)
        Heat from each wall into the bed [W].
    opening_heat : float
        Heat through the opening into the bed, below zero where the bed loses it [W].
    time : float
        End time; infinite for a steady state [s].
    energy_error : float
        Heat that does not balance, over the heat exchanged; a run adds up all its steps; 0 where
        no more than round-off is exchanged [-].
    isolated : int array
        Spheres without a path to any temperature; a steady solve leaves each connected group of
        them at its mean initial temperature.
    status : Status
        Whether and why the solve ended, Newton iterations, residual.
    history : dict of arrays
        Steady: ``residual`` per iteration [-]. Transient, one row per step: ``time`` [s],
        ``mean``, ``lowest``, ``highest`` temperature [K], ``wall_heat`` (m, n_walls) and
        ``opening_heat`` at the end of the step [W], ``stored`` heat since the start [J],
        ``supplied`` heat since the start [J].
    """

    temperatures: Array
    wall_conduction: Array
    wall_radiation: Array
    opening_heat: float
    time: float
    energy_error: float
    isolated: NDArray[np.int64]
    status: Status
    history: dict[str, Array] = field(default_factory=dict)

    @property
    def wall_heat(self) -> Array:
        """Heat from each wall into the bed, conduction and radiation, shape (n_walls,) [W]."""
        return self.wall_conduction + self.wall_radiation
