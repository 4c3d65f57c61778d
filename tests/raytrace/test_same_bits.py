"""A seed fixes every bit: threads, subsets of emitters, and runs without compilation agree."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest

from greybed.core import Cylinder, Packing, Plane
from greybed.core.sizes import Uniform
from greybed.datasets.generate import random_packing
from greybed.raytrace import tally, view_factors

WALLS = [
    Cylinder((0.5, 0.5, 0), (0, 0, 1), 0.7, "side"),
    Plane((0, 0, 0), (0, 0, 1), "floor"),
    Plane((0, 0, 1), (0, 0, -1), "lid"),
]


@pytest.fixture(scope="module")
def packing():
    return random_packing(60, 0.4, Uniform(1.0, 2.0), seed=5)


def fields(result):
    return {
        "factors": result.factors.data,
        "indices": result.factors.indices,
        "indptr": result.factors.indptr,
        "stderr": result.stderr.data,
        "walls": result.wall_factors,
        "escaped": result.escaped,
        "buried": result.buried,
    }


@pytest.mark.parametrize("threads", [2, 3])
def test_threads_change_no_bit(packing, threads, monkeypatch):
    # Small blocks, so that 60 spheres do spread over the threads.
    monkeypatch.setattr(tally, "RAYS_PER_BLOCK", 9_000)
    monkeypatch.setattr(tally, "RAYS_PER_TASK", 1_000)
    one = fields(view_factors(packing, rays=3_500, seed=8, threads=1))
    many = fields(view_factors(packing, rays=3_500, seed=8, threads=threads))
    monkeypatch.undo()
    default = fields(view_factors(packing, rays=3_500, seed=8))
    for name, values in one.items():
        np.testing.assert_array_equal(values, many[name], err_msg=name)
        np.testing.assert_array_equal(values, default[name], err_msg=name)


def test_subsets_of_emitters_are_rows_of_the_whole(packing):
    whole = view_factors(packing, rays=500, seed=3)
    some = [59, 7, 8, 20]
    part = view_factors(packing, rays=500, seed=3, emitters=some)
    np.testing.assert_array_equal(part.factors[some].toarray(), whole.factors[some].toarray())
    np.testing.assert_array_equal(part.stderr[some].toarray(), whole.stderr[some].toarray())
    np.testing.assert_array_equal(part.escaped[some], whole.escaped[some])
    others = np.setdiff1d(np.arange(60), some)
    assert part.factors[others].nnz == 0
    assert np.isnan(part.escaped[others]).all()
    assert np.isnan(part.areas[others]).all()


def test_seeds_differ_and_more_rays_keep_the_first(packing):
    a = view_factors(packing, rays=500, seed=3)
    b = view_factors(packing, rays=500, seed=4)
    assert (a.factors != b.factors).nnz > 0
    # Ray k has its own stream: counts of the first 500 rays are part of those of 501.
    longer = view_factors(packing, rays=501, seed=3)
    more = (longer.factors * 501 - a.factors * 500).toarray()
    np.testing.assert_allclose(more.sum(axis=1), 1.0, atol=1e-9)
    assert more.min() > -1e-9


SCRIPT = """
import sys
import warnings
import numpy as np
from greybed.core import Cylinder, Packing, Plane
from greybed.raytrace import first_hits, tally

def case(walls):
    rng = np.random.default_rng(1)
    if walls:
        return Packing(rng.uniform(0.2, 0.8, (20, 3)), rng.uniform(0.06, 0.12, 20), walls=[
            Cylinder((0.5, 0.5, 0), (0, 0, 1), 0.45), Plane((0, 0, 0.1), (0, 0, 1))])
    return Packing(rng.uniform(0, 1, (20, 3)), rng.uniform(0.06, 0.12, 20), [1, 1, 1], (True,) * 3)

out = {}
# Streams wrap modulo 2^64, which NumPy reports for scalars and compiled code does not.
warnings.filterwarnings("ignore", message="overflow encountered in scalar")
for walls in (False, True):
    t = tally.trace(case(walls), rays=30, seed=2, threads=1, images=not walls)
    out |= {f"{walls}-{k}": getattr(t, k) for k in ("emitter", "key", "count", "buried")}
rng = np.random.default_rng(3)
d, h = first_hits(case(True), rng.uniform(-1, 2, (40, 3)), rng.normal(size=(40, 3)))
out |= {"distance": d, "hit": h}
np.savez(sys.argv[1], **out)
"""


def test_without_compilation_the_same(tmp_path):
    for name, environment in (("compiled", {}), ("plain", {"NUMBA_DISABLE_JIT": "1"})):
        subprocess.run(
            [sys.executable, "-W", "error", "-c", SCRIPT, tmp_path / f"{name}.npz"],
            env={**os.environ, **environment},
            check=True,
            timeout=120,
        )
    compiled, plain = np.load(tmp_path / "compiled.npz"), np.load(tmp_path / "plain.npz")
    for name in compiled.files:
        if name == "distance":  # the compiler may fuse multiplication and addition
            np.testing.assert_allclose(compiled[name], plain[name], rtol=1e-12)
        else:
            np.testing.assert_array_equal(compiled[name], plain[name], err_msg=name)


def test_walls_come_in_the_packing_s_order():
    ball = [[0.5, 0.5, 0.5]]
    first = view_factors(Packing(ball, 0.2, walls=WALLS), rays=5_000)
    other = view_factors(Packing(ball, 0.2, walls=WALLS[::-1]), rays=5_000)
    np.testing.assert_array_equal(first.wall_factors[:, ::-1], other.wall_factors)
