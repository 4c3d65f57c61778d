"""View factors in HDF5: the same bits back, the same bytes again, refusals of anything else."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from greybed.core import Cylinder, InputError, Packing, Plane
from greybed.core.writers import write_packing
from greybed.datasets.factors_file import packing_hash, read_factors, write_factors
from greybed.raytrace import view_factors

WALLS = [Plane((0, 0, -1), (0, 0, 1), "floor"), Cylinder((0, 0, 0), (0, 0, 1), 9.0, 'a "pipe" ä')]


@pytest.fixture(scope="module")
def packing():
    rng = np.random.default_rng(0)
    return Packing(rng.uniform(-4, 4, (30, 3)) + [0, 0, 5], rng.uniform(0.4, 1.2, 30), walls=WALLS)


@pytest.fixture(scope="module")
def result(packing):
    return view_factors(packing, rays=400, seed=11)


def test_round_trip_and_equal_bytes(packing, result, tmp_path):
    path = write_factors(tmp_path / "a.h5", packing, result, max_distance=50.0)
    again = write_factors(tmp_path / "b.h5", packing, result, max_distance=50.0)
    assert path.read_bytes() == again.read_bytes()
    stored = read_factors(path)
    for name in ("factors", "stderr"):
        old, new = getattr(result, name), getattr(stored.result, name)
        for part in ("data", "indices", "indptr"):
            np.testing.assert_array_equal(getattr(old, part), getattr(new, part))
    for name in ("wall_factors", "wall_stderr", "escaped", "buried", "areas"):
        np.testing.assert_array_equal(getattr(result, name), getattr(stored.result, name))
    assert (stored.result.rays, stored.result.seed, stored.max_distance) == (400, 11, 50.0)
    assert stored.wall_names == ("floor", 'a "pipe" ä')
    stored.check(packing)
    other = Packing(packing.centres, packing.radii * 1.01, walls=packing.walls)
    with pytest.raises(InputError, match="belong to another packing"):
        stored.check(other)


def test_units_and_sums_stand_in_the_file(packing, result, tmp_path):
    with h5py.File(write_factors(tmp_path / "a.h5", packing, result)) as root:
        units = {}
        root.visititems(
            lambda name, item: (
                units.update({name: item.attrs["units"]})
                if isinstance(item, h5py.Dataset)
                else None
            )
        )
        assert set(units.values()) == {b"-", b"m2"}
        assert units["areas"] == b"m2"
        total = root["sums/spheres"][()] + root["sums/walls"][()] + root["escaped"][()]
        np.testing.assert_allclose(total, 1.0, atol=1e-12)
        assert root.attrs["packing"].decode() == packing_hash(packing)


def test_nothing_seen_and_part_of_the_emitters(tmp_path):
    alone = Packing([[0, 0, 0], [9, 0, 0]], 1.0)
    part = view_factors(alone, rays=50, emitters=[1], max_distance=1.0)
    stored = read_factors(write_factors(tmp_path / "a.h5", alone, part, max_distance=1.0))
    assert stored.result.factors.nnz == 0
    assert np.isnan(stored.result.escaped[0])
    # a ray that ends at the limit inside the bed's box belongs to the local environment
    assert stored.result.environment[1] > 0
    assert stored.result.escaped[1] + stored.result.environment[1] == pytest.approx(1.0)


def test_the_hash_is_of_the_geometry(packing):
    same = Packing(packing.centres, packing.radii, walls=WALLS, source="other name")
    assert packing_hash(same) == packing_hash(packing)
    for other in (
        Packing(packing.centres, packing.radii),
        Packing(packing.centres, packing.radii, walls=WALLS[::-1]),
        Packing(packing.centres, packing.radii, [[-9] * 3, [19] * 3], walls=WALLS),
    ):
        assert packing_hash(other) != packing_hash(packing)


def test_a_result_of_another_packing_is_not_written(result, tmp_path):
    with pytest.raises(InputError, match="do not belong to 1 spheres"):
        write_factors(tmp_path / "a.h5", Packing([[0, 0, 0]], 1.0), result)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("share", [0.0, 0.01, 0.3, 0.9, 0.999])
def test_truncated_files_are_refused(packing, result, tmp_path, share):
    path = write_factors(tmp_path / "a.h5", packing, result)
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    with pytest.raises(
        InputError, match=r"a.h5: (the HDF5 content is cut|the file is empty)"
    ) as info:
        read_factors(path)
    assert "\n" not in str(info.value)


def test_flipped_bits_are_refused_or_harmless(packing, result, tmp_path):
    content = write_factors(tmp_path / "a.h5", packing, result).read_bytes()
    rng = np.random.default_rng(1)
    wrong, refused = tmp_path / "b.h5", 0
    for place in rng.integers(0, len(content), 60):
        damaged = bytearray(content)
        damaged[place] ^= 0x10
        wrong.write_bytes(bytes(damaged))
        try:
            stored = read_factors(wrong)
        except InputError:
            refused += 1
        else:  # bytes between the datasets, or a sum that nobody reads
            np.testing.assert_array_equal(stored.result.factors.data, result.factors.data)
    assert refused > 20


def test_foreign_files_are_refused(packing, result, tmp_path):
    bed = write_packing(packing, tmp_path / "bed.h5")
    with pytest.raises(
        InputError, match=r"is not 'greybed-view-factors'.*give the view_factors.h5"
    ):
        read_factors(bed)
    (tmp_path / "text.h5").write_text("x,y,z\n")
    with pytest.raises(InputError, match="cut or damaged"):
        read_factors(tmp_path / "text.h5")
    with pytest.raises(InputError, match="no such file"):
        read_factors(tmp_path / "absent.h5")
    path = write_factors(tmp_path / "a.h5", packing, result)
    with h5py.File(path, "a") as root:
        root.attrs["version"] = 4
    with pytest.raises(InputError, match=r"version = '4' .* newer greybed"):
        read_factors(path)


@pytest.mark.parametrize(
    ("name", "values", "message"),
    [
        ("factors/indices", [40, 0, 0], "missing, cut, or not of shape"),
        ("walls/factors", [[1.0]], "'walls/factors' is missing, cut"),
        ("factors/indptr", np.arange(31)[::-1], "does not rise from 0"),
        ("escaped", None, "cut or damaged"),
    ],
)
def test_wrong_datasets_are_refused(packing, result, tmp_path, name, values, message):
    path = write_factors(tmp_path / "a.h5", packing, result)
    with h5py.File(path, "a") as root:
        del root[name]
        if values is not None:
            root[name] = values
    with pytest.raises(InputError, match=message):
        read_factors(path)
