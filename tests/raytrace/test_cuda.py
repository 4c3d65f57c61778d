"""Rays on a GPU are those of the processor: one by one here, in Numba's simulator, on a device."""

from __future__ import annotations

import os
import subprocess
import sys

import numba.cuda
import numpy as np
import pytest

from greybed.core import Cylinder, Disc, InputError, Packing, Plane, box_walls
from greybed.core.sizes import Uniform
from greybed.datasets.generate import random_packing
from greybed.raytrace import _single, cuda, tally, view_factors

FIELDS = ("emitter", "key", "count", "squares", "buried")
PAIR = Packing([[0, 0, 0], [2, 0, 0]], 1.0)


class Here(cuda.Device):
    """The device's rays, one after the other on the processor."""

    def __init__(self, tables):
        self._bed = _single.Bed(
            tables.centres, tables.radii, tables.exposed, tables.clearance, tables.grid,
            tables.walls,
        )  # fmt: skip
        self._lock = cuda.threading.Lock()
        self.rays_per_launch = 3_000

    def _launch(self, tasks, begin, offsets, seed, quasi, points, images, limit):
        room = _single.Room(
            np.empty((6, 1)), np.empty(4, np.uint32), np.empty(1),
            np.empty(1), np.empty(1, np.int64), np.empty(1, np.int64),
        )  # fmt: skip
        met, lost = np.empty(begin[-1], np.int64), np.zeros(len(tasks), np.int64)
        for place in range(begin[-1]):
            task = _single.last_up_to(place, begin, 0, len(tasks))
            number = offsets[tasks[task, 1]] + place - begin[task]
            replicate = _single.last_up_to(number, offsets, tasks[task, 1], tasks[task, 2])
            met[place], more = _single.meet(
                tasks[task, 0], number, replicate, offsets, seed, quasi, points, images,
                self._bed, limit, room,
            )  # fmt: skip
            lost[task] += more
        return met, lost


def overlapping(walls):
    rng = np.random.default_rng(1)
    return Packing(rng.uniform(0.2, 0.8, (20, 3)), rng.uniform(0.06, 0.15, 20), walls=walls)


UNBOUNDED = [Cylinder((0.5, 0.5, 0), (0, 0, 1), 0.45), Plane((0, 0, 0.1), (0, 0, 1))]
BOUNDED = [Disc((0.5, 0.5, 0.5), (0, 0, 1), 0.4), *box_walls((-0.1, -0.1, -0.1), (1.1, 1, 1))]


@pytest.mark.parametrize(
    ("packing", "options"),
    [
        (random_packing(60, 0.4, Uniform(1.0, 2.0), seed=5), {"images": True}),
        (random_packing(60, 0.4, Uniform(1.0, 2.0), seed=5), {"sampling": "random"}),
        (random_packing(60, 0.1, Uniform(1.0, 2.0), seed=5), {"max_distance": 4.0}),
        (overlapping(UNBOUNDED), {}),
        (overlapping(UNBOUNDED), {"sampling": "random", "emitters": [3, 17]}),
        (overlapping(BOUNDED), {}),
        (overlapping(BOUNDED), {"max_distance": 0.2}),
    ],
    ids=["images", "random", "max_distance", "unbounded", "unbounded_random", "bounded", "both"],
)
def test_single_rays_give_the_same_counts(packing, options, monkeypatch):
    monkeypatch.setattr(cuda, "Device", Here)
    # Tasks that hold a part of a row, too.
    monkeypatch.setattr(tally, "RAYS_PER_TASK", 100)
    wanted = tally.trace(packing, rays=301, seed=2, **options)
    found = tally.trace(packing, rays=301, seed=2, device="cuda", **options)
    assert wanted.count.sum() == len(np.unique(wanted.emitter)) * 301
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name), err_msg=name)


def test_what_does_not_fit_is_traced_in_a_second_go(monkeypatch):
    monkeypatch.setattr(cuda, "Device", Here)
    bed = random_packing(60, 0.4, Uniform(1.0, 2.0), seed=5)
    whole = tally.trace(bed, rays=40, seed=2, emitters=range(9), device="cuda")
    block, goes = _single.tally_block, []

    def narrow(*arguments):
        done = block(*arguments[:7], *(out[:60] for out in arguments[7:10]), arguments[10])
        goes.append(done)
        return done

    monkeypatch.setattr(_single, "tally_block", narrow)
    parts = tally.trace(bed, rays=40, seed=2, emitters=range(9), device="cuda")
    assert len(goes) > 2
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name), err_msg=name)


def test_a_buried_sphere_is_named(monkeypatch):
    monkeypatch.setattr(cuda, "Device", Here)
    twice = Packing([[0, 0, 0], [2, 0, 0], [0, 0, 0]], [1.0, 1.0, 0.8], source="bed.csv")
    with pytest.raises(InputError, match=r"bed.csv: sphere 2 lies wholly inside .* remove it"):
        view_factors(twice, rays=10, device="cuda")


SIMULATED = """
import warnings
import numpy as np
from greybed.core import Cylinder, Disc, Packing, Plane
from greybed.raytrace import tally

# Streams wrap modulo 2^64, which NumPy reports for scalars and compiled code does not.
warnings.filterwarnings("ignore", message="overflow encountered in scalar")
rng = np.random.default_rng(1)
centres, radii = rng.uniform(0.2, 0.8, (6, 3)), rng.uniform(0.1, 0.2, 6)
walls = [Cylinder((0.5, 0.5, 0), (0, 0, 1), 0.45), Plane((0, 0, 0.1), (0, 0, 1)),
         Disc((0.5, 0.5, 0.9), (0, 0, -1), 0.2)]
for packing, options in (
    (Packing(centres, radii, [1, 1, 1], (True,) * 3), {"images": True}),
    (Packing(centres, radii, walls=walls), {"sampling": "random"}),
):
    wanted = tally.trace(packing, rays=21, seed=2, threads=1, **options)
    found = tally.trace(packing, rays=21, seed=2, threads=1, device="cuda", **options)
    for name in ("emitter", "key", "count", "squares", "buried"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name), err_msg=name)
    print(found.count.sum())
"""


def test_simulated_device_gives_the_same_counts():
    run = subprocess.run(
        [sys.executable, "-c", SIMULATED],
        # The simulator's arrays are no arrays to compiled code.
        env={**os.environ, "NUMBA_ENABLE_CUDASIM": "1", "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert run.stdout.split() == ["126", "126"], run.stderr


def has_device():
    return numba.cuda.implementation == "NVIDIA" and numba.cuda.is_available()


def test_real_device_gives_the_same_counts():
    if not has_device():
        pytest.skip("no CUDA device: needs an NVIDIA GPU, its driver and greybed[gpu]")
    bed = random_packing(500, 0.5, Uniform(1.0, 2.0), seed=5)
    for packing, options in ((bed, {"images": True}), (overlapping(UNBOUNDED + BOUNDED), {})):
        wanted = tally.trace(packing, rays=8_000, seed=2, **options)
        found = tally.trace(packing, rays=8_000, seed=2, device="cuda", **options)
        assert found.count.sum() == wanted.count.sum()
        moved = {}
        for result, sign in ((wanted, 1), (found, -1)):
            for i, k, c in zip(result.emitter, result.key, result.count, strict=True):
                moved[i, k] = moved.get((i, k), 0) + sign * int(c)
        # The device fuses multiplication and addition: a ray in a million may graze otherwise.
        assert sum(map(abs, moved.values())) <= 2 * (2 + wanted.count.sum() // 1_000_000)


def test_no_device_is_refused(monkeypatch):
    if has_device():
        pytest.skip("there is a CUDA device")
    monkeypatch.setattr(numba.cuda, "implementation", "NVIDIA")
    with pytest.raises(InputError, match=r"finds no CUDA device \(.+\); .*or give device='cpu'"):
        view_factors(PAIR, rays=10, device="cuda")


@pytest.mark.parametrize("there", [True, False])
def test_without_numba_cuda_refused(there, monkeypatch):
    if there:
        monkeypatch.setattr(numba.cuda, "implementation", "Built-in")
    else:
        monkeypatch.delattr(numba, "cuda")
        monkeypatch.setitem(sys.modules, "numba.cuda", None)
    what = "is not installed" if there else r"cannot be imported \(.+\)"
    message = rf"needs numba-cuda, which {what}; pip install 'greybed\[gpu\]', or give device='cpu'"
    with pytest.raises(InputError, match=message):
        view_factors(PAIR, rays=10, device="cuda")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"device": "gpu"}, r"device = 'gpu' is unknown; give one of cpu, cuda"),
        ({"device": "cuda", "rel_error": 0.1}, r"rel_error .* processor only; device = 'cuda'"),
    ],
)
def test_refusals(options, message):
    with pytest.raises(InputError, match=message):
        view_factors(PAIR, rays=10, **options)


def test_launches_fit_into_the_memory():
    assert cuda.launch_size(10**9, 1e11) == cuda.RAYS_PER_LAUNCH
    rays = cuda.launch_size(10**9, 1.2e9)
    assert 100_000 < rays < cuda.RAYS_PER_LAUNCH
    assert 10**9 + 64 * rays <= 1.2e9
    with pytest.raises(InputError, match=r"1000 MB of free memory.* takes 999 MB .*device='cpu'"):
        cuda.launch_size(999_000_000, 1e9)


def test_the_processor_s_tracer_does_not_load_it():
    script = (
        "import sys; from greybed.core import Packing; from greybed.raytrace import view_factors;"
        "view_factors(Packing([[0, 0, 0], [2, 0, 0]], 1.0), rays=10);"
        "print('numba.cuda' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60)
    assert run.stdout.split() == ["False"], run.stderr
