"""Temperature of the gas: bounded convection, conduction, heat from particles."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.cfd import _flux, forces
from greybed.cfd.boundaries import Sides, lead
from greybed.cfd.fluid import Fluid
from greybed.cfd.grid import Shape
from greybed.core.errors import InputError

Array = NDArray[np.float64]
Faces = tuple[Array, Array, Array]
Given = Array | float | None

# Share of a cell's gas that may leave in a step: van Leer's fluxes keep bounds up to a half.
_COURANT = 0.5
# Share of a cell's heat that conduction may take in a step.
_CONDUCTION = 0.4


@dataclass(frozen=True, eq=False)
class Heating:
    """Heat per volume and time: coefficient (target - T) + source."""

    coefficient: Array
    target: Array
    source: Array

    @classmethod
    def of(cls, shape: Shape, coefficient: Given, target: Given, source: Given) -> Heating:
        """Of numbers or arrays; nothing where nothing is given."""
        found = []
        for name, given, unit in (
            ("heat_coefficient", coefficient, "W/m3/K"), ("heat_target", target, "K"),
            ("heat_source", source, "W/m3"),
        ):  # fmt: skip
            out = np.zeros(shape)
            try:
                out[...] = 0.0 if given is None else given
            except ValueError:
                raise InputError(f"{name} must be a number or of shape {shape}.") from None
            if not np.isfinite(out).all():
                raise InputError(f"{name}: all values [{unit}] must be finite.")
            found.append(out)
        if (found[0] < 0.0).any():
            raise InputError("heat_coefficient: all values [W/m3/K] must be at least 0.")
        if target is None and found[0].any():
            raise InputError("heat_coefficient needs a heat_target [K].")
        return cls(found[0], found[1], found[2])


def _rate(sides: Sides, fluid: Fluid, t: Array, flux: Faces, conductivity: Array, spill: Array,
          ) -> Array:  # fmt: skip
    """Heat that comes with gas and by conduction, per volume over the heat capacity."""
    c, padded = forces.rates(sides), sides.temperatures(t, flux)
    out = np.empty_like(t)
    _flux.convect(padded, *flux, *c, out)
    out -= t * spill
    if fluid.conductivity > 0.0:
        nz, ny, nx = t.shape
        q = (np.empty((nz, ny, nx + 1)), np.empty((nz, ny + 1, nx)), np.empty((nz + 1, ny, nx)))
        _flux.conduction(padded, conductivity, *c, *q)
        _flux.divergence(*q, *c, -1.0 / fluid.heat_capacity, out)
    return out


def parts(sides: Sides, fluid: Fluid, mass: Array, flux: Faces, void: Array, dt: float) -> int:
    """Into how many a step is cut so that temperatures keep their bounds."""
    rates = forces.rates(sides)
    leaving = np.zeros(mass.shape)
    for axis, f in enumerate(flux):
        a, out = lead(f, axis), lead(leaving, axis)
        out += rates[axis] * (np.maximum(a[1:], 0.0) - np.minimum(a[:-1], 0.0))
    conduct = 4.0 * fluid.conductivity / fluid.heat_capacity * sum(c**2 for c in rates)
    # A neighbour full of gas conducts with half of its void fraction.
    share = leaving / _COURANT + conduct * 0.5 * (void + 1.0) / _CONDUCTION
    return max(1, math.ceil(dt * float((share / mass).max())))


def advance(
    sides: Sides, fluid: Fluid, t: Array, old: Array, new: Array, flux: Faces, void: Array,
    heating: Heating, dt: float, work: Array | None = None,
) -> tuple[Array, Array]:  # fmt: skip
    """Temperatures after a step, and the heat that particles have given per volume and time.

    ``old`` and ``new`` are masses per volume before and after, of which ``flux`` makes one from the
    other. Heun's method in the conservative form, bounded where no heat is given; heat from
    particles is implicit. ``work`` per volume and time is what else the gas gets [W/m3].
    """
    c = forces.rates(sides)
    spill = np.zeros_like(t)
    _flux.divergence(*flux, *c, 1.0, spill)
    conductivity = fluid.conductivity * sides.cells(void)
    count = parts(sides, fluid, np.minimum(old, new), flux, void, dt)
    h = dt / count
    heat = np.zeros_like(t)
    cp = fluid.heat_capacity
    growth = (new - old) / count
    mass = old
    for part in range(count):
        after = new if part == count - 1 else mass + growth
        content = mass * t
        inert = cp * after + h * heating.coefficient
        given = h * (heating.coefficient * heating.target + heating.source)
        given = given if work is None else given + h * work
        rate = _rate(sides, fluid, t, flux, conductivity, spill)
        # The first stage knows of the heat too: a steady state is one of both stages.
        between = (cp * (content + h * rate) + given) / inert
        rate = 0.5 * (rate + _rate(sides, fluid, between, flux, conductivity, spill))
        content = content + h * rate
        t = (cp * content + given) / inert
        heat += cp * (after * t - content) / (h * count)
        mass = after
    return t, heat if work is None else heat - work
