"""What is measured of a bed or pile: height, profile, angles, solid fraction, segregation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError

Array = NDArray[np.float64]

# Directions by which the surface of a sphere is found in a profile: see pile_profile.
_AROUND = 16


@dataclass(frozen=True, eq=False)
class Profile:
    """Height of a surface over a coordinate.

    Attributes
    ----------
    position : ndarray, shape (m,)
        Middle of each bin: along an axis, or from the axis of a heap [m].
    height : ndarray, shape (m,)
        Highest surface in the bin [m]; NaN in empty ones.
    width : float
        Of a bin [m].
    """

    position: Array
    height: Array
    width: float

    def slope(self, low: float = 0.2, high: float = 0.8) -> tuple[float, float]:
        """Angle of the straight line through the flank, and its standard error [degrees].

        Parameters
        ----------
        low, high : float
            Shares of the height between which the flank is, 0 <= low < high <= 1 [-]: foot and
            top are rounded, so they are left out.

        Returns
        -------
        angle, error : float
            Positive where the surface falls with the position.

        Raises
        ------
        InputError
            If fewer than three bins are left.
        """
        if not 0.0 <= low < high <= 1.0:
            raise InputError(f"low = {low:g} and high = {high:g} must be 0 <= low < high <= 1 [-].")
        known = np.isfinite(self.height)
        x, h = self.position[known], self.height[known]
        if len(h):
            bottom, top = float(h.min()), float(h.max())
            flank = (h >= bottom + low * (top - bottom)) & (h <= bottom + high * (top - bottom))
            x, h = x[flank], h[flank]
        if len(h) < 3:
            raise InputError(
                f"the flank has {len(h)} bins, and a line needs three; take narrower bins."
            )
        away = x - x.mean()
        steep = float(away @ (h - h.mean()) / (away @ away))
        left = h - h.mean() - steep * away
        spread = math.sqrt(float(left @ left) / max(len(h) - 2, 1) / float(away @ away))
        return -math.degrees(math.atan(steep)), math.degrees(spread / (1.0 + steep * steep))


def pile_profile(
    centres: ArrayLike,
    radii: ArrayLike,
    width: float,
    *,
    axis: int | None = None,
    middle: tuple[float, float] | None = None,
) -> Profile:
    """Highest surface of a bed over a horizontal axis, or over the distance from a heap's axis.

    Parameters
    ----------
    centres, radii : array_like, shapes (n, 3) and (n,)
        Spheres; z points up [m].
    width : float
        Of a bin, above 0 [m]; two particle diameters is a good choice.
    axis : {0, 1}, optional
        Along x or y; radially by default.
    middle : (x, y), optional
        Axis of a heap; by default through the centre of mass of the spheres [m].

    Returns
    -------
    Profile

    Raises
    ------
    InputError
        For an axis or a width out of range, or no spheres.
    """
    x, r = _spheres(centres, radii)
    if not (width > 0.0 and math.isfinite(width)):
        raise InputError(f"width = {width:g} [m] must be finite and above 0.")
    if axis not in (None, 0, 1):
        raise InputError(f"axis = {axis} must be 0 or 1, or left out for a heap.")
    # Tops of spheres, and points a little beside them: bins at a sphere's edge see its shoulder.
    turn = 2.0 * math.pi * np.arange(_AROUND) / _AROUND
    rings = [(0.0, 1.0), (0.5, math.sqrt(0.75)), (0.9, math.sqrt(0.19))]
    at, high = [], []
    for across, up in rings:
        for angle in turn if across else turn[:1]:
            step = np.column_stack([math.cos(angle) * across * r, math.sin(angle) * across * r])
            at.append(x[:, :2] + step)
            high.append(x[:, 2] + up * r)
    where, height = np.concatenate(at), np.concatenate(high)
    if axis is None:
        mass = r**3 / (r**3).sum()
        centre = mass @ x[:, :2] if middle is None else np.asarray(middle, dtype=np.float64)
        along = np.hypot(*(where - centre).T)
        first = 0
    else:
        along = where[:, axis]
        first = math.floor(float(along.min()) / width)
    bin_of = np.floor(along / width).astype(np.int64) - first
    result = np.full(int(bin_of.max()) + 1, -np.inf)
    np.maximum.at(result, bin_of, height)
    result[np.isneginf(result)] = np.nan
    position = np.asarray((np.arange(len(result)) + first + 0.5) * width, dtype=np.float64)
    return Profile(position, result, width)


def bed_height(centres: ArrayLike, radii: ArrayLike, share: float = 0.98) -> float:
    """Height below which a share of the solid volume lies, spheres counted at their tops [m].

    Parameters
    ----------
    centres, radii : array_like, shapes (n, 3) and (n,)
        Spheres [m].
    share : float
        Above 0, at most 1 [-]; 1 is the top of the highest sphere.

    Raises
    ------
    InputError
        For a share out of range, or no spheres.
    """
    x, r = _spheres(centres, radii)
    if not 0.0 < share <= 1.0:
        raise InputError(f"share = {share:g} [-] is outside (0, 1].")
    top = x[:, 2] + r
    order = np.argsort(top, kind="stable")
    volume = np.cumsum(r[order] ** 3)
    return float(top[order][np.searchsorted(volume, share * volume[-1] * (1.0 - 1e-12))])


def solid_profile(
    centres: ArrayLike, radii: ArrayLike, edges: ArrayLike, area: float, *, axis: int = 2
) -> Array:
    """Solid fraction between parallel planes, exactly.

    Parameters
    ----------
    centres, radii : array_like, shapes (n, 3) and (n,)
        Spheres [m].
    edges : array_like, shape (m + 1,)
        Places of the planes, growing [m].
    area : float
        Of the bed across the axis, above 0 [m2].
    axis : {0, 1, 2}
        Across the planes.

    Returns
    -------
    ndarray, shape (m,)
        Solid volume over the volume of each slice [-].

    Raises
    ------
    InputError
        For numbers out of range.
    """
    x, r = _spheres(centres, radii)
    planes = np.asarray(edges, dtype=np.float64)
    if planes.ndim != 1 or len(planes) < 2 or not (np.diff(planes) > 0.0).all():
        raise InputError("edges must be two growing numbers [m] at least; mend them.")
    if not (area > 0.0 and axis in (0, 1, 2)):
        raise InputError(f"area = {area:g} [m2] must be above 0, axis = {axis} 0, 1 or 2.")
    below = np.zeros(len(planes))
    for k, plane in enumerate(planes):
        # Volume of a sphere below a plane: a cap of height h.
        h = np.clip(plane - x[:, axis] + r, 0.0, 2.0 * r)
        below[k] = (math.pi * h * h * (r - h / 3.0)).sum()
    return np.diff(below) / (area * np.diff(planes))


def solid_field(
    centres: ArrayLike,
    radii: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    shape: ArrayLike,
    *,
    volumes: ArrayLike | None = None,
) -> Array:
    """Solid fraction in the cells of a grid, each sphere split over the cells that it reaches.

    Parameters
    ----------
    centres, radii : array_like, shapes (n, 3) and (n,)
        Spheres [m].
    lower, upper : array_like, shape (3,)
        Corners of the grid [m].
    shape : three ints
        Cells along each axis, at least 1.
    volumes : array_like, shape (n,), optional
        Solid volume that each sphere stands for, where they overlap in clumps [m3].

    Returns
    -------
    ndarray, shape ``shape``
        Solid volume over the volume of a cell [-]; what lies outside is not counted.

    Raises
    ------
    InputError
        For corners or a shape out of range.

    Notes
    -----
    A sphere is 512 points of equal volume, so a cell of the size of a sphere is right to some per
    mille of it.
    """
    x, r = _spheres(centres, radii)
    low, high = np.asarray(lower, dtype=np.float64), np.asarray(upper, dtype=np.float64)
    cells = np.asarray(shape, dtype=np.int64)
    if low.shape != (3,) or high.shape != (3,) or not (high > low).all():
        raise InputError("lower and upper must be two corners, upper above lower [m].")
    if cells.shape != (3,) or cells.min() < 1:
        raise InputError(f"shape = {cells.tolist()} must be three numbers, 1 at least.")
    points = _ball(512)
    ball = 4.0 / 3.0 * math.pi * r**3
    solids = ball if volumes is None else np.asarray(volumes, dtype=np.float64)
    solid = np.zeros(int(cells.prod()))
    for first in range(0, len(r), 4096):
        some = slice(first, first + 4096)
        place = x[some, None, :] + r[some, None, None] * points
        index = np.floor((place - low) / (high - low) * cells).astype(np.int64)
        inside = ((index >= 0) & (index < cells)).all(axis=2)
        flat = (index[..., 0] * cells[1] + index[..., 1]) * cells[2] + index[..., 2]
        weight = np.repeat(solids[some] / len(points), len(points))
        solid += np.bincount(flat[inside], weight[inside.ravel()], len(solid))
    return (solid / ((high - low) / cells).prod()).reshape(tuple(cells))


def segregation(
    centres: ArrayLike, masses: ArrayLike, kinds: ArrayLike, edges: ArrayLike, *, axis: int = 0
) -> tuple[Array, float]:
    """Mass share of each kind in compartments, and the intensity of segregation.

    Parameters
    ----------
    centres : array_like, shape (n, 3)
        Centres [m].
    masses : array_like, shape (n,)
        Above 0 [kg].
    kinds : array_like of int, shape (n,)
        Kind of each particle, from 0 on.
    edges : array_like, shape (m + 1,)
        Where the compartments end along the axis [m].
    axis : {0, 1, 2}
        Along the compartments.

    Returns
    -------
    shares : ndarray, shape (m, kinds)
        Of each kind in the mass of each compartment [-]; NaN where there is none.
    intensity : float
        Variance of the share of kind 0, weighted by mass, over the p (1 - p) of complete
        segregation: 0 (mixed) to 1 [-] (Danckwerts, Appl. Sci. Res. A3, 1952, 279). NaN where the
        compartments are empty.
    """
    x, m, k = np.asarray(centres)[:, axis], np.asarray(masses), np.asarray(kinds, dtype=np.int64)
    cells = len(np.asarray(edges)) - 1
    place = np.searchsorted(np.asarray(edges), x, side="right") - 1
    inside = (place >= 0) & (place < cells)
    table = np.zeros((cells, int(k.max()) + 1))
    np.add.at(table, (place[inside], k[inside]), m[inside])
    total = table.sum(axis=1)
    with np.errstate(invalid="ignore"):
        shares = table / total[:, None]
    if not total.any():
        return shares, math.nan
    whole = table.sum(axis=0) / total.sum()
    used = total > 0.0
    variance = float(total[used] @ (shares[used, 0] - whole[0]) ** 2 / total.sum())
    most = float(whole[0] * (1.0 - whole[0]))
    return shares, variance / most if most > 0.0 else 0.0


def _spheres(centres: ArrayLike, radii: ArrayLike) -> tuple[Array, Array]:
    x = np.asarray(centres, dtype=np.float64)
    r = np.array(np.broadcast_to(np.asarray(radii, dtype=np.float64), x.shape[:1]))
    if x.ndim != 2 or x.shape[1] != 3 or not len(x):
        raise InputError(f"centres of shape {x.shape} must be (n, 3), n at least 1.")
    return x, r


def _ball(count: int) -> Array:
    """Points of equal volume in the unit ball: radii by shells, directions on a spiral."""
    k = np.arange(count) + 0.5
    radius = np.cbrt(k / count)
    golden = math.pi * (1.0 + math.sqrt(5.0))
    # The direction must not follow the radius: its order is turned upside down by bits.
    turn = (k * 0.6180339887498949) % 1.0
    up = 1.0 - 2.0 * turn
    flat = np.sqrt(1.0 - up * up)
    angle = golden * k * 0.7548776662466927
    return radius[:, None] * np.column_stack([flat * np.cos(angle), flat * np.sin(angle), up])
