"""Convection and viscous stress of a velocity field, per volume of its control volumes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from greybed.cfd import _flux
from greybed.cfd.boundaries import Outlet, Sides, back, lead

Array = NDArray[np.float64]
Faces = tuple[Array, Array, Array]


def rates(sides: Sides) -> tuple[float, float, float]:
    """One over the spacings [1/m]; 0 for an axis without extent."""
    cx, cy, cz = (
        1.0 / h if wide else 0.0 for h, wide in zip(sides.grid.spacing, sides.wide, strict=True)
    )
    return cx, cy, cz


def on_faces(sides: Sides, padded: Array, axis: int) -> Array:
    """Means of the cells on both sides of each face."""
    inner = [slice(2, -2)] * 3
    low, high = list(inner), list(inner)
    low[2 - axis], high[2 - axis] = slice(1, -2), slice(2, -1)
    return 0.5 * (padded[tuple(low)] + padded[tuple(high)])


def outflow(sides: Sides, flux: Faces) -> Array:
    """Divergence of fluxes through the faces of cells."""
    out = np.zeros(sides.grid.shape)
    _flux.divergence(*flux, *rates(sides), 1.0, out)
    return out


def slopes(sides: Sides, p: Array) -> Faces:
    """Pressure gradients on faces [Pa/m]; 0 where a side lets nothing or a given flow pass."""
    found = []
    for axis in range(3):
        h, a = sides.grid.spacing[axis], lead(p, axis)
        out = np.zeros((len(a) + 1, *a.shape[1:]))
        np.subtract(a[1:], a[:-1], out=out[1:-1])
        out[1:-1] /= h
        if sides.grid.periodic[axis]:
            out[0] = out[-1] = (a[0] - a[-1]) / h
        else:
            for end in (0, 1):
                side = sides.of[axis, end]
                if isinstance(side, Outlet):
                    out[-end] = (1 - 2 * end) * (a[-end] - side.pressure) / (0.5 * h)
        found.append(np.ascontiguousarray(back(out, axis)))
    return found[0], found[1], found[2]


def convection(sides: Sides, velocity: Faces, flux: Faces) -> Faces:
    """What convection does to velocities [N/m3]: minus div(F u) + u div F.

    A uniform velocity is left alone whatever the void fraction does.
    """
    c, found = rates(sides), []
    for own in range(3):
        out = np.zeros(velocity[own].shape)
        if sides.wide[own]:
            padded = sides.faces(velocity[own], own, flux)
            _flux.convect(padded, *sides.mass_fluxes(flux, own), *c, out)
        found.append(out)
    return found[0], found[1], found[2]


def friction(sides: Sides, velocity: Faces, flux: Faces, viscosity: Array) -> Faces:
    """Divergence of the viscous stress [N/m3]; ``viscosity`` is that of the phase, padded."""
    padded = [sides.faces(velocity[a], a, flux) for a in range(3)]
    c = rates(sides)
    nz, ny, nx = sides.grid.shape
    xx, yy, zz = np.empty((nz, ny, nx + 2)), np.empty((nz, ny + 2, nx)), np.empty((nz + 2, ny, nx))
    xy, xz = np.empty((nz, ny + 1, nx + 1)), np.empty((nz + 1, ny, nx + 1))
    yz = np.empty((nz + 1, ny + 1, nx))
    _flux.normal_stresses(*padded, viscosity, *c, xx, yy, zz)
    _flux.shear_stresses(*padded, viscosity, *c, xy, xz, yz)
    found = []
    for own, stress in enumerate(((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))):
        out = np.zeros(velocity[own].shape)
        if sides.wide[own]:
            _flux.divergence(*stress, *c, 1.0, out)
        found.append(out)
    return found[0], found[1], found[2]
