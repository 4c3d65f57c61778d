"""Closures at a few places: quick also where kernels are plain Python."""

from __future__ import annotations

import numpy as np
import pytest

from greybed.closures import ViewFactorClosure
from greybed.closures.drag import LAWS
from greybed.closures.drag.filtered import MARKER_SETS, FilteredDragClosure
from greybed.closures.drag.filtered.compiled import axis_drag
from greybed.closures.drag.filtered.limits import FCC
from greybed.closures.viewfactor import exact_view_factor, neighbourhood, pair_markers
from greybed.closures.viewfactor.walls import wall_markers
from greybed.core import Packing, Plane
from greybed.core.sizes import Mono, Uniform
from greybed.datasets.containers import CylinderContainer
from greybed.datasets.generate import random_packing


@pytest.mark.parametrize("name", LAWS)
def test_slopes_are_derivatives_and_drag_grows_with_speed(name):
    phi, reynolds = np.array([0.1, 0.35, 0.55]), np.array([0.3, 40.0, 900.0])
    drag, slope = LAWS[name].with_slope(phi, reynolds)
    assert (drag > 0.0).all()
    h = 1e-5
    up, down = LAWS[name](phi, reynolds * (1 + h)), LAWS[name](phi, reynolds * (1 - h))
    # d drag / d ln Re; a few pieces of the laws meet with a kink, none of them at these places.
    np.testing.assert_allclose(slope, (up - down) / (2 * h), rtol=1e-4, atol=1e-7)


@pytest.mark.parametrize("kind", ["mlp", "forest"])
def test_hidden_and_free_pairs(kind):
    """Nothing between: the exact factor; a large sphere between: less, whatever the weights."""
    closure = ViewFactorClosure.untrained(kind, seed=1)
    centres = [[0, 0, 0], [4, 0, 0], [0, 9, 0], [4, 9, 0], [2, 9, 0]]
    packing = Packing(centres, [1.0, 1.0, 1.0, 1.0, 0.95])
    hood = neighbourhood(packing, 5.0)
    markers = pair_markers(packing, hood, hood.within, solid_fraction=0.3)
    factor = closure.predict(**markers.of(closure.marker_names)).view_factor
    of = {(int(a), int(b)): f for a, b, f in
          zip(hood.owner[hood.within], hood.sphere[hood.within], factor, strict=True)}  # fmt: skip
    assert of[0, 1] == pytest.approx(exact_view_factor(1.0, 1.0, 4.0), rel=1e-12)
    assert 0.0 < of[2, 3] < of[0, 1]


@pytest.mark.parametrize("markers", MARKER_SETS)
def test_a_network_of_filtered_drag_is_what_its_parts_make(markers):
    """Force against secant times slip, and against the same closure turned on its side."""
    closure = FilteredDragClosure.untrained("mlp", markers, seed=6)
    rng = np.random.default_rng(1)
    phi = np.array([0.0, 0.05, 0.2, 0.4, 0.6, 0.3])
    slip = FCC.terminal_velocity * rng.normal(0.0, 2.0, (6, 3))
    gradient = FCC.weight * rng.normal(0.0, 0.5, (6, 3))
    law = LAWS["wen-yu"]
    down = axis_drag(closure, FCC, law, [0, 0, -9.81], phi, slip, 1.5e-3, gradient)
    turned = axis_drag(
        closure, FCC, law, [-9.81, 0, 0], phi, slip[:, [2, 0, 1]], 1.5e-3, gradient[:, [2, 0, 1]]
    )
    scale = abs(down.force).max()
    np.testing.assert_allclose(turned.force, down.force[:, [2, 0, 1]], rtol=0, atol=1e-12 * scale)
    assert (down.force[0] == 0.0).all()


def test_spheres_between_floor_and_lid():
    walls = [Plane((0, 0, 0), (0, 0, 1)), Plane((0, 0, 9), (0, 0, -1))]
    packing = Packing([[0, 0, 1.5], [4, 0, 1.5], [2, 0, 1.0]], 1.0, walls=walls)
    markers = wall_markers(packing, neighbourhood(packing, 5.0), 5.0, 0.3)
    # Floor and lid without end take half each of what leaves a sphere with nothing between.
    np.testing.assert_allclose(markers.wall_share, 0.5, rtol=1e-12)
    blocked = markers.blocked_fraction
    assert blocked.min() >= 0.0
    assert blocked.max() < 1.0
    np.testing.assert_allclose(blocked[0], blocked[1], atol=0.05)  # mirror images


def test_random_packings_have_their_fraction_and_no_overlap():
    for sizes, container in ((Mono(1.0), None), (Uniform(1.0, 2.0), CylinderContainer())):
        packing = random_packing(24, 0.3, sizes, container=container, seed=3, shake=2)
        pairs, distance = packing.neighbours(0.5)
        assert len(pairs) > 10
        assert (distance >= packing.radii[pairs].sum(axis=1)).all()
        if container is None:
            assert packing.sphere_volume == pytest.approx(0.3 * np.prod(packing.edges), rel=1e-9)
