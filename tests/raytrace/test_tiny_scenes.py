"""A few hundred rays through small scenes: quick also where kernels are plain Python."""

from __future__ import annotations

import numpy as np
import pytest

from greybed.core import Cone, Cylinder, Disc, Mesh, Packing, Plane, box_walls
from greybed.core.exact import exact_view_factor
from greybed.raytrace import (
    exchange_factors,
    first_hits,
    pair_factors,
    patch_factors,
    scene,
    tally,
    view_factors,
)

CAN = [
    Cylinder((0, 0, 0), (0, 0, 1), 2.5),
    Plane((0, 0, -1.5), (0, 0, 1)),
    Plane((0, 0, 1.5), (0, 0, -1)),
]
CORNERS = np.array([[x, y, z] for x in (-3, 3) for y in (-3, 3) for z in (-2, 2)], float)
FACES = [
    [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
    [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
]  # fmt: skip
SHELL = Mesh(CORNERS, FACES)
FUNNEL = [
    Disc((0, 0, -2), (0, 0, 1), 2.0),
    Cone((0, 0, -2), (0, 0, 1), 2.0, 3.0, 4.0),
    Disc((0, 0, 2), (0, 0, -1), 3.0),
]
CENTRES = [[-1.1, 0.1, 0.0], [1.0, 0.0, 0.2], [0.1, 0.9, -0.3], [0.0, -0.8, 0.4]]
RADII = [0.9, 0.8, 0.5, 0.7]  # the third overlaps both, the others none


@pytest.mark.parametrize("sampling", ["sobol", "random"])
@pytest.mark.parametrize(
    "walls",
    [CAN, [SHELL], FUNNEL, box_walls((-3, -3, -2), (3, 3, 2))],
    ids=["can", "mesh", "funnel", "box"],
)
def test_closed_rooms_keep_every_ray(walls, sampling):
    packing = Packing(CENTRES, RADII, walls=walls)
    found = view_factors(packing, rays=60, sampling=sampling, threads=1)
    total = found.factors.sum(axis=1) + found.wall_factors.sum(axis=1)
    np.testing.assert_allclose(total, 1.0, atol=1e-12)
    assert (found.escaped == 0.0).all()
    assert found.factors.diagonal().max() == 0.0  # spheres are convex


@pytest.mark.parametrize("periodic", [(True, True, False), (True, True, True)])
def test_shares_add_up_across_periodic_faces(periodic):
    packing = Packing(np.add(CENTRES, 2.5), RADII, [5, 5, 5], periodic)
    found = tally.trace(packing, rays=60, images=True, max_distance=12.0, threads=1)
    assert np.array_equal(np.bincount(found.emitter, found.count), [60.0] * 4)
    sphere, image = tally.split_keys(found.key[found.key >= 0])
    assert sphere.max() < 4
    assert abs(image).max() > 0
    assert (image[:, ~np.array(periodic)] == 0).all()


def test_a_pair_by_rays_and_by_lines():
    """Two of them with a third between: each within five errors of the other."""
    packing = Packing([[0, 0, 0], [4, 0, 0], [2, 0.8, 0]], [1.0, 1.0, 0.5])
    free = view_factors(Packing([[0, 0, 0], [4, 0, 0]], 1.0), rays=600, emitters=[0], threads=1)
    exact = exact_view_factor(1.0, 1.0, 4.0)
    assert abs(free.factors[0, 1] - exact) < 5 * free.stderr[0, 1]
    rays = view_factors(packing, rays=600, emitters=[0], threads=1)
    lines = pair_factors(packing, [[0, 1]], rays=1_024)
    error = np.hypot(rays.stderr[0, 1], lines.stderr[0])
    assert abs(rays.factors[0, 1] - lines.factor[0]) < 5 * error
    assert 0.2 < lines.visibility[0] < 0.99
    assert lines.factor[0] < exact


def test_bundled_rays_meet_what_single_rays_meet(monkeypatch):
    rng = np.random.default_rng(3)
    grid = np.stack(np.meshgrid(*[np.arange(3)] * 3, indexing="ij"), -1).reshape(-1, 3)
    packing = Packing(2.1 * grid + rng.uniform(0, 0.1, (27, 3)), rng.uniform(0.6, 1.0, 27))
    found = []
    for neighbours in (1.0, 60.0):
        monkeypatch.setattr(scene, "FEWEST", neighbours)
        monkeypatch.setattr(scene, "MOST", neighbours)
        found.append(tally.trace(packing, rays=400, emitters=[0, 13], threads=1))
    for part in ("emitter", "key", "count", "squares"):
        assert np.array_equal(getattr(found[0], part), getattr(found[1], part)), part


@pytest.mark.parametrize(
    "walls",
    [CAN, [SHELL], FUNNEL, box_walls((-3, -3, -2), (3, 3, 2))],
    ids=["can", "mesh", "funnel", "box"],
)
def test_reflected_rays_are_absorbed_somewhere(walls):
    packing = Packing(CENTRES, RADII, walls=walls)
    (found,) = exchange_factors(
        packing, 0.6, wall_emissivity=0.5, specular=0.3, wall_specular=0.5, rays=40, threads=1
    )
    total = found.factors.sum(axis=1) + found.wall_factors.sum(axis=1)
    np.testing.assert_allclose(total, 1.0, atol=1e-12)
    assert found.cut == 0.0


def test_pictures_of_a_sphere_in_exchange_are_told_apart():
    packing = Packing([[1.5, 1.5, 1.5]], 1.0, [3, 3, 3], (True, True, True))
    (found,) = exchange_factors(packing, 0.7, rays=60, images=True, threads=1)
    assert abs(found.factors.sum() + found.escaped.sum() - 1.0) < 1e-12
    assert len(np.unique(found.pairs.image, axis=0)) > 6


@pytest.mark.parametrize("walls", [[SHELL], FUNNEL, box_walls((-3, -3, -2), (3, 3, 2))])
def test_patches_send_all_they_emit(walls):
    packing = Packing(CENTRES, RADII, walls=walls)
    found = patch_factors(packing, rays=60, threads=1)
    total = found.to_spheres.sum(axis=1) + found.to_walls.sum(axis=1) + found.escaped
    np.testing.assert_allclose(total, 1.0, atol=1e-12)


def test_free_rays_meet_the_first_of_all():
    packing = Packing(CENTRES, RADII, walls=CAN)
    distance, hit = first_hits(
        packing, [[-2.4, 0.1, 0], [0, 0, 1.4], [0.0, -2.4, 0]], [[1, 0, 0], [0, 0, 1], [1, 0, 0]]
    )
    assert hit[0] == 0
    assert distance[0] == pytest.approx(0.4)
    assert hit[1] == -1 - 2
    assert distance[1] == pytest.approx(0.1)
    assert hit[2] == -1
    assert distance[2] == pytest.approx(0.7)
