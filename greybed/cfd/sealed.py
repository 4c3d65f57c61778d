"""An ideal gas in a box that lets none out: its mean pressure follows from its heat."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from greybed.cfd.boundaries import Inflow, Sides
from greybed.cfd.fluid import Fluid
from greybed.core.errors import InputError

Array = NDArray[np.float64]

# What may be missing of the mean pressure: the round-off of sums over cells.
_ENOUGH = 4e-15
# Each look leaves at most 1 - 1 / ratio of heat capacities of what was missing, mostly far less.
_MOST = 40


def is_sealed(sides: Sides, fluid: Fluid) -> bool:
    """Whether the gas is an ideal one that no outlet holds at its pressure."""
    return fluid.molar_mass is not None and sides.closed


def check_sealed(sides: Sides, fluid: Fluid) -> None:
    """Refuse what a sealed box of an ideal gas cannot be.

    Raises
    ------
    InputError
        For an inflow, or a heat capacity that leaves none at constant volume.
    """
    if not is_sealed(sides, fluid):
        return
    if any(isinstance(side, Inflow) for side in sides.of.values()):
        raise InputError(
            "an ideal gas flows in, or is drawn off, and no side holds its mean pressure; give one "
            "side an Outlet, or only walls."
        )
    if fluid.heat_capacity <= fluid.gas_constant:
        raise InputError(
            f"heat_capacity = {fluid.heat_capacity:g} [J/kg/K] of an ideal gas must be above its "
            f"gas constant {fluid.gas_constant:g}; give that at constant pressure."
        )


def warmed(
    advance: Callable[[Array], tuple[Array, Array]], mass: Array, void: Array, pressure: float,
    fluid: Fluid, dt: float,
) -> tuple[Array, Array, float]:  # fmt: skip
    """Temperatures, heat from particles and the mean pressure p0 after a step.

    The gas between the particles is compressed by itself: each volume gets eps dp0/dt, whose sum
    with the heat is what the internal energy c_v rho T gains (Rehm & Baum, J. Res. Natl. Bur.
    Stand. 83 (1978) 297; with void fractions the same with eps as weight). p0 is such that the
    law of the ideal gas holds for the box as a whole.

    Parameters
    ----------
    advance : callable
        Temperatures and heat per volume and time for a work per volume and time [W/m3].
    mass, void : array
        Mass of gas per volume [kg/m3] and void fraction [-] after the step.
    pressure : float
        p0 before it [Pa].
    dt : float
        [s].
    """
    room, ratio = float(void.sum()), 1.0 / (1.0 - fluid.gas_constant / fluid.heat_capacity)
    rise, last, slope = 0.0, (0.0, 0.0), -1.0 / ratio
    for look in range(_MOST):
        t, heat = advance(void * (rise / dt))
        off = fluid.gas_constant * float((mass * t).sum()) / room - (pressure + rise)
        if abs(off) <= _ENOUGH * pressure or look == _MOST - 1:
            break
        if look > 0 and rise != last[0]:
            # -1 / ratio where the heat is given, -1 where the temperature is.
            slope = min(max((off - last[1]) / (rise - last[0]), -1.0), -1.0 / ratio)
        last = rise, off
        rise -= off / slope
    return t, heat, pressure + rise


def masses(total: float, void: Array, temperature: Array) -> Array:
    """Mass per volume of cells [kg/m3], so much in all, at one pressure and these temperatures."""
    share: Array = void / temperature
    return share * (total / float(share.sum()))
