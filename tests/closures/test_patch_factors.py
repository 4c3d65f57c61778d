"""Exact factors to bounded walls against quadrature of the cosine law, and known values."""

import numpy as np
import pytest
from scipy.integrate import dblquad

from greybed.closures.viewfactor.patches import (
    sphere_to_disk,
    sphere_to_mesh,
    sphere_to_polygon,
    sphere_to_rectangle,
    sphere_to_triangle,
)
from greybed.core import InputError, Mesh, RangeError, box_walls

TILTED, _ = np.linalg.qr(np.random.default_rng(11).normal(size=(3, 3)))
SHIFT = np.array([0.3, -5.0, 2.0])


def placed(points):
    """The same geometry, turned and moved."""
    return np.asarray(points, dtype=float) @ TILTED.T + SHIFT


def by_quadrature(low, high, left, right, centre):
    """Share of a point source that meets the part of z = 0 between two curves x(y)."""
    x0, y0, h = centre
    total, _ = dblquad(
        lambda x, y: h / ((x - x0) ** 2 + (y - y0) ** 2 + h**2) ** 1.5,
        low, high, left, right, epsabs=1e-13, epsrel=1e-12,
    )  # fmt: skip
    return total / (4.0 * np.pi)


CENTRES = [(0.2, 0.3, 0.5), (-1.0, 2.0, 0.4), (3.0, -1.0, 2.0), (0.5, 0.5, 0.05)]


@pytest.mark.parametrize("centre", CENTRES)
def test_triangle_and_rectangle(centre):
    triangle = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    want = by_quadrature(0, 1, 0, lambda y: 1 - y, centre)
    got = sphere_to_triangle(placed(centre), placed(triangle))
    assert got == pytest.approx(want, abs=1e-10)
    want = by_quadrature(0, 1.5, 0, 1, centre)
    got = sphere_to_rectangle(placed(centre), placed((0, 0, 0)), TILTED[:, 0], 1.5 * TILTED[:, 1])
    assert got == pytest.approx(want, abs=1e-10)
    corners = placed([(0, 0, 0), (1, 0, 0), (1, 1.5, 0), (0, 1.5, 0)])
    assert sphere_to_polygon(placed(centre), corners) == pytest.approx(want, abs=1e-10)


@pytest.mark.parametrize("centre", CENTRES)
def test_polygon_that_is_not_convex(centre):
    """An L, by two rectangles; and whichever corner comes first, whichever way round."""
    shape = [(0, 0, 0), (3, 0, 0), (3, 1, 0), (1, 1, 0), (1, 2, 0), (0, 2, 0)]
    want = by_quadrature(0, 1, 0, 3, centre) + by_quadrature(1, 2, 0, 1, centre)
    for k in range(6):
        corners = placed(np.roll(shape, k, axis=0))
        assert sphere_to_polygon(placed(centre), corners) == pytest.approx(want, abs=1e-10)
        assert sphere_to_polygon(placed(centre), corners[::-1]) == pytest.approx(want, abs=1e-10)


@pytest.mark.parametrize(
    ("h", "s"),
    [
        (1.0, 0.0), (1.0, 0.5), (0.1, 0.9), (0.1, 1.0), (0.1, 1.0 + 1e-9), (0.1, 1.1), (0.5, 2.0),
        (2.0, 3.0), (3.9, 0.1), (2.8, 2.8), (2.9, 2.9), (5.0, 1.0), (1.0, 5.0), (30.0, 40.0),
    ],
)  # fmt: skip
def test_disk(h, s):
    # In polar coordinates of the disc, another integral than that of the closed form.
    total, _ = dblquad(
        lambda r, t: h * r / (h * h + s * s + r * r - 2 * r * s * np.cos(t)) ** 1.5,
        0, np.pi, 0, 1, epsabs=1e-15, epsrel=1e-13,
    )  # fmt: skip
    want = total / (2.0 * np.pi)
    for side in (1.0, -1.0):
        centre = placed(2.0 * np.array([0.6 * s, 0.8 * s, side * h]))
        got = sphere_to_disk(centre, SHIFT, 3.0 * TILTED[:, 2], 2.0)
        assert got == pytest.approx(want, rel=1e-11, abs=1e-13)


def test_known_values():
    square = [(-3, -3, -1), (3, -3, -1), (3, 3, -1), (-3, 3, -1)]
    assert sphere_to_polygon((0, 0, 0), square) == pytest.approx(0.356434, abs=5e-7)
    corner = [(0, 0, -1), (2, 0, -1), (2, 2, -1), (0, 2, -1)]
    assert sphere_to_polygon((0, 0, 0), corner) == pytest.approx(0.073792, abs=5e-7)
    assert sphere_to_disk((0, 0, 1), (0, 0, 0), (0, 0, 1), 1.0) == pytest.approx(
        0.5 * (1 - 2**-0.5), abs=1e-15
    )


def test_closed_surfaces_take_all():
    rng = np.random.default_rng(2)
    centres = rng.uniform(0.1, 0.9, (7, 2, 3)) * [1, 2, 3]
    box = box_walls((0, 0, 0), (1, 2, 3))
    shares = [sphere_to_polygon(centres, w.vertices) for w in box]
    assert shares[0].shape == (7, 2)
    np.testing.assert_allclose(np.sum(shares, axis=0), 1.0, rtol=1e-13)
    corners = np.concatenate([w.triangles for w in box]).reshape(-1, 3)
    mesh = Mesh(corners, np.arange(36).reshape(-1, 3))
    np.testing.assert_allclose(sphere_to_mesh(centres, mesh), 1.0, rtol=1e-13)
    lid = Mesh(box[0].triangles.reshape(-1, 3), [[0, 1, 2], [3, 4, 5]])
    np.testing.assert_allclose(sphere_to_mesh(centres, lid), shares[0], rtol=1e-12)


def test_small_and_far_patches_keep_their_digits():
    """From afar a patch of area A at height h counts A cos / (4 pi d^2)."""
    side, height = 1e-3, 1e4
    want = side**2 / (4 * np.pi * height**2)
    square = [(0, 0, 0), (side, 0, 0), (side, side, 0), (0, side, 0)]
    centre = (0, 0, height)
    assert sphere_to_polygon(centre, square) == pytest.approx(want, rel=1e-8)
    assert sphere_to_rectangle(centre, (0, 0, 0), (side, 0, 0), (0, side, 0)) == pytest.approx(
        want, rel=1e-8
    )
    assert sphere_to_disk(centre, (0, 0, 0), (0, 0, 1), side) == pytest.approx(
        np.pi * want, rel=1e-13
    )


def test_refusals():
    square = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
    with pytest.raises(RangeError, match="cuts the sphere"):
        sphere_to_polygon((5, 5, 0), square)
    with pytest.raises(RangeError, match="cuts the sphere"):
        sphere_to_polygon((5, 5, 1), square, radius=1.01)
    sphere_to_polygon((5, 5, 1), square, radius=1.0)
    with pytest.raises(RangeError, match="cuts the sphere"):
        sphere_to_disk([(0, 0, 1), (0, 0, 0.3)], (0, 0, 0), (0, 0, 1), 1.0, radius=0.5)
    with pytest.raises(InputError, match="triangle"):
        sphere_to_triangle((0, 0, 1), square)
    with pytest.raises(InputError, match="right angle"):
        sphere_to_rectangle((0, 0, 1), (0, 0, 0), (1, 0, 0), (1, 1, 0))
    with pytest.raises(InputError, match="finite"):
        sphere_to_polygon((0, 0), square)
    with pytest.raises(InputError, match="radius"):
        sphere_to_disk((0, 0, 1), (0, 0, 0), (0, 0, 1), -1.0)
    twice = np.concatenate([w.triangles for w in box_walls((0, 0, 0), (1, 1, 1))] * 2)
    twice[12:] = 2.0 * twice[12:] - 0.5
    mesh = Mesh(twice.reshape(-1, 3), np.arange(72).reshape(-1, 3))
    with pytest.raises(RangeError, match="hide"):
        sphere_to_mesh((0.5, 0.4, 0.6), mesh)
