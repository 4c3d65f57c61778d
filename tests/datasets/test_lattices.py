"""Lattices: fractions, coordination and nearest distances of sc, bcc and fcc."""

from __future__ import annotations

import numpy as np
import pytest

from greybed.core.errors import InputError
from greybed.datasets.lattices import lattice

R = 1.5e-3  # [m]

# kind, spheres per cell, touching fraction, contacts of each sphere
KINDS = [
    ("sc", 1, np.pi / 6, 6),
    ("bcc", 2, np.pi * np.sqrt(3) / 8, 8),
    ("fcc", 4, np.pi / np.sqrt(18), 12),
]


@pytest.mark.parametrize(("kind", "per_cell", "fraction", "contacts"), KINDS)
def test_touching(kind, per_cell, fraction, contacts):
    packing = lattice(kind, (3, 4, 5), R)
    assert len(packing) == 60 * per_cell
    assert packing.periodic == (True, True, True)
    assert packing.overlaps().count == 0
    assert packing.solid_fraction == pytest.approx(fraction, abs=1e-12)
    pairs, distance = packing.neighbours(1e-6 * R)
    np.testing.assert_array_equal(np.bincount(pairs.ravel()), contacts)
    np.testing.assert_allclose(distance, 2 * R, rtol=1e-12)


@pytest.mark.parametrize(("kind", "per_cell", "fraction", "contacts"), KINDS)
def test_given_fraction(kind, per_cell, fraction, contacts):
    packing = lattice(kind, 3, R, 0.4)
    assert packing.solid_fraction == pytest.approx(0.4, abs=1e-12)
    assert packing.overlaps().count == 0
    # The touching fraction itself can be asked for.
    assert lattice(kind, 2, R, fraction).overlaps().count == 0


@pytest.mark.parametrize("kind", ["sc", "bcc", "fcc"])
def test_open(kind):
    packing = lattice(kind, 4, R, periodic=False)
    assert packing.box is None
    assert packing.overlaps().count == 0
    assert len(packing) == len(lattice(kind, 4, R))


@pytest.mark.parametrize("kind", ["sc", "bcc", "fcc"])
def test_large_lattices_do_not_overlap_by_rounding(kind):
    assert lattice(kind, (60, 2, 2), R).overlaps().count == 0


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (("hcp", 2, R), "'hcp' is unknown; choose one of: sc, bcc, fcc"),
        (("sc", 0, R), "cells = 0"),
        (("sc", (1, 2), R), "one or three integers"),
        (("sc", 2, 0.0), r"radius = 0 \[m\]"),
        (("sc", 2, R, 0.6), r"0\.6 \[-\] is outside \(0, 0\.5236\], the range of the sc lattice"),
        (("fcc", 2, R, -0.1), r"-0\.1 \[-\] is outside \(0, 0\.7405\]"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(InputError, match=message):
        lattice(*call)
