"""Particles of a simulation: checked arrays, energies, the time of a Rayleigh wave."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError
from greybed.dem.materials import Material

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Energies:
    """Energies of all particles [J]: of motion, of spin, and of height (0 at the origin)."""

    kinetic: float
    rotational: float
    potential: float

    @property
    def total(self) -> float:
        """Their sum [J]."""
        return self.kinetic + self.rotational + self.potential


def particle_arrays(
    centres: ArrayLike,
    radii: ArrayLike,
    materials: Sequence[Material] | Material,
    kinds: ArrayLike | None,
    velocities: ArrayLike | None,
    spins: ArrayLike | None,
    least: int = 1,
) -> tuple[Array, Array, Index, list[Material]]:
    """Checked arrays of the particles."""
    known = [materials] if isinstance(materials, Material) else list(materials)
    names = [material.name for material in known]
    if not known or len(set(names)) < len(names):
        raise InputError(f"materials {names} must have different names, and be one at least.")
    at = np.array(centres, dtype=np.float64)
    at = at.reshape(0, 3) if at.size == 0 and least == 0 else at
    if at.ndim != 2 or at.shape[1] != 3 or len(at) < least:
        raise InputError(f"centres of shape {at.shape} must be (n, 3), n at least {least}.")
    n = len(at)
    place = np.empty((n, 4))
    place[:, :3] = at
    place[:, 3] = np.asarray(radii, dtype=np.float64)
    good = np.isfinite(place).all(axis=1) & (place[:, 3] > 0.0)
    if not good.all():
        i = int((~good).argmax())
        raise InputError(
            f"particle {i}: centre {place[i, :3].tolist()} and radius {place[i, 3]:g} [m] must be "
            "finite, the radius above 0."
        )
    kind = np.zeros(n, np.int64) if kinds is None else np.array(kinds, dtype=np.int64)
    if kind.shape != (n,) or not ((kind >= 0) & (kind < len(known))).all():
        raise InputError(
            f"kinds must be {n} numbers in 0 ... {len(known) - 1}, one for each particle."
        )
    motion = np.zeros((n, 8))
    for column, name, values in ((0, "velocities", velocities), (3, "spins", spins)):
        if values is not None:
            given = np.broadcast_to(np.asarray(values, dtype=np.float64), (n, 3))
            if not np.isfinite(given).all():
                who = int(np.argwhere(~np.isfinite(given))[0, 0])
                raise InputError(f"{name} must be finite; that of particle {who} is not.")
            motion[:, column : column + 3] = given
    density = np.array([material.density for material in known])[kind]
    motion[:, 6] = density * 4.0 / 3.0 * np.pi * place[:, 3] ** 3
    motion[:, 7] = 0.4 * motion[:, 6] * place[:, 3] ** 2
    return place, motion, kind, known


def rayleigh_time(place: Array, kind: Index, materials: list[Material]) -> float:
    """Shortest time of a Rayleigh wave around a particle [s] (Thornton & Randall 1988)."""
    shortest = math.inf
    for number, m in enumerate(materials):
        r = place[kind == number, 3]
        if len(r):
            speed = 0.163 * m.poissons_ratio + 0.8766
            time = math.pi * float(r.min()) * math.sqrt(m.density / m.shear_modulus) / speed
            shortest = min(shortest, time)
    return shortest
