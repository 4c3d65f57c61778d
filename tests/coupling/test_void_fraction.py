"""Solid fractions: exact volumes, what is conserved, smoothing, walls and periodic axes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from greybed.cfd.grid import Grid
from greybed.core.errors import InputError
from greybed.coupling import _overlap
from greybed.coupling.void_fraction import Overlaps, Smoother, solid_fraction

POINTS = 400  # per axis of the sums by hand


def by_hand(a, b, c):
    """Volume of the unit sphere where x > a, y > b, z > c: midpoints in x and y, exact in z."""
    x = a + (1.0 - a) * (np.arange(POINTS) + 0.5) / POINTS
    y = b + (1.0 - b) * (np.arange(POINTS) + 0.5) / POINTS
    high = np.sqrt(np.maximum(1.0 - x[:, None] ** 2 - y**2, 0.0))
    return float((np.maximum(high - np.maximum(c, -high), 0.0)).mean() * (1.0 - a) * (1.0 - b))


@given(*[st.floats(-1.1, 1.1)] * 3)
@settings(max_examples=60, deadline=None)
def test_volume_beyond_three_planes(a, b, c):
    # midpoints where the height has a steep rim: a few 1e-4
    found = _overlap.corner(1.0, a, b, c)
    assert found == pytest.approx(by_hand(*np.clip([a, b, c], -1.0, 1.0)), abs=5e-4)


def test_known_volumes():
    whole = 4.0 / 3.0 * np.pi
    assert _overlap.cap(1.0, 0.0) == pytest.approx(whole / 2, rel=1e-15)
    assert _overlap.wedge(1.0, 0.0, 0.0) == pytest.approx(whole / 4, rel=1e-15)
    assert _overlap.corner(1.0, 0.0, 0.0, 0.0) == pytest.approx(whole / 8, rel=1e-15)
    a = 0.5773
    # a cube that just lies inside
    inside = (
        _overlap.corner(1.0, -a, -a, -a) - 3 * _overlap.corner(1.0, a, -a, -a)
        + 3 * _overlap.corner(1.0, a, a, -a) - _overlap.corner(1.0, a, a, a)
    )  # fmt: skip
    assert inside == pytest.approx(8 * a**3, rel=1e-13)


def grid(cells=(7, 6, 5), periodic=(False, True, False), size=(0.007, 0.006, 0.005)):
    return Grid(cells=cells, upper=size, periodic=periodic)


@given(st.floats(0.0, 0.007), st.floats(0.0, 0.006), st.floats(0.0, 0.005), st.floats(1e-5, 2.4e-3))
@settings(max_examples=200, deadline=None)
def test_cells_share_out_the_volume_of_a_sphere(x, y, z, r):
    # also where the sphere is wider than cells, reaches across a rim, or goes round
    g = grid()
    found = solid_fraction(g, np.array([[x, y, z]]), np.array([r]))
    volume = 4.0 / 3.0 * np.pi * r**3
    assert found.min() >= 0.0
    assert found.sum() * g.cell_volume == pytest.approx(volume, rel=1e-12)


def test_a_sphere_in_cells_by_fine_sums():
    g = grid(periodic=(False, False, False))
    at, r = np.array([[0.00361, 0.00287, 0.00242]]), np.array([0.00131])
    found = solid_fraction(g, at, r) * g.cell_volume
    fine = 40
    axes = [(np.arange(n * fine) + 0.5) * h / fine for n, h in zip(g.cells, g.spacing, strict=True)]
    x, y, z = axes
    inside = (
        (x[None, None, :] - at[0, 0]) ** 2 + (y[None, :, None] - at[0, 1]) ** 2
        + (z[:, None, None] - at[0, 2]) ** 2 < r[0] ** 2
    )  # fmt: skip
    counted = inside.reshape(5, fine, 6, fine, 7, fine).mean(axis=(1, 3, 5)) * g.cell_volume
    # a voxel of the surface is counted wrong by half at most, and these errors cancel
    assert abs(found - counted).max() < 2e-3 * g.cell_volume


def test_no_jump_where_a_sphere_passes_a_face():
    g = grid(periodic=(False, False, False))
    r = np.array([0.0004])
    path = np.linspace(0.0024, 0.0036, 1201)
    seen = [solid_fraction(g, np.array([[x, 0.0025, 0.0025]]), r)[2, 2, 2] for x in path]
    # over 1 micron at most the disc through the centre goes over
    assert np.abs(np.diff(seen)).max() * g.cell_volume < 1.01e-6 * np.pi * r[0] ** 2


def test_means_and_shares_are_transposes():
    g, rng = grid(), np.random.default_rng(8)
    place = np.column_stack([rng.random((50, 3)) * g.upper, rng.uniform(1e-4, 1e-3, 50)])
    overlaps = Overlaps(g, place)
    field, values = rng.random((*g.shape, 2)), rng.random((50, 2))
    shared = overlaps.share_out(values)
    assert (shared * field).sum() == pytest.approx((values * overlaps.mean(field)).sum(), rel=1e-13)
    np.testing.assert_allclose(shared.sum(axis=(0, 1, 2)), values.sum(axis=0), rtol=1e-13)
    np.testing.assert_allclose(overlaps.mean(np.full((*g.shape, 1), 3.0)), 3.0, rtol=1e-12)


def test_centres():
    g = grid()
    found = solid_fraction(
        g, np.array([[0.0035, 0.0065, 0.005]]), np.array([1e-3]), method="centre"
    )
    assert np.flatnonzero(found).tolist() == [4 * 42 + 0 * 7 + 3]


def test_refusals():
    with pytest.raises(InputError, match=r"a particle at \(0.0071"):
        solid_fraction(grid(), np.array([[0.001, 0, 0], [0.0071, 0, 0]]), np.full(2, 1e-4))
    with pytest.raises(InputError, match="known are exact, centre"):
        solid_fraction(grid(), np.zeros((0, 3)), np.zeros(0), method="divided")
    with pytest.raises(InputError, match="width = -1"):
        Smoother(grid(), -1.0)


@given(st.integers(0, 10_000), st.floats(0.0, 0.02))
@settings(max_examples=40, deadline=None)
def test_smoothing_keeps_sums_constants_and_bounds(seed, width):
    g, rng = grid(), np.random.default_rng(seed)
    smoother = Smoother(g, width)
    field = rng.random(g.shape)
    found = smoother.cells(field)
    assert found.sum() == pytest.approx(field.sum(), rel=1e-12)
    assert found.min() >= field.min() - 1e-14
    assert found.max() <= field.max() + 1e-14
    np.testing.assert_allclose(smoother.cells(np.full(g.shape, 0.6)), 0.6, rtol=1e-13)
    for axis, shape in enumerate(g.face_shapes):
        np.testing.assert_allclose(smoother.faces(np.ones(shape), axis), 1.0, rtol=1e-13)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_smoothing_of_faces_is_its_own_transpose(axis):
    g, rng = grid(), np.random.default_rng(axis)
    smoother = Smoother(g, 0.004)
    along = 2 - axis
    a, b = rng.random((2, *g.face_shapes[axis]))
    if g.periodic[axis]:  # the last face is the first one
        a, b = (np.concatenate([f.take(range(g.cells[axis]), axis=along), f.take([0], axis=along)],
                               axis=along) for f in (a, b))  # fmt: skip
        whole = np.s_[:, :-1] if along == 1 else np.s_[..., :-1]
    else:
        whole = np.s_[:]
    left = (smoother.faces(a, axis)[whole] * b[whole]).sum()
    assert left == pytest.approx((a[whole] * smoother.faces(b, axis)[whole]).sum(), rel=1e-13)


@pytest.mark.parametrize("refined", [1, 2, 4])
def test_smoothing_has_the_width_of_a_box_whatever_the_cells(refined):
    n = 48 * refined
    g = Grid(cells=(n, 1, 1), upper=(0.048, 0.001, 0.001))
    width = 4e-3
    field = np.zeros(g.shape)
    field[0, 0, n // 2] = 1.0
    x = g.centres(0)
    found = Smoother(g, width).cells(field)[0, 0]
    mean = found @ x
    # and the cell, a box itself; tails reach the walls by 1e-6
    variance = found @ (x - mean) ** 2 + g.spacing[0] ** 2 / 12.0
    assert variance == pytest.approx(width**2 / 12.0, rel=1e-4)


def test_smoothing_makes_up_for_cells_below_three_diameters():
    rng = np.random.default_rng(3)
    d, size = 1e-3, 0.012
    centres, radii = size * rng.random((400, 3)), np.full(400, 0.5 * d)
    found = []
    for n in (4, 12, 24):  # cells of 3, 1 and half a diameter
        g = Grid(cells=(n, n, n), upper=(size,) * 3, periodic=(True,) * 3)
        field = Smoother(g, 3.0 * d).cells(solid_fraction(g, centres, radii))
        found.append(field.std())
    # raw fields differ twofold; what is left is that a cell is a box, and the rest a Gaussian
    assert found[2] == pytest.approx(found[1], rel=0.15)
    assert found[1] == pytest.approx(found[0], rel=0.35)  # 64 cells
