"""Heat conduction through the contacts of spheres with each other and with walls."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_matrix, csr_matrix

from greybed.core.errors import InputError
from greybed.core.packing import Packing
from greybed.core.walls import Cone, Cylinder, Plane, Wall

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Conductances:
    """Conductances of all contacts of a bed.

    Attributes
    ----------
    matrix : csr matrix, shape (n, n)
        Between spheres, symmetric, zero diagonal [W/K].
    walls : array, shape (n, n_walls)
        Between spheres and walls [W/K].
    contact_radius : array, shape (n_contacts,)
        Radii of the contact spots between spheres [m].
    """

    matrix: csr_matrix
    walls: Array
    contact_radius: Array

    @property
    def n_contacts(self) -> int:
        """Number of contacts between spheres [-]."""
        return len(self.contact_radius)


def per_sphere(values: ArrayLike, n: int, name: str, unit: str, *, at_most: float) -> Array:
    """Spread a scalar or (n,) value over ``n`` spheres, after checking it is in (0, ``at_most``].

    Raises
    ------
    InputError
        If the shape is neither () nor (n,), or a value is out of range or not finite.
    """
    array = np.asarray(values, dtype=np.float64)
    if array.shape not in ((), (n,)):
        raise InputError(
            f"{name} has shape {array.shape}; give one value or one per sphere, shape ({n},)."
        )
    bad = ~(np.isfinite(array) & (array > 0.0) & (array <= at_most))
    if bad.any():
        where = f"{name}[{int(bad.argmax())}]" if array.ndim else name
        bound = "finite and above 0" if math.isinf(at_most) else f"above 0 and at most {at_most:g}"
        raise InputError(f"{where} = {array[bad].flat[0]:g} [{unit}] must be {bound}; mend it.")
    return np.array(np.broadcast_to(array, (n,)))


def _from_axis(centres: Array, wall: Cylinder | Cone) -> tuple[Array, Array]:
    """Place along the axis of a round wall and distance from it, shape (n,) each [m]."""
    offset, axis = centres - np.asarray(wall.point), np.asarray(wall.axis)
    along = offset @ axis
    return along, np.linalg.norm(offset - np.outer(along, axis), axis=1)


def _curvature(centres: Array, wall: Cylinder | Cone) -> Array:
    """Curvature of a bounded round wall where it is nearest, above zero inside [1/m]."""
    length = wall.length or 0.0
    widening = (wall.end_radius if isinstance(wall, Cone) else wall.radius) - wall.radius
    along, from_axis = _from_axis(centres, wall)
    place = (from_axis - wall.radius) * widening + along * length
    place /= widening**2 + length**2
    radius = wall.radius + place * widening
    on_side = (place > 0.0) & (place < 1.0)
    # Across the slope; along it the wall is straight (Meusnier).
    across = length / (np.hypot(length, widening) * np.where(on_side, radius, 1.0))
    return np.where(on_side, np.where(from_axis < radius, across, -across), 0.0)


def wall_contacts(packing: Packing, wall: Wall) -> tuple[Array, Array]:
    """Overlap and effective radius of every sphere with one wall.

    Parameters
    ----------
    packing : Packing
        The bed.
    wall : any wall
        One of its walls.

    Returns
    -------
    overlap : (n,) array
        Depth of the sphere in the wall, negative where there is a gap [m].
    effective_radius : (n,) array
        r for a plane, disc, polygon or mesh; for the inside of a cylinder or cone of radius of
        curvature R the geometric mean ``1/sqrt(1/r (1/r - 1/R))`` of the two relative radii of
        curvature, with 1/R below zero on the outside of a tube [m].

    Raises
    ------
    InputError
        If a centre lies behind the wall or a sphere is not smaller than the cylinder.

    Notes
    -----
    Source: Johnson, Contact Mechanics (1985), sections 4.1-4.2; replacing the slightly elliptic
    spot by a circle of the mean curvature changes the area by less than 1 % for r/R < 0.5. Edges of
    bounded walls are taken as flat: the spot of a sphere on an edge is smaller than that.
    """
    r = packing.radii
    if isinstance(wall, Plane):
        offset = packing.centres - np.asarray(wall.point)
        gap, curvature = offset @ np.asarray(wall.normal) - r, np.zeros(len(r))
    elif isinstance(wall, Cylinder) and wall.length is None:
        gap = wall.radius - _from_axis(packing.centres, wall)[1] - r
        curvature = np.full(len(r), 1.0 / wall.radius)
    else:
        from greybed.core.patches import distances

        gap = distances([wall], packing.centres) - r
        curvature = np.zeros(len(r))
        if isinstance(wall, Cone | Cylinder):
            curvature = _curvature(packing.centres, wall)
    if (r * curvature >= 1.0).any():
        i = int((r * curvature).argmax())
        raise InputError(
            f"{packing.source}: sphere {i} with radius {r[i]:g} [m] does not fit into wall "
            f"{wall.name!r} of radius {1.0 / curvature[i]:g} [m]; check units and walls."
        )
    effective = r / np.sqrt(1.0 - r * curvature)
    behind = gap < -r
    if behind.any():
        i = int(behind.argmax())
        raise InputError(
            f"{packing.source}: the centre of sphere {i} lies {-gap[i] - r[i]:g} [m] behind wall "
            f"{wall.name!r}; check the wall's point, direction and units, or remove the sphere."
        )
    return -gap, effective


def contact_conductances(
    packing: Packing,
    conductivity: ArrayLike,
    *,
    stiffness_ratio: float = 1.0,
    touching_gap: float = 0.0,
    wall_conductivity: float = math.inf,
) -> Conductances:
    r"""Conductances of the contacts between spheres and with walls.

    .. math:: H = 2 k_{eff} a,\quad k_{eff} = 2 k_1 k_2/(k_1 + k_2),\quad a = \sqrt{R^* \delta}

    Parameters
    ----------
    packing : Packing
        The bed; periodic contacts count.
    conductivity : array_like, shape () or (n,)
        Conductivity of the spheres, above zero [W/m/K].
    stiffness_ratio : float
        Real Young's modulus over the one with which the bed was simulated, above zero [-]. Soft
        contacts are too wide: at a given Hertz force the overlap goes with E^(-2/3), so the
        contact radius and the conductance are scaled by ``stiffness_ratio**(-1/3)``.
    touching_gap : float
        Every pair is moved together by this distance before its overlap is taken, zero or above
        [m]; it makes up for coordinates that were rounded in a file. At 0 a pair with a gap
        conducts nothing.
    wall_conductivity : float
        Conductivity of the walls, above zero [W/m/K]; infinite makes the contact spot
        isothermal at the wall temperature.

    Returns
    -------
    Conductances
        Zero wherever the surfaces do not touch.

    Raises
    ------
    InputError
        For a value out of range, or a sphere behind a wall.

    Notes
    -----
    ``a`` is the Hertz contact radius (overlap depth shared by the deformation of both surfaces),
    not the radius of the geometric lens, which is larger by sqrt(2). The law holds for a much
    smaller than the radii, where the two halves are constrictions in half-spaces in series.
    Gas in the gaps is not included. Source: Batchelor & O'Brien, Proc. R. Soc. Lond. A 355
    (1977) 313; contact radius: Johnson, Contact Mechanics (1985), section 4.2.
    """
    n, r = len(packing), packing.radii
    k = per_sphere(conductivity, n, "conductivity", "W/m/K", at_most=math.inf)
    if not (math.isfinite(stiffness_ratio) and stiffness_ratio > 0.0):
        raise InputError(
            f"stiffness_ratio = {stiffness_ratio:g} [-] must be finite and above 0; "
            "give real over simulated Young's modulus, or 1."
        )
    if not (math.isfinite(touching_gap) and touching_gap >= 0.0):
        raise InputError(
            f"touching_gap = {touching_gap:g} [m] must be finite and at least 0; give metres, or 0."
        )
    if not wall_conductivity > 0.0:
        raise InputError(
            f"wall_conductivity = {wall_conductivity:g} [W/m/K] must be above 0; for a wall "
            "without heat give it no temperature (adiabatic)."
        )
    shrink = stiffness_ratio ** (-1.0 / 3.0)
    pairs, distance = packing.neighbours(touching_gap)
    overlap = r[pairs].sum(axis=1) - distance + touching_gap
    reduced = r[pairs].prod(axis=1) / r[pairs].sum(axis=1)
    spot = np.sqrt(reduced * overlap) * shrink
    k_1, k_2 = k[pairs].T
    # Two half-spaces in series, each 4 k a; equals 2 k_eff a.
    conductance = 4.0 * spot * k_1 * k_2 / (k_1 + k_2)
    half = coo_matrix((conductance, (pairs[:, 0], pairs[:, 1])), shape=(n, n)).tocsr()

    walls = np.zeros((n, packing.n_walls))
    k_wall = k if math.isinf(wall_conductivity) else k / (1.0 + k / wall_conductivity)
    for w, wall in enumerate(packing.walls):
        depth, effective = wall_contacts(packing, wall)
        walls[:, w] = (
            4.0 * k_wall * shrink * np.sqrt(effective * np.maximum(depth + touching_gap, 0))
        )
    return Conductances((half + half.T).tocsr(), walls, spot)
