r"""Exchange factors of a bed from its view factors: grey diffuse surfaces, or sides of them.

With view factors F, emissivities :math:`\varepsilon` and what is reflected, R = diag(1 -
:math:`\varepsilon`), the share of the radiation emitted by i that j absorbs at last is

.. math:: D = (I - F R)^{-1} F\,\mathrm{diag}(\varepsilon)

(absorbed at the first hit, or after what k reflects of it has been shared out as k's own emission
would be; Gebhart's absorption factors). It follows that D = F at :math:`\varepsilon = 1`, that
rows sum to one where those of F do, and that :math:`A_i\varepsilon_i D_{ij}` is symmetric where
:math:`A_i F_{ij}` is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_matrix, diags

from greybed.core.conjugate import conjugate_gradients
from greybed.core.errors import InputError
from greybed.core.packing import Packing
from greybed.core.rows import Rows, balanced
from greybed.core.sides import by_sides

Array = NDArray[np.float64]

# Below it light between surfaces that hardly absorb travels on and on.
LEAST_EMISSIVITY = 1e-3
# Right-hand sides that are solved at once: their memory is this times the number of surfaces.
BLOCK = 32
MOST_SIDES = 1000
# Rows of every sphere are a full matrix.
MOST_ROWS = 10_000


class Shares(NamedTuple):
    """Who absorbs what some spheres emit.

    Attributes
    ----------
    factors : ndarray, shape (k, n)
        Shares of the spheres [-], what returns to the emitter included.
    wall_factors : ndarray, shape (k, n_walls)
        Shares of the walls [-].
    escaped : ndarray, shape (k,)
        What leaves through the opening [-].
    """

    factors: Array
    wall_factors: Array
    escaped: Array


class NetHeats(NamedTuple):
    """What surfaces emit less what they absorb [W].

    Attributes
    ----------
    spheres : ndarray, shape (n,)
        Of each sphere.
    walls : ndarray, shape (n_walls,)
        Of each wall.
    opening : float
        Of the surroundings, through the opening.
    """

    spheres: Array
    walls: Array
    opening: float


@dataclass(frozen=True, eq=False)
class DiffuseExchange:
    """Exchange factors of a bed as an operator; made by :func:`diffuse_exchange`.

    Nothing of size (n, n) is stored but the sparse view factors: :meth:`heats` costs one solve by
    conjugate gradients, :meth:`emitted_by` one for each row, :meth:`rows` all of them.

    Attributes
    ----------
    view : Rows
        View factors, balanced.
    emissivity : ndarray, shape (n,)
        Of the spheres [-].
    wall_emissivity : ndarray, shape (n_walls,)
        Of the walls [-].
    wall_exchange : ndarray, shape (n_walls, n_walls)
        Exchange areas A F between the walls themselves [m2].
    packing : Packing or None
        Where the spheres stand, for their sides.
    sides : int
        Radiosities of each sphere [-].
    """

    view: Rows
    emissivity: Array
    wall_emissivity: Array
    wall_exchange: Array
    packing: Packing | None = None
    sides: int = 1

    def __len__(self) -> int:
        return len(self.emissivity)

    @property
    def emission_areas(self) -> Array:
        """Areas times emissivity, (n,) [m2]: ``E_i D_ij = E_j D_ji``."""
        return self.view.areas * self.emissivity

    @cached_property
    def _exchange(self) -> Callable[[Array], Array]:
        """Symmetric exchange areas A F of all nodes times vectors (nodes, k) [m2].

        Nodes are the sides of the spheres, the walls and, last, the opening.
        """
        a = self.view.areas
        if self.packing is not None and self.sides > 1:
            pairs, back, outside = by_sides(self.packing, self.view, self.sides)
        else:
            inner = diags(a) @ self.view.factors
            inner = (0.5 * (inner + inner.T)).tocsr()
            outside = a[:, None] * np.column_stack([self.view.wall_factors, self.view.escaped])
        between = np.zeros((outside.shape[1], outside.shape[1]))
        between[:-1, :-1] = self.wall_exchange
        outer, size = csr_matrix(outside), len(outside)
        outer_turned = outer.T.tocsr()

        def apply(v: Array) -> Array:
            first = v[:size]
            inside = inner @ first if self.sides == 1 else pairs.T @ (pairs @ first)[back]
            return np.concatenate(
                [inside + outer @ v[size:], outer_turned @ first + between @ v[size:]]
            )

        return apply

    @cached_property
    def _owner(self) -> NDArray[np.int64]:
        """Surface of each node."""
        n = len(self)
        rest = np.arange(n, n + len(self.wall_emissivity) + 1)
        return np.concatenate([np.repeat(np.arange(n), self.sides), rest])

    @cached_property
    def _node_areas(self) -> Array:
        return self._exchange(np.ones((len(self._owner), 1)))[:, 0]

    @cached_property
    def _areas(self) -> Array:
        return np.asarray(np.bincount(self._owner, self._node_areas), dtype=np.float64)

    @cached_property
    def _mean(self) -> csr_matrix:
        """From nodes to surfaces, weighted by area."""
        weight = self._node_areas / np.where(self._areas > 0.0, self._areas, 1.0)[self._owner]
        nodes = np.arange(len(self._owner))
        return csr_matrix((weight, (self._owner, nodes)), (len(self._areas), len(nodes)))

    @cached_property
    def _absorbed(self) -> Array:
        return np.concatenate([self.emissivity, self.wall_emissivity, [1.0]])

    def _irradiation(self, power: Array) -> Array:
        """What arrives at each surface per area, (m, k), of emissive powers (m, k).

        A G = S J with J = eps E + (1 - eps) G; y = sqrt(1 - eps) G makes the matrix symmetric and
        positive definite, and nothing divides by 1 - eps.
        """
        s, owner = self._exchange, self._owner
        a = np.where(self._node_areas > 0.0, self._node_areas, 1.0)[:, None]
        root = np.sqrt(1.0 - self._absorbed)[owner][:, None]
        sent = (self._absorbed[:, None] * power)[owner]
        y = conjugate_gradients(lambda v: a * v - root * s(root * v), root * s(sent), 1.0 / a)
        irradiation: Array = self._mean @ (s(sent + root * y) / a)
        return irradiation

    def heats(
        self, power: ArrayLike, wall_power: ArrayLike = 0.0, outer_power: float = 0.0
    ) -> NetHeats:
        r"""Net heats of all surfaces from their emissive powers.

        .. math:: q_i = A_i\varepsilon_i\left(E_i - \sum_j D_{ij} E_j\right)

        Parameters
        ----------
        power : array_like, shape () or (n,)
            Black emissive power sigma T^4 of the spheres [W/m2].
        wall_power : array_like, shape () or (n_walls,)
            Of the walls [W/m2]; of one with emissivity 0 it does not matter.
        outer_power : float
            Of what the opening looks at [W/m2].

        Returns
        -------
        NetHeats
            They add up to zero, to round-off.

        Raises
        ------
        InputError
            For shapes that disagree or numbers that are not finite.
        """
        n, n_walls = len(self), len(self.wall_emissivity)
        e = np.concatenate(
            [_spread(power, n, "power"), _spread(wall_power, n_walls, "wall_power"),
             _spread(outer_power, 1, "outer_power")]
        )  # fmt: skip
        # Only differences move heat: without the common part fewer digits are lost.
        e = e - e.min()
        q = self._areas * self._absorbed * (e - self._irradiation(e[:, None])[:, 0])
        return NetHeats(q[:n], q[n:-1], float(q[-1]))

    def emitted_by(self, spheres: ArrayLike) -> Shares:
        """Rows of some spheres: who absorbs what they emit.

        Parameters
        ----------
        spheres : array_like of int, shape (k,)
            The emitters.

        Raises
        ------
        InputError
            For a sphere that does not exist.
        """
        n = len(self)
        who = np.atleast_1d(np.asarray(spheres))
        if who.ndim != 1 or who.dtype.kind not in "iu" or ((who < 0) | (who >= n)).any():
            raise InputError(
                f"spheres must be whole numbers in 0 ... {n - 1}, in one list; mend it."
            )
        weight = self._areas * self._absorbed
        out = np.empty((len(who), len(weight)))
        for first in range(0, len(who), BLOCK):
            some = who[first : first + BLOCK]
            unit = np.zeros((len(weight), len(some)))
            unit[some, np.arange(len(some))] = 1.0
            # Column i of D, and by A_i eps_i D_ij = A_j eps_j D_ji its row.
            out[first : first + BLOCK] = (weight[:, None] * self._irradiation(unit)).T
            out[first : first + BLOCK] /= weight[some][:, None]
        # Signs of round-off where no light goes.
        out = np.maximum(out, 0.0)
        return Shares(out[:, :n], out[:, n:-1], out[:, -1])

    def rows(self) -> Rows:
        """Rows of all spheres, as traced ones: for :func:`radiative_network` and thermal beds.

        Returns
        -------
        Rows
            Full, so 12 n^2 bytes; ``areas`` are the emission areas and ``emissivity`` is set.

        Raises
        ------
        InputError
            For more than 10,000 spheres: take :meth:`emitted_by` or :meth:`heats`.
        """
        n = len(self)
        if n > MOST_ROWS:
            raise InputError(
                f"all rows of {n} spheres would be a full matrix (at most {MOST_ROWS}); take "
                "emitted_by for some of them, or heats."
            )
        every = self.emitted_by(np.arange(n))
        return Rows(
            csr_matrix(every.factors), every.wall_factors, every.escaped, self.emission_areas,
            self.emissivity,
        )  # fmt: skip


def diffuse_exchange(
    factors: Any,
    emissivity: ArrayLike,
    *,
    wall_emissivity: ArrayLike = 1.0,
    wall_exchange: ArrayLike | None = None,
    packing: Packing | None = None,
    sides: int = 24,
) -> DiffuseExchange:
    """Exchange factors of a bed from its view factors, as an operator.

    Parameters
    ----------
    factors : object
        View factors, from a closure or traced: anything with ``factors``, ``wall_factors``,
        ``escaped`` and ``areas``. Balanced here unless they are.
    emissivity : array_like, shape () or (n,)
        Of the spheres, 0.001 ... 1 [-].
    wall_emissivity : array_like, shape () or (n_walls,)
        Of the walls, 0 ... 1 [-]; one with 0 sends back all it gets, evenly.
    wall_exchange : array_like, shape (n_walls, n_walls), optional
        Exchange areas A F between the walls themselves, symmetric [m2]; zero by default. They
        matter for grey walls only: what a black wall absorbs is not sent on.
    packing : Packing, optional
        The bed that the factors belong to. With it, each sphere has ``sides``: what it reflects
        leaves from where it was lit. Without it, one radiosity per sphere.
    sides : int
        1 ... 1000 [-]; 1 is one radiosity per sphere, more than 24 change nothing to speak of.

    Returns
    -------
    DiffuseExchange

    Raises
    ------
    InputError
        For numbers out of range, shapes that disagree, factors that hold reflections already, or
        rows that cannot be balanced.

    Notes
    -----
    With one radiosity per sphere reflected light leaves all round, though it came from one side:
    near pairs and a sphere's own return come out too small, far ones and walls too large. Sides,
    which see their neighbours by the profile of free pairs, remove most of that
    (``docs/closures.md``); they take 12 bytes for each side and view factor, and the time for as
    many. Walls other than planes are seen alike from all sides. Source: Gebhart, Int. J. Heat Mass
    Transfer 3 (1961) 341; Howell, Menguc & Siegel, Thermal Radiation Heat Transfer, enclosures of
    diffuse-grey surfaces; the sides are our own.

    Examples
    --------
    Two spheres that see only each other and, mostly, the opening:

    >>> rows = Rows([[0.0, 0.1], [0.1, 0.0]], np.zeros((2, 0)), [0.9, 0.9], [1.0, 1.0])
    >>> shares = diffuse_exchange(rows, 0.5).emitted_by([0])
    >>> print(shares.factors.round(6), shares.escaped.round(6))  # 0.05 / (1 - 0.05^2)
    [[0.002506 0.050125]] [0.947368]
    """
    rows = Rows.taken(factors)
    if rows.emissivity is not None:
        raise InputError(
            "these factors hold reflections already; give view factors (exchange factors at "
            "emissivity 1)."
        )
    n, n_walls = rows.wall_factors.shape
    eps = _share(emissivity, n, "emissivity", LEAST_EMISSIVITY)
    wall_eps = _share(wall_emissivity, n_walls, "wall_emissivity", 0.0)
    between = np.zeros((n_walls, n_walls))
    if wall_exchange is not None:
        between = np.asarray(wall_exchange, dtype=np.float64)
        if between.shape != (n_walls, n_walls) or not (
            np.isfinite(between).all()
            and (between >= 0.0).all()
            and np.allclose(between, between.T, rtol=1e-9, atol=0.0)
        ):
            raise InputError(
                f"wall_exchange of shape {between.shape} must be ({n_walls}, {n_walls}), "
                "symmetric, finite and at least 0 [m2]; mend it."
            )
        between = 0.5 * (between + between.T)
    if not 1 <= sides <= MOST_SIDES:
        raise InputError(f"sides = {sides} [-] must lie in 1 ... {MOST_SIDES}; take 24.")
    if packing is not None and (len(packing), packing.n_walls) != (n, n_walls):
        raise InputError(
            f"the factors are for {n} spheres and {n_walls} walls, but {packing.source} has "
            f"{len(packing)} and {packing.n_walls}; give the packing that they were made from."
        )
    view = rows if rows.imbalance < 1e-12 else balanced(rows)
    return DiffuseExchange(
        view, eps, wall_eps, between, packing, 1 if packing is None else int(sides)
    )


def _spread(values: ArrayLike, n: int, name: str) -> Array:
    array = np.asarray(values, dtype=np.float64)
    if array.shape not in ((), (n,)) or not np.isfinite(array).all():
        raise InputError(f"{name} of shape {array.shape} must be finite, one value or {n} of them.")
    return np.array(np.broadcast_to(array, (n,)))


def _share(values: ArrayLike, n: int, name: str, least: float) -> Array:
    array = _spread(values, n, name)
    bad = ~((array >= least) & (array <= 1.0))
    if bad.any():
        raise InputError(f"{name} = {array[bad][0]:g} [-] is outside {least:g} ... 1; mend it.")
    return array
