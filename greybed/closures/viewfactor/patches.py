r"""Exact view factors from a sphere to a bounded wall that it sees freely.

A sphere that no wall's plane cuts radiates to a flat patch as a point source in its centre would:
every point of the patch is lit by the whole of the sphere's disc, and the flux through the patch
falls with the cosine and the square of the distance to the centre, whatever the radius. So

.. math:: F = \Omega / 4\pi

with the solid angle under which the patch is seen from the centre. The solid angle of a triangle
is that of van Oosterom & Strackee (1983, doi 10.1109/TBME.1983.325207), of a disc the one by
complete elliptic integrals (Paxton 1959, doi 10.1063/1.1716590), here in Carlson's forms.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core import InputError, Mesh, Polygon, RangeError

Array = NDArray[np.float64]

# From so many disc radii on a product rule takes over: the closed form cancels, the rule does not.
FAR = 4.0
NODES = 24


def _points(values: ArrayLike, what: str) -> Array:
    points = np.asarray(values, dtype=np.float64)
    if points.shape[-1:] != (3,) or not np.isfinite(points).all():
        raise InputError(f"{what} of shape {points.shape} must be finite vectors (..., 3) [m].")
    return points


def _free(height: Array, radius: ArrayLike | None, what: str) -> None:
    """Refuse centres from which a plane at ``height`` cuts the sphere."""
    reach = np.zeros(()) if radius is None else np.asarray(radius, dtype=np.float64)
    if not (np.abs(height) >= reach).all() or not (height != 0.0).all():
        raise RangeError(
            f"the plane of {what} cuts the sphere (it passes {np.abs(height).min():g} [m] from the "
            "centre), where the solid angle is not the view factor; trace it instead."
        )


def _triangle_angles(centre: Array, triangles: Array) -> Array:
    """Signed solid angles (..., m) of triangles (m, 3, 3) seen from centres (..., 3) [sr]."""
    to = triangles - centre[..., None, None, :]
    a, b, c = to[..., 0, :], to[..., 1, :], to[..., 2, :]
    la, lb, lc = (np.sqrt((v**2).sum(axis=-1)) for v in (a, b, c))
    # From differences of the corners: for small triangles far away it cancels less.
    triple = (a * np.cross(b - a, c - a)).sum(axis=-1)
    below = (
        la * lb * lc
        + (a * b).sum(axis=-1) * lc
        + (a * c).sum(axis=-1) * lb
        + (b * c).sum(axis=-1) * la
    )
    return 2.0 * np.arctan2(triple, below)


def sphere_to_polygon(
    centre: ArrayLike, vertices: ArrayLike, radius: ArrayLike | None = None
) -> Array:
    """Exact factor from a sphere to a flat polygon.

    Parameters
    ----------
    centre : array_like, shape (..., 3)
        Centres of spheres [m].
    vertices : array_like, shape (k, 3)
        Corners in order, convex or not [m].
    radius : array_like, shape (...), optional
        Radii, only to check that the plane does not cut the sphere [m]; the factor does not
        depend on them.

    Returns
    -------
    factor : array, shape (...)
        Share of the sphere's radiation that meets the polygon, from either side, 0 to 1/2 [-].

    Raises
    ------
    InputError
        If the corners are no flat polygon.
    RangeError
        If the polygon's plane passes through the centre, or nearer to it than ``radius``.
    """
    c = _points(centre, "centre")
    polygon = Polygon(tuple(map(tuple, _points(vertices, "vertices"))))
    corners = np.array(polygon.vertices)
    _free((c - corners[0]) @ np.array(polygon.normal), radius, "the polygon")
    # A fan from one corner: of a polygon that is not convex, signed parts take off the excess.
    k = len(corners)
    fan = np.stack([np.broadcast_to(corners[0], (k - 2, 3)), corners[1:-1], corners[2:]], axis=1)
    return np.abs(_triangle_angles(c, fan).sum(axis=-1)) / (4.0 * np.pi)


def sphere_to_triangle(
    centre: ArrayLike, vertices: ArrayLike, radius: ArrayLike | None = None
) -> Array:
    """Exact factor from a sphere to a triangle with corners (3, 3); see :func:`sphere_to_polygon`.

    Raises
    ------
    InputError
        For any other number of corners, or no area.
    RangeError
        As :func:`sphere_to_polygon`.
    """
    corners = _points(vertices, "vertices")
    if corners.shape != (3, 3):
        raise InputError(f"vertices of shape {corners.shape} are no triangle; give (3, 3) [m].")
    return sphere_to_polygon(centre, corners, radius)


def sphere_to_rectangle(
    centre: ArrayLike,
    corner: ArrayLike,
    first: ArrayLike,
    second: ArrayLike,
    radius: ArrayLike | None = None,
) -> Array:
    """Exact factor from a sphere to a rectangle.

    Parameters
    ----------
    centre : array_like, shape (..., 3)
        Centres of spheres [m].
    corner : array_like, shape (3,)
        One corner [m].
    first, second : array_like, shape (3,)
        The two edges that begin there, at a right angle [m].
    radius : array_like, shape (...), optional
        Radii, only to check that the plane does not cut the sphere [m].

    Returns
    -------
    factor : array, shape (...)
        0 to 1/2 [-].

    Raises
    ------
    InputError
        If the edges have no length or stand askew.
    RangeError
        As :func:`sphere_to_polygon`.

    Notes
    -----
    Seen from height h above one corner a rectangle a b covers
    ``atan(a b / (h sqrt(a^2 + b^2 + h^2)))``; any other one is put together of four of these.
    """
    c, begin = _points(centre, "centre"), _points(corner, "corner")
    u, v = _points(first, "first"), _points(second, "second")
    a, b = float(np.linalg.norm(u)), float(np.linalg.norm(v))
    if not (a > 0.0 and b > 0.0 and abs(float(u @ v)) <= 1e-9 * a * b):
        raise InputError(
            f"edges {u.tolist()} and {v.tolist()} [m] must have a length and a right angle between "
            "them; for other shapes take sphere_to_polygon."
        )
    offset = c - begin
    x, y = offset @ (u / a), offset @ (v / b)
    h = np.abs(offset @ (np.cross(u, v) / (a * b)))
    _free(h, radius, "the rectangle")

    def part(p: Array, q: Array) -> Array:
        return np.arctan(p * q / (h * np.sqrt(p * p + q * q + h * h)))

    total = part(a - x, b - y) + part(x, b - y) + part(a - x, y) + part(x, y)
    return np.abs(total) / (4.0 * np.pi)


def sphere_to_disk(
    centre: ArrayLike,
    point: ArrayLike,
    normal: ArrayLike,
    disk_radius: float,
    radius: ArrayLike | None = None,
) -> Array:
    r"""Exact factor from a sphere to a disc.

    Parameters
    ----------
    centre : array_like, shape (..., 3)
        Centres of spheres [m].
    point : array_like, shape (3,)
        Middle of the disc [m].
    normal : array_like, shape (3,)
        Its normal, to either side, of any length [-].
    disk_radius : float
        Its radius, above zero [m].
    radius : array_like, shape (...), optional
        Radii of the spheres, only to check that the plane does not cut them [m].

    Returns
    -------
    factor : array, shape (...)
        0 to 1/2 [-]; on the axis, at height h, ``(1 - 1/sqrt(1 + (R/h)^2)) / 2``.

    Raises
    ------
    InputError
        If the normal or the radius is nothing.
    RangeError
        As :func:`sphere_to_polygon`.

    Notes
    -----
    At height h and distance s from the axis, with :math:`q^2 = h^2 + (R+s)^2`,
    :math:`k^2 = 4Rs/q^2` and :math:`n = 4Rs/(R+s)^2`,

    .. math:: \Omega = 2\pi H(R-s) - \frac{2h}{q}\left[K(k) + \frac{R-s}{R+s}\Pi(n, k)\right],

    H being 0, 1/2 or 1. From four radii on a product rule of 24 x 48 points over the disc keeps
    the relative precision that the difference would lose.
    """
    c, middle, n = _points(centre, "centre"), _points(point, "point"), _points(normal, "normal")
    length = float(np.linalg.norm(n))
    if not (length > 0.0 and np.isfinite(disk_radius) and disk_radius > 0.0):
        raise InputError(
            f"a disc of radius {disk_radius!r} [m] and normal {n.tolist()} is none; give a radius "
            "above 0 and a direction."
        )
    offset = (c - middle) / disk_radius
    signed = offset @ (n / length)
    h = np.abs(signed)
    _free(h * disk_radius, radius, "the disc")
    s = np.sqrt(((offset - signed[..., None] * (n / length)) ** 2).sum(axis=-1))
    far = h * h + s * s > FAR**2
    angle = np.empty(np.shape(h))
    angle[far] = _far_disk(h[far], s[far])
    angle[~far] = _near_disk(h[~far], s[~far])
    return angle / (4.0 * np.pi)


def _near_disk(h: Array, s: Array) -> Array:
    """Solid angle of the unit disc at height h, distance s from the axis [sr]."""
    from scipy.special import elliprf, elliprj

    q2 = h * h + (1.0 + s) ** 2
    m1 = (h * h + (1.0 - s) ** 2) / q2  # 1 - k^2, without the difference
    n1 = ((1.0 - s) / (1.0 + s)) ** 2  # 1 - n
    first = elliprf(0.0, m1, 1.0)
    # At the rim Pi is infinite and its factor zero; the jump of H takes the limit up.
    rim = n1 == 0.0
    third = first + (1.0 - n1) / 3.0 * elliprj(0.0, m1, 1.0, np.where(rim, 1.0, n1))
    bracket = first + np.where(rim, 0.0, (1.0 - s) / (1.0 + s) * third)
    inside = np.where(s < 1.0, 1.0, np.where(s > 1.0, 0.0, 0.5))
    return 2.0 * np.pi * inside - 2.0 * h / np.sqrt(q2) * bracket


def _far_disk(h: Array, s: Array) -> Array:
    """The same from afar, by a rule whose terms are all positive [sr]."""
    x, w = np.polynomial.legendre.leggauss(NODES)
    rho, weight = 0.5 * (x + 1.0), 0.25 * w * (x + 1.0)
    turn = (np.arange(2 * NODES) + 0.5) * np.pi / NODES
    square = (
        (h * h + s * s)[..., None, None]
        + (rho**2)[:, None]
        - 2.0 * s[..., None, None] * rho[:, None] * np.cos(turn)
    )
    return h * (square**-1.5 * weight[:, None]).sum(axis=(-1, -2)) * np.pi / NODES


def sphere_to_mesh(centre: ArrayLike, mesh: Mesh, radius: ArrayLike | None = None) -> Array:
    """Exact factor from a sphere to a mesh whose every face it sees freely.

    Parameters
    ----------
    centre : array_like, shape (..., 3)
        Centres of spheres [m].
    mesh : Mesh
        Triangles, met from either side. None may stand before another as seen from the sphere:
        faces in its shadow would count as well. The inside of a convex mesh gives one.
    radius : array_like, shape (...), optional
        Radii, only to check that no face's plane cuts the sphere [m].

    Returns
    -------
    factor : array, shape (...)
        Sum over the faces [-].

    Raises
    ------
    RangeError
        If the plane of a face passes through a centre, or nearer to it than ``radius``; or if the
        faces cover more than all directions, so that some hide others.
    """
    c = _points(centre, "centre")
    triangles = mesh.triangles
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    height = c @ normal.T - (triangles[:, 0] * normal).sum(axis=1)
    reach = None if radius is None else np.asarray(radius, dtype=np.float64)[..., None]
    _free(height, reach, f"a face of {mesh.name!r}")
    total = np.abs(_triangle_angles(c, triangles)).sum(axis=-1) / (4.0 * np.pi)
    if (total > 1.0 + 1e-9).any():
        raise RangeError(
            f"the faces of {mesh.name!r} cover {float(np.max(total)):g} [-] of all directions; "
            "some hide others, so trace it instead."
        )
    return total
