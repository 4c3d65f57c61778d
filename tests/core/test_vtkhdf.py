"""VTKHDF: the arrays, lengths and offsets that the format's page asks for, read back with h5py."""

from __future__ import annotations

import h5py
import numpy as np
import pytest

from greybed.core import InputError, Packing
from greybed.core.writers.vtkhdf import join_parts, write_part

COUNTS = (3, 5, 2)


def frames(folder):
    rng = np.random.default_rng(1)
    beds, speeds, parts = [], [], []
    for k, n in enumerate(COUNTS):
        beds.append(Packing(rng.uniform(0, 1, (n, 3)), rng.uniform(0.01, 0.02, n)))
        speeds.append(rng.uniform(-1, 1, (n, 3)))
        parts.append(folder / f"frame_{k}.npz")
        write_part(parts[-1], beds[-1], {"velocity [m/s]": speeds[-1]}, 0.5 * k)
    return beds, speeds, parts


def test_every_step_is_where_its_offsets_say(tmp_path):
    beds, speeds, parts = frames(tmp_path)
    path = join_parts(tmp_path / "run.vtkhdf", parts)
    with h5py.File(path) as file:
        root = file["VTKHDF"]
        assert root.attrs["Version"].tolist() == [2, 0]
        kind = root.attrs.get_id("Type")
        assert kind.dtype == np.dtype("S16")
        assert kind.get_type().get_cset() == h5py.h5t.CSET_ASCII
        assert root.attrs["Type"] == b"UnstructuredGrid"
        steps = root["Steps"]
        assert steps.attrs["NSteps"] == 3
        np.testing.assert_array_equal(steps["Values"], [0.0, 0.5, 1.0])
        np.testing.assert_array_equal(steps["NumberOfParts"], 1)
        np.testing.assert_array_equal(steps["PartOffsets"], [0, 1, 2])
        for k, n in enumerate(COUNTS):
            for name in ("NumberOfPoints", "NumberOfCells", "NumberOfConnectivityIds"):
                assert root[name][k] == n
            at = steps["PointOffsets"][k]
            some = slice(at, at + n)
            np.testing.assert_array_equal(root["Points"][some], beds[k].centres)
            for name, values in (("radius", beds[k].radii), ("velocity [m per s]", speeds[k])):
                assert steps[f"PointDataOffsets/{name}"][k] == at
                np.testing.assert_array_equal(root[f"PointData/{name}"][some], values)
            cell, link = steps["CellOffsets"][k], steps["ConnectivityIdOffsets"][k]
            np.testing.assert_array_equal(root["Types"][cell : cell + n], 1)
            np.testing.assert_array_equal(root["Connectivity"][link : link + n], np.arange(n))
            # Each part has one offset more than cells.
            first = cell + steps["PartOffsets"][k]
            np.testing.assert_array_equal(root["Offsets"][first : first + n + 1], np.arange(n + 1))
        assert len(root["Offsets"]) == sum(COUNTS) + 3


def test_refusals(tmp_path):
    beds, _, parts = frames(tmp_path)
    with pytest.raises(InputError, match="no frame"):
        join_parts(tmp_path / "run.vtkhdf", [])
    write_part(parts[1], beds[1], {"label": np.zeros(5)}, 0.5)
    with pytest.raises(InputError, match="are not those of the first"):
        join_parts(tmp_path / "run.vtkhdf", parts)
    assert not (tmp_path / "run.vtkhdf").exists()
    with pytest.raises(InputError, match="one row for each"):
        write_part(parts[0], beds[0], {"label": np.zeros(7)}, 0.0)
