"""Rows of walls: closed rows, reciprocity with the spheres' rows, published factors of patches."""

from __future__ import annotations

import numpy as np
import pytest

from greybed.core import Disc, InputError, Packing, Plane, box_walls
from greybed.raytrace import patch_factors, view_factors

FAR = [[50.0, 50.0, 50.0]]  # a sphere out of the way: a packing has at least one


def test_faces_of_a_cube():
    """Opposite faces of a cube 0.1998249, adjacent ones 0.2000438 (Howell, C-11 and C-14)."""
    cube = Packing(FAR, 0.1, walls=box_walls((0, 0, 0), (1, 1, 1)))
    rows = patch_factors(cube, rays=2**18, seed=1)
    for w in range(6):
        opposite = w ^ 1
        for other in range(6):
            if other == w:
                assert rows.to_walls[w, w] == 0.0
                continue
            exact = 0.1998249 if other == opposite else 0.2000438
            assert abs(rows.to_walls[w, other] - exact) < 4.0 * rows.to_walls_stderr[w, other]
            assert rows.to_walls_stderr[w, other] < 1e-3
    assert (rows.escaped == 0.0).all()


def test_coaxial_discs():
    """Equal coaxial discs, radius and distance 1: (3 - sqrt(5)) / 2 (Howell, C-41)."""
    walls = [Disc((0, 0, 0), (0, 0, 1), 1.0, "low"), Disc((0, 0, 1), (0, 0, -1), 1.0, "high")]
    rows = patch_factors(Packing(FAR, 0.1, walls=walls), rays=2**18, seed=2)
    for w in (0, 1):
        error = rows.to_walls_stderr[w, 1 - w]
        assert abs(rows.to_walls[w, 1 - w] - (3.0 - np.sqrt(5.0)) / 2.0) < 4.0 * error
        assert rows.to_walls[w].sum() + rows.escaped[w] + rows.to_spheres[[w]].sum() == 1.0


def test_box_of_spheres_is_closed_and_reciprocal():
    rng = np.random.default_rng(4)
    centres = np.stack(np.meshgrid(*[[0.25, 0.5, 0.75]] * 3), axis=-1).reshape(-1, 3)
    centres += rng.uniform(-0.02, 0.02, centres.shape)
    radii = rng.uniform(0.06, 0.1, 27)
    packing = Packing(centres, radii, walls=box_walls((0, 0, 0), (1, 1, 1)))
    rows = patch_factors(packing, rays=2**17, seed=3)
    spheres = view_factors(packing, rays=50_000, seed=4)
    sums = rows.to_spheres.sum(axis=1) + rows.to_walls.sum(axis=1) + rows.escaped
    np.testing.assert_allclose(sums, 1.0, atol=1e-12)
    forth = rows.to_spheres.toarray() * rows.areas[:, None]
    forth_error = rows.to_spheres_stderr.toarray() * rows.areas[:, None]
    back = (spheres.wall_factors * spheres.areas[:, None]).T
    back_error = (spheres.wall_stderr * spheres.areas[:, None]).T
    z = (forth - back) / np.hypot(forth_error, back_error)
    assert np.abs(z).max() < 4.5
    assert (z**2).mean() < 1.5
    exchange = rows.to_walls * rows.areas[:, None]
    error = rows.to_walls_stderr * rows.areas[:, None]
    off = np.abs(exchange - exchange.T) / np.hypot(error, error.T)
    assert off.max() < 4.5


def test_a_patch_half_inside_a_sphere():
    """The floor under a sphere that it cuts in half: only the uncovered part radiates."""
    floor = Disc((0, 0, 0), (0, 0, 1), 2.0, "floor")
    rows = patch_factors(Packing([[0, 0, 0]], 1.0, walls=[floor]), rays=2**16, seed=5)
    assert rows.buried[0] == pytest.approx(0.25, abs=2e-3)
    assert rows.areas[0] == pytest.approx(0.75 * 4.0 * np.pi, rel=3e-3)


def test_same_bits_and_refusals():
    packing = Packing(
        FAR, 0.1, walls=[*box_walls((0, 0, 0), (1, 1, 1)), Plane((0, 0, -9), (0, 0, 1))]
    )
    one = patch_factors(packing, rays=1000, seed=6, threads=1)
    two = patch_factors(packing, rays=1000, seed=6, threads=2)
    np.testing.assert_array_equal(one.to_walls, two.to_walls)
    assert np.isnan(one.to_walls[6]).all()
    assert one.areas[6] == np.inf
    with pytest.raises(InputError, match="no wall has an end"):
        patch_factors(Packing(FAR, 0.1, walls=[Plane((0, 0, 0), (0, 0, 1))]))
    with pytest.raises(InputError, match="rays"):
        patch_factors(packing, rays=3)
