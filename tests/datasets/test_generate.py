"""Random packings: no overlap, exact fraction, structure, determinism, sizes, refusals."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from greybed.core.errors import InputError
from greybed.core.walls import Cylinder, Plane
from greybed.datasets import _kernels
from greybed.datasets.generate import (
    Box,
    CylinderContainer,
    Discrete,
    LogNormal,
    Mono,
    PeriodicBox,
    Uniform,
    parse_sizes,
    random_packing,
    solid_fraction_between_walls,
    wall_overlap,
)

R = 1.5e-3  # [m]

CONTAINERS = {
    "periodic": PeriodicBox(),
    "slender periodic": PeriodicBox(aspect=(1.0, 1.0, 2.0)),
    "slab": PeriodicBox(floor_and_lid=True),
    "box": Box(),
    "box on a base": Box(base=(12 * R, 15 * R)),
    "cylinder": CylinderContainer(),
    "cylinder of given radius": CylinderContainer(radius=8 * R),
}


def deepest_overlap(packing):
    """Brute force over all pairs and the 27 images, independent of trees and cells."""
    c, r = packing.centres, packing.radii
    contact = r[:, None] + r[None, :]
    deepest = 0.0
    steps = [(-1, 0, 1) if wraps else (0,) for wraps in packing.periodic]
    for shift in np.stack(np.meshgrid(*steps), axis=-1).reshape(-1, 3):
        delta = c[:, None] - c[None, :] + shift * packing.edges
        depth = contact - np.sqrt((delta**2).sum(axis=-1))
        if not shift.any():
            np.fill_diagonal(depth, 0.0)
        deepest = max(deepest, float((depth / np.minimum(r[:, None], r[None, :])).max()))
    return deepest


@pytest.mark.parametrize("name", CONTAINERS)
@pytest.mark.parametrize("shake", [0, 20])
def test_no_overlap_and_exact_fraction(name, shake):
    packing = random_packing(400, 0.52, Mono(R), container=CONTAINERS[name], seed=3, shake=shake)
    assert len(packing) == 400
    assert deepest_overlap(packing) == 0.0
    assert wall_overlap(packing) == 0.0
    # Only the rounding of one cube root and one product.
    assert solid_fraction_between_walls(packing) == pytest.approx(0.52, abs=1e-12)


def test_dense_periodic_box():
    packing = random_packing(600, 0.62, Mono(R))
    assert deepest_overlap(packing) == 0.0
    assert packing.solid_fraction == pytest.approx(0.62, abs=1e-12)
    pairs, _ = packing.neighbours(1e-2 * R)
    # Near random close packing every sphere is caged: isostatic beds have 6 contacts.
    assert 5.0 < 2 * len(pairs) / len(packing) < 7.0


@pytest.mark.parametrize(
    "sizes",
    [
        Uniform(1e-3, 5e-3),
        Discrete((1e-3, 5e-3), (0.3, 0.7)),
        LogNormal(R, 1.3),
        Discrete((1e-3, 10e-3), (0.98, 0.02), by="number"),
    ],
    ids=["1:5 uniform", "1:5 two sizes", "log-normal", "1:10 two sizes"],
)
def test_wide_size_distributions(sizes):
    packing = random_packing(800, 0.6, sizes, seed=1)
    assert deepest_overlap(packing) == 0.0
    assert packing.overlaps().count == 0
    assert packing.solid_fraction == pytest.approx(0.6, abs=1e-12)
    np.testing.assert_array_equal(np.sort(packing.radii), sizes.radii(800))
    assert not (np.diff(packing.radii) >= 0).all()  # random order


def pair_correlation(packing, edges):
    """g(r) of a periodic monodisperse packing in the bins ``edges``, in diameters."""
    d = 2.0 * packing.radii[0]
    _, distance = packing.neighbours(float(edges[-1] - 1.0) * d)
    counts = np.histogram(distance / d, edges)[0]
    density = len(packing) / np.prod(packing.edges / d)
    shell = 4.0 / 3.0 * np.pi * np.diff(edges**3)
    return counts / (0.5 * len(packing) * density * shell)


def test_structure_has_its_first_peak_at_contact():
    packing = random_packing(1000, 0.6, Mono(R))
    edges = np.arange(0.9, 2.6, 0.05)
    g = pair_correlation(packing, edges)
    assert (g[edges[:-1] < 0.975] == 0.0).all()
    assert edges[g.argmax()] == pytest.approx(1.0)
    assert g.max() > 5.0
    assert g[edges[:-1] > 2.2].mean() == pytest.approx(1.0, abs=0.1)


def test_shaking_leads_to_the_hard_sphere_fluid():
    fraction = 0.45
    packing = random_packing(2000, fraction, Mono(R), shake=500)
    near = np.array([1.0, 1.02, 1.04, 1.06])
    g = pair_correlation(packing, near)
    at_contact = np.polyval(np.polyfit(0.5 * (near[1:] + near[:-1]), g, 1), 1.0)
    # Carnahan and Starling (1969), doi:10.1063/1.1672048; the bins hold about 1000 pairs each,
    # so the extrapolation scatters by some 4 %.
    exact = (1.0 - 0.5 * fraction) / (1.0 - fraction) ** 3
    assert at_contact == pytest.approx(exact, rel=0.15)


def test_shaking_parts_touching_spheres():
    tight = random_packing(500, 0.5, Mono(R))
    loose = random_packing(500, 0.5, Mono(R), shake=300)
    gap = 1e-3 * R
    assert len(tight.neighbours(gap)[0]) > 10 * len(loose.neighbours(gap)[0])


def test_same_seed_same_bits():
    def centres(seed):
        return random_packing(300, 0.55, LogNormal(R, 1.2), seed=seed, shake=5).centres

    np.testing.assert_array_equal(centres(4), centres(4))
    assert np.abs(centres(4) - centres(5)).max() > R


def test_walls_are_named_and_bound_the_bed():
    box = random_packing(100, 0.4, Mono(R), container=Box())
    assert [wall.name for wall in box.walls] == [
        "x_low",
        "x_high",
        "y_low",
        "y_high",
        "floor",
        "lid",
    ]
    column = random_packing(100, 0.4, Mono(R), container=CylinderContainer(radius=5 * R))
    side, floor, lid = column.walls
    assert isinstance(side, Cylinder)
    assert side.radius == pytest.approx(5 * R)
    assert isinstance(floor, Plane)
    assert isinstance(lid, Plane)
    assert (floor.point[2], lid.point[2]) == (column.box[0, 2], column.box[1, 2])
    assert random_packing(100, 0.4, Mono(R)).walls == ()


@pytest.mark.parametrize(
    ("fraction", "container", "low", "high"),
    [
        (0.68, PeriodicBox(), 0.62, 0.66),
        (0.68, CylinderContainer(radius=6 * R), 0.5, 0.6),
        (0.45, CylinderContainer(radius=1.6 * R), 0.2, 0.4),  # spheres on a zigzag
    ],
    ids=["periodic", "cylinder", "narrow cylinder"],
)
def test_out_of_reach_names_the_fraction_reached(fraction, container, low, high):
    with pytest.raises(InputError, match=rf"fraction = {fraction} .*reached 0\.\d+; ask") as info:
        random_packing(200, fraction, Mono(R), container=container)
    reached = float(re.search(r"reached (0\.\d+);", str(info.value))[1])
    assert low < reached < high
    packing = random_packing(200, reached, Mono(R), container=container)
    assert deepest_overlap(packing) == wall_overlap(packing) == 0.0


@pytest.mark.parametrize(
    ("call", "message"),
    [
        ((100, 0.75, Mono(R)), r"0\.75 \[-\] exceeds 0\.7405, .* reaches about 0\.64 .*ask for"),
        ((100, 1.2, Mono(R)), r"= 1\.2 \[-\] is outside \(0, 1\)"),
        ((100, float("nan"), Mono(R)), r"= nan \[-\] is outside \(0, 1\)"),
        ((0, 0.5, Mono(R)), r"spheres = 0 \[-\] must be at least 1"),
        ((3, 0.5, Mono(R)), r"n = 3 .*periodic edge .*below two diameters .* at least \d+ spheres"),
    ],
)
def test_impossible_requests_are_refused_at_once(call, message):
    with pytest.raises(InputError, match=message):
        random_packing(*call)


@pytest.mark.parametrize(
    ("container", "n", "message"),
    [
        (CylinderContainer(radius=0.9 * R), 50, r"cylinder of radius .* too small for the largest"),
        (CylinderContainer(radius=50 * R), 50, r"along z, too small for the largest"),
        (Box(base=(R, 9 * R)), 50, r"base .* along x, too small"),
        (Box(), 1, r"walled box .* too small"),
    ],
)
def test_containers_below_a_sphere_are_refused(container, n, message):
    with pytest.raises(InputError, match=message):
        random_packing(n, 0.55, Mono(R), container=container)


def test_remedy_for_few_periodic_spheres_works():
    with pytest.raises(InputError, match="at least 8 spheres"):
        random_packing(3, 0.5, Mono(R))
    assert deepest_overlap(random_packing(8, 0.5, Mono(R))) == 0.0


@pytest.mark.parametrize("width", [(3.0, 3.0, 3.0), (2.2, 9.0, 4.1), (30.0, 2.1, 2.1)])
@pytest.mark.parametrize("wraps", [True, False])
def test_neighbour_list_is_complete(width, wraps):
    rng = np.random.default_rng(0)
    lengths, periodic = np.array(width), np.full(3, wraps)
    x = rng.random((200, 3)) * lengths
    r = np.sort(rng.uniform(0.05, 0.4, 200))[::-1].copy()
    skin = 0.1
    start, partner = _kernels.neighbour_list(x, r, lengths, periodic, skin)
    found = {(i, int(j)) for i in range(200) for j in partner[start[i] : start[i + 1]]}
    assert len(found) == len(partner)
    delta = x[:, None] - x[None, :]
    if wraps:
        delta -= lengths * np.round(delta / lengths)
    near = np.sqrt((delta**2).sum(axis=-1)) < r[:, None] + r[None, :] + skin
    assert found == set(zip(*np.nonzero(np.triu(near, 1)), strict=True))
    first, members = _kernels.both_sides(start, partner)
    both = {(i, int(j)) for i in range(200) for j in members[first[i] : first[i + 1]]}
    assert both == found | {(j, i) for i, j in found}


lengths = st.floats(1e-6, 1.0)


@given(median=lengths, sd=st.floats(1.0, 2.0), n=st.integers(100, 400))
@settings(max_examples=40, deadline=None)
def test_lognormal_sample_has_its_moments(median, sd, n):
    r = LogNormal(median, sd, cut=4.0).radii(n)
    assert (np.diff(r) >= 0.0).all()
    assert np.median(r) == pytest.approx(median, rel=0.02)
    # Midpoints of n >= 100 strata leave the outermost half stratum out: a few per cent.
    assert np.exp(np.log(r).std()) == pytest.approx(sd, rel=0.02)
    assert r[-1] <= median * sd**4 * (1 + 1e-12)
    assert r[0] >= median * sd**-4 * (1 - 1e-12)


@given(a=lengths, b=lengths, n=st.integers(1, 300))
@settings(max_examples=40, deadline=None)
def test_uniform_sample_has_its_mean(a, b, n):
    low, high = sorted((a, b))
    r = Uniform(low, high).radii(n)
    assert ((r >= low) & (r <= high)).all()
    assert r.mean() == pytest.approx(0.5 * (low + high), rel=1e-12)


@given(
    st.lists(st.tuples(st.floats(0.5, 2.0), st.floats(0.1, 1.0)), min_size=1, max_size=4),
    st.sampled_from(["mass", "number"]),
)
@settings(max_examples=40, deadline=None)
def test_discrete_sample_has_its_shares(classes, by):
    sizes = tuple(size for size, _ in classes)
    shares = np.array([share for _, share in classes])
    shares /= shares.sum()
    law = Discrete(sizes, tuple(shares), by=by)
    n = 5000
    r = law.radii(n)
    assert len(r) == n
    weight = r**3 if by == "mass" else np.ones(n)
    for size in set(sizes):
        wanted = shares[np.array(sizes) == size].sum()
        # One sphere more or less per class: up to 64/5000 of the mass for sizes 1:4.
        assert weight[r == size].sum() / weight.sum() == pytest.approx(wanted, abs=0.02)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("mono:1.5mm", Mono(1.5e-3)),
        ("MONO: 1500 um", Mono(1.5e-3)),
        ("lognormal:1.5mm,1.3", LogNormal(1.5e-3, 1.3)),
        ("uniform:1mm,0.2cm", Uniform(1e-3, 2e-3)),
        (
            "discrete:1mm=0.3,1.5mm=0.35,2mm=0.35",
            Discrete((1e-3, 1.5e-3, 2e-3), (0.3, 0.35, 0.35)),
        ),
    ],
)
def test_sizes_are_read_from_text(text, expected):
    sizes = parse_sizes(text)
    assert type(sizes) is type(expected)
    np.testing.assert_allclose(sizes.radii(100), expected.radii(100), rtol=1e-14)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "not understood; write e.g. mono:1.5mm"),
        ("mono", "not understood"),
        ("mono:1mm,2mm", "not understood"),
        ("weibull:1mm", "not understood"),
        ("discrete:1mm", "not understood"),
        ("mono:1.5", "has no unit"),
        ("mono:1.5 s", "does not measure a length"),
        ("mono:-1mm", r"radius = -0.001 \[m\] must be finite and above 0"),
        ("lognormal:1mm,x", "'x' is not a number"),
        ("lognormal:1mm,0.5", r"= 0.5 \[-\] is outside \[1, 3\]"),
        ("uniform:2mm,1mm", "exchange them"),
        ("discrete:1mm=0.3,2mm=0.3", "sum to 0.6"),
        ("discrete:1mm=0,2mm=1", "share of radius 0.001 m = 0"),
    ],
)
def test_bad_sizes_are_refused(text, message):
    with pytest.raises(InputError, match=message):
        parse_sizes(text)


def test_a_class_without_a_sphere_is_refused_with_the_number_that_works():
    sizes = Discrete((1e-3, 10e-3), (0.5, 0.5))
    with pytest.raises(InputError, match=r"none has radius 0.01 .* at least 1001 spheres"):
        sizes.radii(100)
    assert (sizes.radii(1001) == 10e-3).sum() == 1
