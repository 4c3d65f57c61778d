"""Packings: checks at the door, wrapping, pairs and overlaps against brute force, walls."""

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import greybed
from greybed.core import Cylinder, InputError, OutputError, Packing, Plane
from greybed.core.files import atomic_path, output_folder, write_summary


def brute_pairs(packing, gap):
    i, j = np.triu_indices(len(packing), 1)
    delta = packing.centres[j] - packing.centres[i]
    edges = packing.edges
    delta -= np.where(packing.periodic, edges * np.round(delta / edges), 0.0)
    distance = np.sqrt((delta**2).sum(axis=1))
    close = distance < packing.radii[i] + packing.radii[j] + gap
    return np.stack([i[close], j[close]], axis=1), distance[close]


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    periodic=st.tuples(st.booleans(), st.booleans(), st.booleans()),
    ratio=st.sampled_from([1.0, 3.0, 15.0]),
    gap=st.sampled_from([0.0, 0.05, 0.4]),
)
def test_neighbours_against_brute_force(seed, periodic, ratio, gap):
    rng = np.random.default_rng(seed)
    radii = 0.4 * np.exp(rng.uniform(-np.log(ratio), 0.0, 60))
    low = rng.uniform(-5.0, 5.0, 3)
    packing = Packing(
        low + rng.uniform(0.0, 4.0, (60, 3)), radii, box=[low, low + 4.0], periodic=periodic
    )
    pairs, distance = packing.neighbours(gap)
    expected, apart = brute_pairs(packing, gap)
    np.testing.assert_array_equal(pairs, expected)
    np.testing.assert_allclose(distance, apart, rtol=1e-12)


@settings(max_examples=200, deadline=None)
@given(st.floats(-1e3, 1e3), st.floats(1e-3, 1e3), st.floats(-1e4, 1e4))
def test_wrapping_lands_inside_and_is_done_once(low, edge, x):
    box = [[low] * 3, [low + edge] * 3]
    once = Packing([[x, x, x]], 1e-4 * edge, box, (True,) * 3)
    assert (once.centres >= low).all()
    assert (once.centres < low + edge).all()
    again = Packing(once.centres, once.radii, box, (True,) * 3)
    np.testing.assert_array_equal(again.centres, once.centres)


def test_overlaps_are_measured():
    overlaps = Packing([[0, 0, 0], [1.9, 0, 0], [5, 0, 0]], [1.0, 1.0, 0.5]).overlaps()
    assert overlaps.count == 1
    assert overlaps.pairs.tolist() == [[0, 1]]
    assert overlaps.largest == pytest.approx(0.1)
    assert Packing([[0, 0, 0]], 1.0).overlaps().largest == 0.0


def test_properties():
    packing = Packing(np.zeros((1, 3)) + 0.5, 0.25, box=(1, 1, 2), periodic=(True, False, False))
    assert packing.solid_fraction == pytest.approx(4 / 3 * np.pi * 0.25**3 / 2)
    assert packing.is_monodisperse
    assert packing.areas[0] == pytest.approx(4 * np.pi * 0.0625)
    assert "1 spheres" in repr(packing)
    assert not packing.centres.flags.writeable
    assert greybed.Packing is Packing


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([[0, 0, np.nan]], 1.0), r"sphere 0: z = nan \[m\] is not finite"),
        (([[0, 0, 0], [1, 1, 1]], [1.0, 0.0]), r"sphere 1: radius = 0 \[m\] must be finite and"),
        (([[0, 0, 0]], -1.0), r"radius = -1 \[m\]"),
        (([[0, 0, 5]], 1.0, (1, 1, 1)), r"z = 5 \[m\] is outside the box \[0, 1\] \[m\]; widen"),
        (([[0, 0, 0]], 1.0, None, (True, False, False)), "needs a box"),
        (([[0, 0, 0]], 1.0, (1, 1, 1), (True, False, False)), r"exceeds the periodic edge 1"),
        (([[0, 0, 0]], 1.0, (1, -1, 1)), "is empty or not finite"),
        (([[0, 0, 0]], 1.0, (1, 1)), r"box has shape \(2,\)"),
        (([[0, 0]], 1.0), r"centres have shape \(1, 2\)"),
        ((np.empty((0, 3)), np.empty(0)), r"n >= 1"),
    ],
)
def test_refusals(arguments, message):
    with pytest.raises(InputError, match=message):
        Packing(*arguments)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Plane((0, 0, 0), (0, 0, 0), name="lid"), r"'lid': normal .* has no length"),
        (lambda: Plane((0, 0, np.inf), (0, 0, 1)), "is not finite"),
        (lambda: Plane("up", (0, 0, 1)), "is not a vector"),
        (lambda: Cylinder((0, 0, 0), (0, 0, 1), 0.0, name="can"), r"'can': radius = 0\.0 \[m\]"),
    ],
)
def test_walls_refuse(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_files_are_whole_or_absent(tmp_path):
    path = tmp_path / "a.txt"
    with atomic_path(path) as temporary:
        temporary.write_text("old")

    def die_halfway():
        with atomic_path(path) as temporary:
            temporary.write_text("half")
            raise KeyError

    with pytest.raises(KeyError):
        die_halfway()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_unwritable_folder(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OutputError, match=r"cannot write to this folder.*--out"):
        output_folder(tmp_path / "file" / "below")


def test_summary_has_provenance(tmp_path):
    source = tmp_path / "in.csv"
    source.write_text("x")
    path = write_summary(tmp_path, "trace", {"rays": np.int64(3)}, source, seed=7)
    import json

    content = json.loads(path.read_text())
    assert content["rays"] == 3
    assert content["provenance"]["seed"] == 7
    assert len(content["provenance"]["inputs"]["in.csv"]) == 64


def test_all_ways_to_a_packing_give_kernels_the_same_types():
    """Other strides, or arrays that can be written, would compile every kernel once more."""
    given = np.random.default_rng(0).uniform(0.0, 9.0, (3, 20))
    made = Packing(given.T, 0.1, box=[9.0, 9.0, 9.0])
    for packing in (made, copy.deepcopy(made), pickle.loads(pickle.dumps(made))):
        for array in (packing.centres, packing.radii, packing.box):
            assert array.flags.c_contiguous
            assert not array.flags.writeable
        np.testing.assert_array_equal(packing.centres, given.T)
