"""Hand-made beds and rows for the tests of the thermal bed."""

import numpy as np
import pytest
from scipy.sparse import csr_matrix

from greybed.core import Packing, Plane
from greybed.coupling import Material, Rows, balanced

STEEL = Material(conductivity=15.0, density=7900.0, heat_capacity=500.0)


@pytest.fixture
def steel():
    return STEEL


@pytest.fixture
def chain():
    """Eight equal spheres in a column that overlap each other and both end planes alike."""
    r, delta, n = 1e-3, 2e-6, 8
    z = r - delta / 2 + (2 * r - delta) * np.arange(n)
    floor = Plane((0, 0, 0), (0, 0, 1), "floor")
    lid = Plane((0, 0, z[-1] + r - delta / 2), (0, 0, -1), "lid")
    return Packing(np.c_[0 * z, 0 * z, z], r, walls=[floor, lid])


@pytest.fixture
def rows_of():
    """Make balanced random rows for a packing: sparse neighbours, walls, opening."""

    def make(packing, seed=0, opening=0.2):
        rng = np.random.default_rng(seed)
        n = len(packing)
        f = rng.random((n, n)) * (rng.random((n, n)) < 0.5)
        np.fill_diagonal(f, 0.0)
        walls = 0.2 * rng.random((n, packing.n_walls))
        escaped = opening * rng.random(n)
        f *= ((1 - walls.sum(1) - escaped) / np.maximum(f.sum(1), 1e-9))[:, None]
        return balanced(Rows(csr_matrix(f), walls, escaped, packing.areas))

    return make
