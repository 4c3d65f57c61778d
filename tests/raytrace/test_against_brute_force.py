"""Hit for hit against a tracer that tries every sphere, and images against explicit copies."""

from __future__ import annotations

import brute_force
import numpy as np
import pytest

from greybed.core import Cylinder, Packing, Plane
from greybed.raytrace import _kernels, first_hits, tally, view_factors

OPEN, ALL = (False, False, False), (True, True, True)
CAN = [
    Plane((0, 0, -0.1), (0, 0, 1)),
    Cylinder((0.5, 0.5, 0), (0, 0, 1), 0.9),
    Plane((0, 0, 1.1), (0, 0, -1)),
]


def loose(n=60, periodic=OPEN, walls=(), spread=4.0, seed=0):
    rng = np.random.default_rng(seed)
    radii = rng.uniform(0.03, 0.03 * spread, n)
    return Packing(rng.uniform(0, 1, (n, 3)), radii, [1, 1, 1], periodic, walls)


CASES = {
    "open": loose(),
    "sparse, radii 1:10": loose(25, spread=10.0, seed=1),
    "walls": loose(walls=CAN, seed=2),
    "periodic": loose(periodic=ALL, seed=3),
    "periodic along z in a pipe": loose(periodic=(False, False, True), walls=CAN[1:2], seed=4),
    "periodic floor and lid": loose(periodic=(True, True, False), walls=CAN[::2], seed=5),
    "one": Packing([[0.2, 0.1, 0.3]], 0.3, [1, 1, 1], ALL),
}


@pytest.mark.parametrize("name", CASES)
def test_hit_for_hit(name):
    packing = CASES[name]
    rng = np.random.default_rng(7)
    origins, directions = (
        np.concatenate(parts)
        for parts in zip(
            *(
                brute_force.emitted(rng, c, r, 4000 // len(packing))
                for c, r in zip(packing.centres, packing.radii, strict=True)
            ),
            strict=True,
        )
    )
    free = np.ones(len(origins), dtype=bool)
    steps = [range(-1, 2) if wraps else (0,) for wraps in packing.periodic]
    for shift in np.stack(np.meshgrid(*steps), axis=-1).reshape(-1, 3):
        for c, r in zip(packing.centres + shift * packing.edges, packing.radii, strict=True):
            free &= ((origins - c) ** 2).sum(axis=1) > r**2 * (1 - 1e-9)
    for wall in packing.walls:
        offset = origins - np.array(wall.point)
        if isinstance(wall, Plane):
            free &= offset @ np.array(wall.normal) > 0.0
        else:
            free &= (offset[:, :2] ** 2).sum(axis=1) < wall.radius**2
    origins, directions = origins[free], directions[free]
    assert len(origins) > 1000
    distance, hit = first_hits(packing, origins, directions)
    expected, who = brute_force.first_hits(packing, origins, directions)
    # Images further than the reference looks are left out.
    known = (distance < 1.5) | np.isinf(distance) if any(packing.periodic) else free[free]
    assert known.sum() > 1000
    np.testing.assert_array_equal(hit[known], who[known])
    np.testing.assert_allclose(distance[known], expected[known], rtol=1e-9, atol=1e-12)


def test_origins_anywhere_in_a_periodic_packing():
    """Origins outside the box stand for their images inside it; open ones may lie far outside."""
    packing = CASES["periodic floor and lid"]
    packing = Packing(packing.centres, packing.radii, packing.box, packing.periodic)
    rng = np.random.default_rng(8)
    x, y = rng.uniform(0, 1, (2, 500))
    down = np.tile([0.0, 0.0, -1.0], (500, 1))
    base = first_hits(packing, np.stack([x, y, np.full(500, 1.2)], axis=1), down)
    away = first_hits(packing, np.stack([x + 3, y - 2, np.full(500, 6.2)], axis=1), down)
    np.testing.assert_array_equal(base[1], away[1])
    np.testing.assert_allclose(base[0] + 5.0, away[0], rtol=1e-12)
    assert (base[1] == 0).any() or len(np.unique(base[1])) > 10


def test_tallies_against_brute_force_emission():
    """Another emission code, other random numbers: the same law."""
    packing = CASES["walls"]
    rng = np.random.default_rng(9)
    i = int(np.argmax(packing.radii < 0.05))
    o, d = brute_force.emitted(rng, packing.centres[i], packing.radii[i], 40_000)
    free = np.ones(len(o), dtype=bool)
    for c, r in zip(packing.centres, packing.radii, strict=True):
        free &= ((o - c) ** 2).sum(axis=1) > r**2 * (1 - 1e-9)
    _, hit = brute_force.first_hits(packing, o[free], d[free])
    result = view_factors(packing, rays=40_000, emitters=[i])
    ours = np.concatenate([result.factors[[i]].toarray()[0], result.wall_factors[i]])
    keys = np.concatenate([np.arange(len(packing)), -1 - np.arange(3)])
    theirs = np.array([(hit == key).mean() for key in keys])
    error = np.sqrt((theirs + 1e-4) / free.sum() + (ours + 1e-4) / 40_000)
    assert (np.abs(ours - theirs) < 4.5 * error).all()
    assert result.buried[i] == pytest.approx(1 - free.mean(), abs=0.01)


def test_images_are_the_copies_of_an_explicit_block():
    packing = loose(14, ALL, seed=11, spread=5.0)
    limit, rays = 1.4, 4_000
    found = tally.trace(packing, rays=rays, seed=6, images=True, max_distance=limit)
    # The middle copy comes first: the same numbers, hence the same random streams.
    reach = np.arange(-2, 3)
    shifts = np.stack(np.meshgrid(reach, reach, reach, indexing="ij"), axis=-1).reshape(-1, 3)
    shifts = shifts[np.argsort((shifts**2).sum(axis=1), kind="stable")]
    n = len(packing)
    block = Packing(
        (packing.centres[None] + shifts[:, None]).reshape(-1, 3),
        np.tile(packing.radii, len(shifts)),
    )
    plain = tally.trace(block, rays=rays, seed=6, emitters=np.arange(n), max_distance=limit)
    span = _kernels.IMAGE_SPAN
    seen = {}
    for emitter, key, count in zip(found.emitter, found.key, found.count, strict=True):
        code = key >> 32
        image = (
            code // span**2 - span // 2,
            code // span % span - span // 2,
            code % span - span // 2,
        )
        seen[(emitter, "escaped") if key < 0 else (emitter, key & 0xFFFFFFFF, *image)] = count
    copies = {}
    for emitter, key, count in zip(plain.emitter, plain.key, plain.count, strict=True):
        where = "escaped" if key < 0 else None
        name = (emitter, where) if where else (emitter, key % n, *shifts[key // n])
        copies[name] = count
    assert seen == copies
    assert len(seen) > 10 * n
