"""Averages of two fluids over their grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from greybed.cfd.rims import Rims
from greybed.cfd.twofluid_step import Fluids, State


@dataclass(frozen=True)
class Means:
    """Averages over the grid.

    Attributes
    ----------
    solid_fraction : float
    fraction_variance : float
        Of the solid fraction over the cells [-].
    solids_velocity, gas_velocity : three floats
        Weighted with the volume of the phase [m s-1].
    slip : three floats
        Gas less solids of these [m s-1].
    momentum : three floats
        Of both phases over the volume of the grid [kg m-2 s-1].
    """

    solid_fraction: float
    fraction_variance: float
    solids_velocity: tuple[float, float, float]
    gas_velocity: tuple[float, float, float]
    slip: tuple[float, float, float]
    momentum: tuple[float, float, float]


def averages(rims: Rims, fluids: Fluids, state: State) -> Means:
    """Averages of a state; each face counts once, at sides that do not repeat with half a cell."""
    phi = rims.inside(state.phi)
    mean = float(phi.mean())
    solids, gas = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
    for a in rims.axes:
        s, n = rims.strides[a], rims.grid.cells[a]
        face = np.empty(rims.size)
        face[s:] = 0.5 * (state.phi[s:] + state.phi[:-s])
        face[:s] = 0.0
        weight = np.ones(n + 1)
        weight[0] = weight[-1] = 0.5
        shape = [1, 1, 1]
        shape[2 - a] = n + 1
        share = weight.reshape(shape)
        part = rims.inside(face, a)
        for total, velocity, content in (
            (solids, state.us[a], part), (gas, state.ug[a], 1.0 - part),
        ):  # fmt: skip
            total[a] = float((share * content * rims.inside(velocity, a)).sum()) / phi.size
    rho, rho_gas = fluids.density, fluids.gas_density
    momentum = [rho * s + rho_gas * g for s, g in zip(solids, gas, strict=True)]
    v = [s / mean if mean > 0.0 else 0.0 for s in solids]
    u = [g / (1.0 - mean) for g in gas]
    w = [g - s for g, s in zip(u, v, strict=True)]
    return Means(
        mean, float(phi.var()), (v[0], v[1], v[2]), (u[0], u[1], u[2]), (w[0], w[1], w[2]),
        (momentum[0], momentum[1], momentum[2]),
    )  # fmt: skip
