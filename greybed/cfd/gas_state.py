"""The state of a gas, what acts on it in a step, and what a step reports."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from greybed.cfd.energy import Heating

Array = NDArray[np.float64]
Faces = tuple[Array, Array, Array]


@dataclass(frozen=True, eq=False)
class Gas:
    """The state of a gas: all that a step begins with.

    Attributes
    ----------
    velocity : three arrays
        Between the particles, on the faces across x, y and z [m s-1].
    pressure : array
        Of cells [Pa], gauge; without the imposed gradient.
    void_fraction, mass, temperature : array
        [-], mass of gas per volume of cell [kg m-3], [K].
    time : float
        [s].
    gradient : array, shape (3,)
        Imposed pressure gradient, or the one that keeps an imposed flow [Pa m-1].
    convection, friction : three arrays or None
        What convection and viscosity did in the step before [N m-3], whose length was ``before``
        [s].
    spilled : array, shape (3,)
        Momentum per time that convection then left to the lag of the budget [N].
    mean_pressure : float
        Of an ideal gas, absolute [Pa]: the same everywhere, and constant where there is an outlet.
    """

    velocity: Faces
    pressure: Array
    void_fraction: Array
    mass: Array
    temperature: Array
    time: float
    gradient: Array
    convection: Faces | None = None
    friction: Faces | None = None
    before: float = 0.0
    spilled: Array = field(default_factory=lambda: np.zeros(3))
    mean_pressure: float = 0.0


@dataclass(frozen=True, eq=False)
class Budget:
    """Momentum of the gas inside, along x, y and z, in a step [N s].

    Inside is what lies between the centres of the outermost cells of an axis, all of it where the
    axis repeats. ``change`` is the sum of the others to round-off. ``transport`` is what convection
    and viscous stress bring in through the rims (all else of them cancels), ``lag`` what is left
    because mass fluxes of the last step carry the momentum of this one: 0 where the void fraction
    and the density are steady.
    """

    change: Array
    transport: Array
    pressure: Array
    drag: Array
    source: Array
    weight: Array
    lag: Array


@dataclass(frozen=True, eq=False)
class StepReport:
    """What a step did.

    Attributes
    ----------
    time, dt : float
        At its end, its length [s].
    parts : int
        Steps into which it was cut.
    iterations : int
        Of the pressure, in all parts; 0 where transforms were used.
    divergence : float
        Norm of what is left of continuity over that of the flow through cells [-].
    courant : float
        Largest number of cells crossed in a part, summed over the axes [-].
    imbalance : float
        Gas that a closed box would have to lose for its void fraction [kg s-1]; it is kept.
    velocity : three arrays
        Mean over the parts of the velocities that the drag has seen [m s-1]: the gas has got
        ``-drag * (velocity - target) + source`` per volume and time.
    heat : array or None
        That the gas has got from the particles, mean over the step [W m-3].
    budget : Budget or None
    mean_pressure : float
        Of an ideal gas at the end, absolute [Pa].
    """

    time: float
    dt: float
    parts: int
    iterations: int
    divergence: float
    courant: float
    imbalance: float
    velocity: Faces
    heat: Array | None = None
    budget: Budget | None = None
    mean_pressure: float = 0.0


@dataclass(frozen=True, eq=False)
class Inputs:
    """What particles do to the gas in a step."""

    void: Array
    rate: Array
    drag: Faces
    target: Faces
    source: Faces
    gravity: Array
    heating: Heating | None = None


@dataclass(eq=False)
class Tally:
    """Sums over the parts of a step."""

    parts: int = 0
    iterations: int = 0
    divergence: float = 0.0
    courant: float = 0.0
    imbalance: float = 0.0
    seen: list[Array] | None = None
    heat: Array | None = None
    budget: list[Array] = field(default_factory=lambda: [np.zeros(3) for _ in range(7)])
