"""Conjugate gradients with multigrid: against direct solves, and as fast on any grid."""

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve

from greybed.cfd.poisson import Poisson
from greybed.core.errors import InputError


def faces(shape, periodic, seed=0, spread=0.0, open_end=False, cell=(1.0, 1.0, 1.0)):
    """Transmissibilities of a box of cells (x, y, z), walls where it is not periodic."""
    nz, ny, nx = shape
    hx, hy, hz = cell
    rng = np.random.default_rng(seed)
    sizes = (((nz, ny, nx + 1), hy * hz / hx), ((nz, ny + 1, nx), hx * hz / hy),
             ((nz + 1, ny, nx), hx * hy / hz))  # fmt: skip
    tx, ty, tz = (t * np.exp(spread * rng.standard_normal(s)) for s, t in sizes)
    for t, axis, wraps in ((tx, 2, periodic[0]), (ty, 1, periodic[1]), (tz, 0, periodic[2])):
        ends = np.moveaxis(t, axis, 0)
        ends[-1] = ends[0] if wraps else 0.0
        ends[0] = ends[0] if wraps else 0.0
    if open_end:
        tx[..., -1] = 2.0
    return tx, ty, tz


def direct(shape, t, periodic, b):
    """The same by a sparse direct solve."""
    number = np.arange(b.size).reshape(shape)
    rows, columns, values = [], [], []
    for face, axis, wraps in (
        (t[0], 2, periodic[0]),
        (t[1], 1, periodic[1]),
        (t[2], 0, periodic[2]),
    ):
        f, n = np.moveaxis(face, axis, 0), np.moveaxis(number, axis, 0)
        pairs = [(n[:-1], n[1:], f[1:-1])]
        if wraps:
            pairs.append((n[-1:], n[:1], f[:1]))
        for low, high, k in pairs:
            for a, c, sign in ((low, low, 1), (high, high, 1), (low, high, -1), (high, low, -1)):
                rows.append(a.ravel())
                columns.append(c.ravel())
                values.append(sign * k.ravel())
        if not wraps:
            for end, k in ((n[0], f[0]), (n[-1], f[-1])):
                rows.append(end.ravel())
                columns.append(end.ravel())
                values.append(k.ravel())
    matrix = coo_array(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
    ).tocsc()
    return matrix, lambda: spsolve(matrix, b.ravel()).reshape(shape)


@pytest.mark.parametrize("shape", [(1, 26, 12), (1, 17, 30), (9, 13, 22), (16, 16, 16)])
@pytest.mark.parametrize("periodic", [(False,) * 3, (True, False, False), (False, True, True)])
def test_open_boxes_as_a_direct_solve_has_them(shape, periodic):
    if shape[0] == 1:
        periodic = (periodic[0], periodic[1], False)
    t = faces(shape, periodic, spread=0.6)
    if not periodic[0]:
        t[0][..., -1] = 2.0
    else:
        t[1 if not periodic[1] else 2].swapaxes(0, 1 if not periodic[1] else 0)[0] = 1.5
    b = np.random.default_rng(1).standard_normal(shape)
    found, _ = Poisson(*t, periodic).solve(b, tolerance=1e-11)
    _, solve = direct(shape, t, periodic, b)
    exact = solve()
    assert abs(found - exact).max() < 1e-9 * abs(exact).max()


def test_closed_box_gives_the_solution_of_mean_zero_and_leaves_a_mean_out():
    shape, periodic = (1, 32, 24), (True, False, False)
    t = faces(shape, periodic, spread=0.5)
    b = np.random.default_rng(2).standard_normal(shape) + 3.0
    solver = Poisson(*t, periodic)
    assert solver.singular
    found, _ = solver.solve(b, tolerance=1e-12)
    assert abs(found.mean()) < 1e-12
    matrix, _ = direct(shape, t, periodic, b)
    assert matrix @ found.ravel() == pytest.approx((b - b.mean()).ravel(), abs=1e-9)


@pytest.mark.parametrize(
    ("shapes", "cell"),
    [
        ([(1, 64, 64), (1, 512, 512), (1, 512, 128)], (1.0, 1.0, 1.0)),
        ([(1, 64, 64), (1, 256, 256)], (1.0, 5.0, 1.0)),
        ([(32, 32, 32), (64, 64, 64), (32, 48, 60)], (1.0, 1.0, 1.0)),
    ],
)
def test_iterations_do_not_grow_with_the_grid(shapes, cell):
    for shape in shapes:
        periodic = (True, True, shape[0] > 1 and shape[0] % 2 == 0)
        solver = Poisson(*faces(shape, periodic, cell=cell), periodic)
        b = np.random.default_rng(1).standard_normal(shape)
        # Some more where a coarse grid of a periodic axis has an odd number of cells.
        assert solver.solve(b)[1] <= 14
        # A good first guess costs nothing.
        p, _ = solver.solve(b)
        assert solver.solve(b, p)[1] == 0


def test_other_coefficients_in_the_same_solver():
    shape, periodic = (8, 12, 16), (False, False, True)
    first, second = (faces(shape, periodic, seed=s, spread=0.5, open_end=True) for s in (1, 2))
    b = np.random.default_rng(3).standard_normal(shape)
    solver = Poisson(*first, periodic)
    solver.update(*second)
    np.testing.assert_array_equal(solver.solve(b)[0], Poisson(*second, periodic).solve(b)[0])


def test_bad_faces_are_refused():
    tx, ty, tz = faces((1, 8, 8), (False,) * 3)
    with pytest.raises(InputError, match="must be"):
        Poisson(tx[:, :-1], ty, tz, (False,) * 3)
    tx[0, 0, 3] = np.nan
    with pytest.raises(InputError, match="finite"):
        Poisson(tx, ty, tz, (False,) * 3)


@pytest.mark.parametrize("shape", [(26, 1, 12), (12, 26, 1)])
def test_planes_that_stand_upright(shape):
    periodic = (shape[2] > 1, False, False)
    t = faces(shape, periodic, spread=0.6)
    t[2][-1] = 2.0
    b = np.random.default_rng(1).standard_normal(shape)
    found, _ = Poisson(*t, periodic).solve(b, tolerance=1e-11)
    exact = direct(shape, t, periodic, b)[1]()
    assert found.shape == shape
    assert abs(found - exact).max() < 1e-9 * abs(exact).max()
