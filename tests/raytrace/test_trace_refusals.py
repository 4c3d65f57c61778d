"""Refusals of the tracer: one sentence with value, bound and remedy."""

from __future__ import annotations

import numpy as np
import pytest

from greybed.core import Cylinder, InputError, Packing, Plane
from greybed.raytrace import first_hits, view_factors

PAIR = Packing([[0, 0, 0], [2, 0, 0]], 1.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"rays": 0}, r"rays = 0 must be a whole number of at least 1"),
        ({"rays": -5}, r"rays = -5 must be"),
        ({"rays": 2.5}, r"rays = 2.5 must be a whole number"),
        ({"seed": -1}, r"seed = -1 must be a whole number of at least 0"),
        ({"seed": 2**63}, r"seed = 9223372036854775808 must be"),
        ({"threads": 0}, r"threads = 0 must be"),
        ({"emitters": [0, 2]}, r"emitters must lie in 0 \.\.\. 1; got 0 \.\.\. 2"),
        ({"emitters": [-1]}, r"emitters must lie in 0 \.\.\. 1; got -1"),
        ({"max_distance": 0.0}, r"max_distance = 0 \[m\] must be above 0"),
        ({"max_distance": float("nan")}, r"max_distance = nan \[m\] must be above 0"),
        ({"emitters": []}, r"emitters is empty"),
        ({"emitters": [True, False]}, r"emitters .* sphere numbers"),
        ({"emitters": [0.5]}, r"emitters .* sphere numbers"),
        ({"rays": float("nan")}, r"rays = nan must be a whole number"),
        ({"rays": float("inf")}, r"rays = inf must be a whole number"),
    ],
)
def test_numbers_out_of_range(options, message):
    with pytest.raises(InputError, match=message):
        view_factors(PAIR, **{"rays": 10, **options})


@pytest.mark.parametrize(
    ("wall", "periodic"),
    [
        (Plane((0, 0, 0), (0, 0, 1), "floor"), (False, False, True)),
        (Plane((0, 0, 0), (1, 0, 1), "slope"), (True, False, False)),
        (Cylinder((0, 0, 0), (0, 0, 1), 1.0, "pipe"), (True, False, False)),
    ],
)
def test_walls_that_do_not_repeat(wall, periodic):
    packing = Packing([[0.5, 0.5, 0.5]], 0.1, [1, 1, 1], periodic, [wall])
    axis = "xyz"[periodic.index(True)]
    message = rf"wall '{wall.name}' does not repeat along the periodic direction {axis}; make"
    with pytest.raises(InputError, match=message):
        view_factors(packing, rays=10)
    with pytest.raises(InputError, match=message):
        first_hits(packing, [[0, 0, 0]], [[0, 0, 1]])


def test_wholly_buried_spheres_are_named():
    twice = Packing([[0, 0, 0], [2, 0, 0], [0, 0, 0]], [1.0, 1.0, 0.8], source="bed.csv")
    with pytest.raises(InputError, match=r"bed.csv: sphere 2 lies wholly inside .* remove it"):
        view_factors(twice, rays=10)
    behind = Packing([[0, 0, -3]], 1.0, walls=[Plane((0, 0, 0), (0, 0, 1))])
    with pytest.raises(InputError, match=r"sphere 0 lies wholly inside other spheres or walls"):
        view_factors(behind, rays=10)


@pytest.mark.parametrize(
    ("origins", "directions", "message"),
    [
        ([[0, 0, 0]], [[0, 0, 0]], "longer than zero"),
        ([[0, 0, np.nan]], [[0, 0, 1]], "must be finite"),
        ([[0, 0, 0]], [[0, 0, 1], [0, 1, 0]], r"must both be \(m, 3\)"),
        ([0, 0, 0], [0, 0, 1], r"must both be \(m, 3\)"),
    ],
)
def test_free_rays(origins, directions, message):
    with pytest.raises(InputError, match=message):
        first_hits(PAIR, origins, directions)


def test_a_scene_of_another_packing():
    from greybed.raytrace.scene import Scene

    one, other = (Packing([[0, 0, 0], [d, 0, 0]], 1.0) for d in (2.0, 3.0))
    with pytest.raises(InputError, match="another packing"):
        view_factors(one, rays=10, scene=Scene.of(other))
    np.testing.assert_array_equal(
        view_factors(one, rays=100, scene=Scene.of(one)).factors.toarray(),
        view_factors(one, rays=100).factors.toarray(),
    )
