"""Settings of the exchange between gas and particles, and the drag of each particle."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from greybed.closures.drag import MIXTURES, DragLaw, drag_law, mixture_factor, sauter_mean
from greybed.core.errors import InputError
from greybed.coupling import _drag
from greybed.coupling.filtered_drag import FilteredDrag
from greybed.coupling.forces import LIFTS
from greybed.coupling.void_fraction import METHODS

Array = NDArray[np.float64]

TREATMENTS = ("explicit", "semi-implicit", "implicit")

Correction = Callable[[Array, Array, float], Array]


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How gas and particles act on each other.

    Parameters
    ----------
    drag : str, DragLaw or callable
        A name in ``greybed.closures.drag.LAWS``, a law, or ``F(phi, re)`` of arrays.
    treatment : str
        ``explicit``: force of the old velocities. ``semi-implicit``: of the new gas velocity.
        ``implicit``: also of the particle's own new velocity, with the slope of the law, so that
        no time step is too long for it.
    width : float
        Smoothing of void fraction and exchange, in mean diameters; cells wider than it are not
        smoothed [-].
    void : str
        ``exact`` or ``centre``: where a particle's volume is counted.
    least_void : float
        Void fractions below it are taken as it [-].
    mixture : str
        How sizes share drag: ``none`` (each as if all were of its size), ``bvk``,
        ``yin-sundaresan``.
    pressure : bool
        Whether the pressure gradient acts on particles.
    buoyancy : bool
        Whether the gas's weight lifts particles where its pressure leaves that out.
    added_mass : float
        Coefficient, 0.5 for spheres, 0 for none [-].
    lift : str
        ``none`` or ``saffman-mei``.
    lubrication : float
        Gap between surfaces within which films of the fluid act, in mean diameters; 0 for none.
        See :func:`greybed.coupling.lubrication.lubrication` [-].
    roughness : float
        Films are no thinner than it, in mean diameters [-].
    correction : callable or FilteredDrag, optional
        ``H(phi, slip, size)`` for solid fractions (n,), slips (n, 3) and the edge of a cube of a
        cell's volume [m]: the fraction of drag that is kept. A
        :class:`greybed.coupling.filtered_drag.FilteredDrag` keeps different fractions along
        gravity and across it, and gives their slopes to an implicit treatment.

    Raises
    ------
    InputError
        For a name that is not known or a number out of range.
    """

    drag: str | DragLaw | Callable[[Array, Array], Array] = "bvk"
    treatment: str = "semi-implicit"
    width: float = 3.0
    void: str = "exact"
    least_void: float = 0.2
    mixture: str = "none"
    pressure: bool = True
    buoyancy: bool = True
    added_mass: float = 0.0
    lift: str = "none"
    lubrication: float = 0.0
    roughness: float = 1e-3
    correction: Correction | FilteredDrag | None = None

    def __post_init__(self) -> None:
        for name, known in (
            ("treatment", TREATMENTS), ("void", METHODS), ("mixture", MIXTURES), ("lift", LIFTS),
        ):  # fmt: skip
            if getattr(self, name) not in known:
                raise InputError(
                    f"{name} = {getattr(self, name)!r} is not known; known are {', '.join(known)}."
                )
        for name, low, high in (
            ("width", 0.0, 1e3), ("least_void", 0.01, 0.99), ("added_mass", 0.0, 10.0),
            ("lubrication", 0.0, 1.0), ("roughness", 1e-6, 0.1),
        ):  # fmt: skip
            value = getattr(self, name)
            if not (math.isfinite(value) and low <= value <= high):
                raise InputError(f"{name} = {value:g} [-] must lie in {low:g} ... {high:g}.")
        if isinstance(self.drag, str):
            drag_law(self.drag)

    @property
    def law(self) -> DragLaw | Callable[[Array, Array], Array]:
        """The drag law itself."""
        return drag_law(self.drag) if isinstance(self.drag, str) else self.drag

    @cached_property
    def plain(self) -> DragLaw | None:
        """The law where the force is nothing but its k times the slip, given in one pass."""
        law = self.law
        simple = self.mixture == self.lift == "none" and self.added_mass == 0.0
        simple = simple and self.correction is None and self.treatment != "implicit"
        return law if isinstance(law, DragLaw) and simple else None


@dataclass(frozen=True, eq=False)
class DragTerms:
    """Drag of each particle as k times slip.

    Attributes
    ----------
    coefficient : array, shape (n,), or (n, 3) where axes differ
        k [N s/m].
    steepness : array, of the same shape
        Slope of the force over the slip, over k [-].
    void, reynolds : array, shape (n,)
        Void fraction and Re [-].
    outside : float
        Share of particles outside the data of the law [-].
    """

    coefficient: Array
    steepness: Array
    void: Array
    reynolds: Array
    outside: float
    push: Array | None = None  # of what does not vanish with the slip (n, 3) [N]

    def over(self, void: Array) -> DragTerms:
        """The same over the void fraction, as model B has it."""
        each = void if self.coefficient.ndim == 1 else void[:, None]
        push = None if self.push is None else self.push / void[:, None]
        return replace(self, coefficient=self.coefficient / each, push=push)


def drag_terms(
    settings: Settings, slip: Array, void: Array, d: Array, density: float, viscosity: float,
    size: float, gradient: Array | None = None,
) -> DragTerms:  # fmt: skip
    """Drag of particles with slips (n, 3) [m/s], void fractions (n,) [-] and diameters (n,) [m].

    ``gradient`` is that of the pressure (n, 3) [Pa/m], for corrections that need it.
    """
    if not len(d):
        return DragTerms(np.zeros(0), np.ones(0), void, np.zeros(0), 0.0)
    law = settings.law
    if isinstance(law, DragLaw) and settings.mixture == "none":
        re, coefficient, steepness = np.empty_like(d), np.empty_like(d), np.empty_like(d)
        count, bad = _drag.of_law(
            law.code, *map(float, law.solids), float(law.reynolds), np.ascontiguousarray(slip),
            np.ascontiguousarray(void), np.ascontiguousarray(d), float(density), float(viscosity),
            re, coefficient, steepness,
        )  # fmt: skip
        if bad >= 0:
            refuse(float(law(1.0 - void[bad], re[bad])), 1.0 - void[bad], re[bad])
        outside = count / len(d)
    else:
        re, coefficient, steepness, outside = _general(settings, slip, void, d, density, viscosity)
    phi = 1.0 - void
    if isinstance(settings.correction, FilteredDrag):
        filtered = settings.correction
        factor, steep, push = filtered.particles(phi, slip, size, gradient)
        each = coefficient[:, None]
        return DragTerms(
            each * factor, steep, void, re, outside, each * push if filtered.linear else None
        )
    if settings.correction is not None:
        kept = np.asarray(settings.correction(phi, slip, size), dtype=np.float64)
        if kept.shape != phi.shape or not (np.isfinite(kept).all() and (kept >= 0.0).all()):
            raise InputError("the drag correction must give one finite number >= 0 per particle.")
        coefficient = coefficient * kept
    return DragTerms(coefficient, steepness, void, re, outside)


def refuse(force: float, phi: float, re: float) -> NoReturn:
    """Tell what a drag law gives that no force can be."""
    raise InputError(
        f"the drag law gives F = {force:g} at a solid fraction of {phi:.3g} and Re = {re:.3g} [-]; "
        "F must be finite and at least 0: take another law."
    )


def _general(
    settings: Settings, slip: Array, void: Array, d: Array, density: float, viscosity: float
) -> tuple[Array, Array, Array, float]:
    """The same for any function, and for sizes that share drag."""
    phi = 1.0 - void
    speed = np.sqrt((slip**2).sum(axis=1))
    mean = d if settings.mixture == "none" else np.full_like(d, sauter_mean(d))
    re = void * density * mean * speed / viscosity
    law = settings.law
    outside = 0.0
    if isinstance(law, DragLaw):
        force, slope = law.with_slope(phi, re)
        outside = float(np.count_nonzero(law.outside(phi, re))) / len(d)
    else:
        force = np.asarray(law(phi, re), dtype=np.float64)
        further = 1e-3 * np.maximum(re, 1e-6)
        slope = re * (np.asarray(law(phi, re + further)) - force) / further
    if settings.mixture != "none":
        before = force
        force = mixture_factor(settings.mixture, force, phi, d / mean)
        slope = slope * force / before
    good = np.isfinite(force) & (force >= 0.0)
    if not good.all():
        who = int((~good).argmax())
        refuse(force[who], phi[who], re[who])
    coefficient = 3.0 * math.pi * viscosity * d * void * force
    steepness = 1.0 + np.divide(slope, force, out=np.zeros_like(force), where=force > 0.0)
    return re, coefficient, np.maximum(steepness, 0.5), outside
