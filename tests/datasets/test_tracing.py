"""Long traces: blocks, processes and a scheduler give the bytes of one call; limits; refusals."""

from __future__ import annotations

import itertools
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from greybed.cli.main import main
from greybed.core import InputError, Plane, clusters
from greybed.core.sizes import Uniform
from greybed.core.writers import write_packing
from greybed.datasets import factors_file, tracing
from greybed.datasets.containers import Box
from greybed.datasets.factors_file import block_of, read_factors, write_blocks, write_factors
from greybed.datasets.generate import random_packing
from greybed.datasets.tracing import Settings, trace_in_blocks
from greybed.raytrace import view_factors

RAYS, LIMIT = 300, 6e-3


@pytest.fixture(scope="module")
def packing():
    return random_packing(60, 0.4, Uniform(1e-3, 3e-3), container=Box(), seed=3)


@pytest.fixture(scope="module")
def whole(packing, tmp_path_factory):
    """The file of one call in memory."""
    result = view_factors(packing, rays=RAYS, seed=7, max_distance=LIMIT)
    path = tmp_path_factory.mktemp("whole") / "view_factors.h5"
    return write_factors(path, packing, result, max_distance=LIMIT).read_bytes()


@pytest.fixture
def small_blocks(monkeypatch):
    monkeypatch.setattr(tracing, "RAYS_PER_BLOCK", 7 * RAYS)
    monkeypatch.setattr(tracing, "RAYS_PER_BLOCK_AND_SPHERE", 1)


def written(packing, folder, **how):
    traced = trace_in_blocks(packing, folder, Settings(RAYS, 7, LIMIT), **how)
    assert len(traced.blocks) > 5
    return traced.write(folder / "view_factors.h5").read_bytes()


@pytest.mark.parametrize("how", [{"threads": 1}, {"workers": 2}], ids=str)
def test_blocks_give_the_bytes_of_one_call(packing, whole, small_blocks, tmp_path, how):
    assert written(packing, tmp_path, **how) == whole


def test_a_scheduler_gives_the_bytes_of_one_call(packing, whole, small_blocks, tmp_path):
    distributed = pytest.importorskip("distributed", reason="dask.distributed is not installed")
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None
        ) as cluster,
    ):
        assert written(packing, tmp_path, scheduler=cluster.scheduler_address) == whole


def test_a_scheduler_without_workers_or_answer_is_refused(packing, tmp_path, monkeypatch):
    distributed = pytest.importorskip("distributed", reason="dask.distributed is not installed")
    monkeypatch.setattr(clusters, "PATIENCE", 0.5)
    with pytest.raises(InputError, match="no scheduler answers there"):
        trace_in_blocks(packing, tmp_path, Settings(RAYS), scheduler="tcp://127.0.0.1:9")
    with (
        distributed.LocalCluster(n_workers=0, processes=False, dashboard_address=None) as cluster,
        pytest.raises(InputError, match="has no workers"),
    ):
        trace_in_blocks(packing, tmp_path, Settings(RAYS), scheduler=cluster.scheduler_address)


def test_kept_blocks_are_joined_and_removed(packing, whole, small_blocks, tmp_path):
    traced = trace_in_blocks(packing, tmp_path, Settings(RAYS, 7, LIMIT))
    assert traced.found == 0
    kept = sorted((tmp_path / tracing.STATE).rglob("*.npz"))
    kept[1].write_bytes(kept[1].read_bytes()[:-200])  # as after a power cut
    kept[2].unlink()
    again = trace_in_blocks(packing, tmp_path, Settings(RAYS, 7, LIMIT))
    assert again.found == len(packing) - 14
    path = write_factors(tmp_path / "a.h5", packing, again.joined(), max_distance=LIMIT)
    assert path.read_bytes() == whole
    other = trace_in_blocks(packing, tmp_path, Settings(RAYS, 8, LIMIT))
    assert other.found == 0  # another seed: nothing of the old blocks is used, or left
    other.remove()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.h5"]


def test_cuts_between_blocks_change_no_byte(packing, whole, tmp_path, monkeypatch):
    result = view_factors(packing, rays=RAYS, seed=7, max_distance=LIMIT)
    monkeypatch.setattr(factors_file, "CHUNK", 16)
    monkeypatch.setattr(factors_file, "SLAB", 64)
    files = set()
    for cuts in ([0, 60], [0, 1, 2, 60], [0, 20, 20, 59, 60]):
        blocks = [block_of(result, *span) for span in itertools.pairwise(cuts)]
        path = write_blocks(tmp_path / "a.h5", packing, blocks, rays=RAYS, seed=7)
        files.add(path.read_bytes())
        np.testing.assert_array_equal(read_factors(path).result.factors.data, result.factors.data)
    assert len(files) == 1


def test_processes_end_with_a_killed_parent(packing, tmp_path):
    write_packing(packing, tmp_path / "bed.h5")
    words = ["trace", "bed.h5", "--rays", "2000000", "--workers", "2", "--out", "out"]
    process = subprocess.Popen(
        [sys.executable, "-m", "greybed", *words], cwd=tmp_path, stderr=subprocess.DEVNULL
    )
    end = time.monotonic() + 60
    while not list(tmp_path.glob("out/.trace/*/[!.]*.npz")) and time.monotonic() < end:
        assert process.poll() is None
        time.sleep(0.02)
    children = _children(process.pid)
    assert len(children) >= 2
    process.send_signal(signal.SIGKILL)
    process.wait()
    while any(map(_alive, children)) and time.monotonic() < end:
        time.sleep(0.05)
    assert not any(map(_alive, children))


def _children(pid):
    listed = subprocess.run(
        ["ps", "-o", "pid=", "--ppid", str(pid)], capture_output=True, text=True, check=True
    )
    return [int(word) for word in listed.stdout.split()]


def _alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    with open(f"/proc/{pid}/stat") as stat:
        return stat.read().rsplit(")", 1)[1].split()[0] != "Z"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["--workers", "0"], "workers = 0 must be"),
        (["--workers", "2", "--rel-error", "0.1"], "leave out --workers"),
        (["--scheduler", "nowhere"], "--scheduler nowhere: no scheduler answers"),
    ],
)
def test_refusals(packing, tmp_path, capsys, monkeypatch, words, says):
    monkeypatch.setattr(clusters, "PATIENCE", 0.5)
    write_packing(packing, tmp_path / "bed.h5")
    out = ["--rays", "10", "--out", str(tmp_path / "out")]
    assert main(["trace", str(tmp_path / "bed.h5"), *out, *words]) == 2
    assert says in capsys.readouterr().err


def test_a_wall_counts_before_the_limit(packing):
    """What the limit ends is neither wall nor opening; the rest of the row is as without it."""
    near = view_factors(packing, rays=2_000, max_distance=LIMIT)
    far = view_factors(packing, rays=2_000)
    assert all(isinstance(wall, Plane) for wall in packing.walls)
    assert (near.environment > 0.0).any()
    assert (far.environment == 0.0).all()
    assert (near.factors - far.factors).max() <= 0.0
    assert (near.wall_factors <= far.wall_factors).all()
    rows = near.factors.sum(axis=1) + near.wall_factors.sum(axis=1) + near.environment
    np.testing.assert_allclose(rows, 1.0, atol=1e-14)
