"""Blocks in single precision: rays meet the same spheres as without bundles, to the last count."""

import numpy as np
import pytest

from greybed.core import Packing
from greybed.core.sizes import Mono, Uniform
from greybed.datasets.generate import random_packing
from greybed.datasets.lattices import lattice
from greybed.raytrace import scene, tally

PACKINGS = {
    "sparse": lambda: random_packing(400, 0.2, Mono(1.0), seed=3),
    "touching": lambda: lattice("fcc", 3, 1e-9),
    "mixed sizes": lambda: random_packing(150, 0.3, Uniform(1.0, 8.0), seed=3),
    "far from the origin": lambda: Packing(
        random_packing(200, 0.4, Mono(1e-3), seed=3).centres + 7.0, 1e-3 * (1.0 - 1e-9)
    ),
}


def _traced(packing, neighbours, monkeypatch):
    monkeypatch.setattr(scene, "FEWEST", neighbours)
    monkeypatch.setattr(scene, "MOST", neighbours)
    return tally.trace(packing, rays=20_000, emitters=range(0, len(packing), 20), threads=1)


@pytest.mark.parametrize("name", PACKINGS)
def test_bundles_change_no_hit(name, monkeypatch):
    packing = PACKINGS[name]()
    # So few that all but the nearest is left to the cell grid, in double precision; and many.
    grid = _traced(packing, 1.0, monkeypatch)
    for neighbours in (60.0, 300.0):
        blocks = _traced(packing, neighbours, monkeypatch)
        for part in ("emitter", "key", "count", "squares"):
            assert np.array_equal(getattr(blocks, part), getattr(grid, part)), (neighbours, part)


def test_places_on_hilberts_curve_are_next_to_each_other():
    from greybed.raytrace import _bundle

    place = np.argsort(_bundle._CURVE)
    row, column = np.divmod(place, _bundle._SIDE)
    assert np.array_equal(np.sort(_bundle._CURVE), np.arange(_bundle._SIDE**2))
    assert (np.abs(np.diff(row)) + np.abs(np.diff(column)) == 1).all()
