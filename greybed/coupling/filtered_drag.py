"""Filtered drag in the solvers: a published model or a closure, by name, with its derivative.

Both solvers treat drag implicitly as k (u - v) + push along each axis. k is the derivative of the
filtered drag with respect to the slip along that axis, kept between half and thrice the drag over
the slip so that a step stays stable; push is what is left of the force at the old slip, so where
the flow is steady the force is that of the closure.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.closures.drag.filtered import Material
from greybed.closures.drag.filtered.compiled import axis_drag
from greybed.closures.drag.filtered.force import KeptDrag, Law
from greybed.closures.drag.filtered.naming import kept_drag
from greybed.core.errors import InputError

Array = NDArray[np.float64]

# The derivative that is used, over the drag divided by the slip.
STEEPEST = (0.5, 3.0)


@dataclass(frozen=True, eq=False)
class ImplicitDrag:
    """Filtered drag of n places along x, y and z as ``coefficient (u - v) + push``.

    Attributes
    ----------
    coefficient : (n, 3) float
        [N s m-4].
    push : (n, 3) float
        [N m-3].
    secant : (n, 3) float
        Drag over slip, without what the pressure gradient gives [N s m-4].
    pull : (n, 3) float
        What the pressure gradient gives [N m-3].
    beta : (n,) float
        The drag law without correction [N s m-4].
    """

    coefficient: Array
    push: Array
    secant: Array
    pull: Array
    beta: Array


class FilteredDrag:
    """A correction of drag for the solvers.

    Parameters
    ----------
    closure : KeptDrag
        A closure or a published model.
    material : Material
        Gas and particles.
    law : DragLaw or callable
        Drag law that is corrected.
    gravity : (3,) array_like
        Along an axis [m s-2].
    filter_ratio : float
        Size of the filter over that of a cell, at least 1 [-].
    gas_weight : bool
        Whether the pressure gradient that comes in carries the gas's weight.

    Attributes
    ----------
    extrapolated : float
        Share of places outside the training data when it was asked last [-].

    Raises
    ------
    InputError
        If gravity is not along an axis, or the filter smaller than a cell.
    """

    def __init__(
        self, closure: KeptDrag, material: Material, law: Law, gravity: Any, *,
        filter_ratio: float = 1.0, gas_weight: bool = True,
    ) -> None:  # fmt: skip
        down = np.asarray(gravity, dtype=np.float64)
        if np.count_nonzero(down) != 1:
            raise InputError(
                f"correction: gravity = {down.tolist()} [m s-2] must be along one axis, for drag "
                "differs along and across it; turn the case, or leave the correction out."
            )
        if not filter_ratio >= 1.0:
            raise InputError(
                f"filter_ratio = {filter_ratio:g} [-]: a filter smaller than a cell has nothing to "
                "correct; take 1 or more."
            )
        self.closure, self.material, self.law = closure, material, law
        self.gravity, self.filter_ratio, self.gas_weight = down, filter_ratio, gas_weight
        self.axis = int(np.flatnonzero(down)[0])
        self.extrapolated = 0.0

    @property
    def needs_gradient(self) -> bool:
        """Whether it needs the pressure gradient."""
        return self.closure.needs_gradient

    @property
    def linear(self) -> bool:
        """Whether it has a part that the pressure gradient gives by itself."""
        markers = getattr(self.closure, "markers", None)
        return bool(getattr(markers, "linear", False))

    def implicit(
        self, phi: Array, slip: Array, size: float, gradient: Array | None, parcels: float = 1.0
    ) -> ImplicitDrag:
        """Filtered drag of n places, with cells of that size [m], linear along each axis."""
        if gradient is not None and not self.gas_weight:
            gradient = gradient + self.material.gas_density * self.gravity
        f = axis_drag(
            self.closure, self.material, self.law, self.gravity, phi, slip,
            self.filter_ratio * size, gradient if self.needs_gradient else None, parcels,
        )  # fmt: skip
        self.extrapolated = float(np.mean(f.extrapolates))
        coefficient = np.clip(f.diagonal, STEEPEST[0] * f.secant, STEEPEST[1] * f.secant)
        return ImplicitDrag(
            coefficient, f.force - coefficient * slip, f.secant, f.force - f.secant * slip, f.beta
        )

    # -- the two-fluid solver -----------------------------------------------------------------

    def __call__(self, cell: Any) -> list[Array]:
        """Kept fractions along x, y and z; what the pressure gradient gives is not in them."""
        found = self._cells(cell)
        ratio = found.secant / np.maximum(found.beta, 1e-300)[:, None]
        return [ratio[:, a].reshape(cell.solid_fraction.shape) for a in range(3)]

    def linearised(self, cell: Any) -> tuple[list[Array], list[Array]]:
        """Coefficients and pushes along x, y and z over phi eps, for a ``DragCell``."""
        found = self._cells(cell)
        phi = np.ravel(cell.solid_fraction)
        # Finite where there are no particles: there the drag law itself counts.
        share = np.maximum(phi * (1.0 - phi), 1e-12)[:, None]
        coefficient, push = found.coefficient / share, found.push / share
        shape = cell.solid_fraction.shape
        return (
            [coefficient[:, a].reshape(shape) for a in range(3)],
            [push[:, a].reshape(shape) for a in range(3)],
        )

    def _cells(self, cell: Any) -> ImplicitDrag:
        slip = np.stack([np.ravel(part) for part in cell.slip], axis=1)
        gradient = np.stack([np.ravel(part) for part in cell.pressure_gradient], axis=1)
        phi = np.maximum(np.ravel(cell.solid_fraction), 1e-12)
        return self.implicit(phi, slip, cell.size, gradient)

    # -- particles ----------------------------------------------------------------------------

    def particles(
        self, phi: Array, slip: Array, size: float, gradient: Array | None
    ) -> tuple[Array, Array, Array]:
        """Factors on k of each particle, slopes over it and pushes per k, each (n, 3).

        With k the drag law's coefficient of a particle, its force is ``k factor slip + k push``,
        and its derivative ``k factor steepness``.
        """
        found = self.implicit(np.maximum(phi, 1e-12), slip, size, gradient)
        beta = found.beta[:, None]
        return found.secant / beta, found.coefficient / found.secant, found.pull / beta


def filtered_drag(
    name: str | os.PathLike[str], material: Material, law: Law, gravity: Any, *,
    filter_ratio: float = 1.0, gas_weight: bool = True,
) -> FilteredDrag:  # fmt: skip
    """A correction by the name that case files have for it.

    Parameters
    ----------
    name : str or path
        ``radl-sundaresan``, ``igci``, ``milioli``, a ``.closure`` file, or ``shipped:NAME``.
    material, law, gravity, filter_ratio, gas_weight
        As for :class:`FilteredDrag`.

    Raises
    ------
    InputError
        If there is no such model, the file holds another closure, or the case cannot give what
        the closure needs.
    """
    return FilteredDrag(
        kept_drag(name), material, law, gravity, filter_ratio=filter_ratio, gas_weight=gas_weight
    )
