"""Cases of particles through LIGGGHTS and through our own engine: the same answers.

Skipped where no ``liggghts`` is installed (Debian: apt-get install liggghts).
"""

from __future__ import annotations

import shutil

import numpy as np
import pytest
from liggghts_cases import (
    HEAD,
    SOME,
    apart,
    both,
    pack,
    planes,
    rectangles,
    theirs,
)

from greybed.dem.case import load_particle_case
from greybed.dem.liggghts import LiggghtsRun
from greybed.dem.results import results_of
from greybed.dem.runner import ParticleRun

pytestmark = pytest.mark.skipif(
    shutil.which("liggghts") is None, reason="liggghts is not installed (apt-get install liggghts)"
)
needs_mpi = pytest.mark.skipif(shutil.which("mpirun") is None, reason="mpirun is not installed")


@pytest.mark.parametrize(
    ("walls", "changed"),
    [
        (planes(), {}),
        (rectangles(), {}),
        (planes(), {"cohesion": "sjkr", "energy": 2e4}),
        (planes(), {"normal": "linear"}),
    ],
    ids=["planes", "meshes", "sjkr", "linear"],
)
def test_spheres_in_a_box_go_the_same_way(tmp_path, walls, changed):
    """5,000 steps, about five collisions each: later, small differences have grown large."""
    text = HEAD.format(**{**SOME, **changed}) + walls
    sizes = "mono:1.2mm" if "normal" in changed else "uniform:1mm,1.5mm"
    own, their = both(tmp_path, text + pack(10, sizes=sizes))
    assert apart(own, their) < 1e-5
    # Friction has turned most of them.
    assert (np.linalg.norm(own.simulation.spins, axis=1) > 1.0).sum() >= 7
    for mine, other in zip(own.tally.history, their.tally.history, strict=True):
        assert mine.keys() == other.keys()
        for name in mine:
            force = "force" in name
            assert mine[name] == pytest.approx(other[name], rel=1e-3, abs=1e-4 if force else 1e-8)


PERIODIC = """
[periodic]
lower = [0, 0, 0]
upper = [0.02, 0.02, 0.03]
axes = "xyz"
"""


@pytest.mark.parametrize("rolling", ["epsd", "epsd-modified"])
def test_two_swarms_in_a_periodic_box_go_the_same_way(tmp_path, rolling):
    """Rolling resistance away from walls: there LIGGGHTS scales the spin (docs/liggghts.md)."""
    text = HEAD.format(**{**SOME, "duration": 0.03, "rolling": rolling}) + PERIODIC
    other = pack(12).replace("[0.2, 0.1, -0.5]", "[-0.3, 0.2, 0.6]")
    own, their = both(tmp_path, "gravity = [0, 0, 0]" + text + pack(12) + other)
    x, v = own.simulation.centres, own.simulation.velocities
    assert (np.linalg.norm(own.simulation.spins, axis=1) > 1.0).sum() >= 12
    # Places may be told a box further.
    box = np.array([0.02, 0.02, 0.03])
    off = x - their.simulation.centres
    assert abs(off - box * np.round(off / box)).max() < 1e-5 * 2.4e-3
    assert abs(v - their.simulation.velocities).max() < 1e-5


@needs_mpi
def test_two_ranks_are_one_rank(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(HEAD.format(**{**SOME, "duration": 0.03}) + planes() + pack(40))
    one, two = theirs(tmp_path, path, 1), theirs(tmp_path, path, 2)
    assert two.ranks == 2
    # Sums in another order: 1e-16 at first, and three collisions since.
    assert apart(one, two) < 1e-8


BELT = """
[[wall]]
name = "belt"
kind = "plane"
normal = [0, 0, 1]
velocity = [0.1, 0, 0]
starts = 0.02
stops = 0.07
[[wall]]
name = "plate"
kind = "rectangle"
corner = [-0.01, 0.02, 0.01]
a = [0.02, 0, 0]
b = [0, 0.02, 0]
velocity = [0.1, 0, 0]
starts = 0.02
stops = 0.07
[[wall]]
name = "table"
kind = "disc"
point = [0, 0.06, 0.02]
normal = [0, 0, 1]
radius = 0.015
spin = [0, 0, 5.0]
removed = 0.08
[[wall]]
name = "tilting"
kind = "plane"
point = [0, -0.05, 0]
normal = [0, 1, 0]
spin = [0.5, 0, 0]
"""


def test_walls_move_turn_stop_and_go_as_in_our_engine(tmp_path):
    """Four spheres: on a belt, on a plate that moves, on a table that turns and goes."""
    (tmp_path / "four.csv").write_text(
        "x [m],y [m],z [m],radius [m]\n"
        + "".join(f"{x},{y},{z},{r}\n" for (x, y, z), r in zip(PLACES, RADII, strict=True))
    )
    text = HEAD.format(**{**SOME, "duration": 0.1})
    text += BELT.replace('kind = "', 'material = "steel"\nkind = "')
    text += '\n[[particles]]\nkind = "file"\nmaterial = "glass"\nfile = "four.csv"\n'
    text += '\n[[measure]]\nname = "m"\nkind = "slip"\nwall = "tilting"\nspeed = 1.0\n'
    path = tmp_path / "case.toml"
    path.write_text(text)
    from greybed.core.readers import read_packing

    case = load_particle_case(path)
    packings = {0: read_packing(tmp_path / "four.csv")}
    own = ParticleRun(case, packings, threads=1)
    for _ in own.go_on():
        pass
    their = LiggghtsRun(case, packings, tmp_path / "work")
    for _ in their.go_on():
        pass
    # A mesh is moved before the forces of a step, a belt not at all: 1e-4 of a diameter at 0.1 m/s
    # is a step and a half.
    assert apart(own, their) < 2e-3
    x = their.simulation.centres - np.array(PLACES)
    assert x[0, 0] > 1e-3  # the belt has carried it on
    assert x[1, 0] > 1e-3
    assert np.hypot(*x[2, :2]) > 5e-4
    assert x[2, 2] < -1e-3  # the table has gone
    tilts = [
        [row["tilt of tilting [deg]"] for row in run.tally.history] for run in (own, their)
    ]  # fmt: skip
    assert np.allclose(*tilts, atol=1e-6)


PLACES = [(0.0, 0.0, 1.5e-3), (0.0, 0.03, 0.0115), (0.005, 0.06, 0.0215), (0.01, -0.01, 1e-3)]
RADII = [1.5e-3, 1.5e-3, 1.5e-3, 1e-3]

HOPPER = """
[[wall]]
name = "side"
kind = "cylinder"
radius = 0.015
[[wall]]
name = "funnel"
kind = "cone"
radius = 0.007
end_radius = 0.015
length = 0.008
[[wall]]
name = "gate"
kind = "disc"
radius = 0.0075
normal = [0, 0, 1]
removed = 0.06
[[particles]]
kind = "pack"
material = "glass"
sizes = "mono:1.2mm"
count = 250
lower = [-0.015, -0.015, 0.008]
upper = [0.015, 0.015, 0.05]
round = true
[[sink]]
name = "below"
lower = [-1, -1, -1]
upper = [1, 1, -0.01]
"""


def case_of(seed):
    text = HEAD.format(**{**SOME, "duration": 0.3, "seed": seed, "samples": 0.01}) + HOPPER
    return text.replace("time_step = 1e-5", "time_step = 2e-5")


def test_a_hopper_empties_at_the_same_rate(tmp_path):
    """Three seeds each: the means differ by no more than those of replicates do."""
    flows = []
    for seed in (1, 2, 3):
        own, their = both(tmp_path, case_of(seed))
        sinks = [results_of(run)["sinks"]["below"] for run in (own, their)]
        flows.append([sink["mass_kg_per_s"] for sink in sinks])
        # Nothing is lost: what has come is in the sink, or still there.
        assert sinks[1]["particles"] + len(their.simulation.radii) * (not their.emptied) == 250
        total = [row["mass [kg]"] + row["mass in below [kg]"] for row in their.tally.history[:-1]]
        assert np.ptp(total) < 1e-3 * total[0]  # a quarter of a sphere
    mean, error = np.mean(flows, axis=0), np.std(flows, axis=0, ddof=1) / np.sqrt(3)
    # Of three replicates the standard error itself is known to half of it only.
    assert abs(mean[0] - mean[1]) < 3.0 * np.hypot(*error)
    assert np.hypot(*error) < 0.1 * mean[0]
