"""Cases of particles through LIGGGHTS and through our own engine: the same answers.

Skipped where no ``liggghts`` is installed (Debian: apt-get install liggghts).
"""

from __future__ import annotations

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from greybed.cli.main import main
from greybed.core.errors import InputError
from greybed.dem.case import load_particle_case
from greybed.dem.liggghts import LiggghtsRun
from greybed.dem.liggghts.deck import DECK
from greybed.dem.results import results_of
from greybed.dem.runner import ParticleRun

pytestmark = pytest.mark.skipif(
    shutil.which("liggghts") is None, reason="liggghts is not installed (apt-get install liggghts)"
)
needs_mpi = pytest.mark.skipif(shutil.which("mpirun") is None, reason="mpirun is not installed")

HEAD = """
kind = "particles"
duration = {duration}
time_step = 1e-5
seed = {seed}
[output]
samples = {samples}
[law]
normal = "{normal}"
rolling = "{rolling}"
cohesion = "{cohesion}"
[[material]]
name = "glass"
density = 2500
youngs_modulus = "5 MPa"
poissons_ratio = 0.3
[[material]]
name = "steel"
density = 7800
youngs_modulus = "20 MPa"
poissons_ratio = 0.28
[[contact]]
between = ["glass", "glass"]
restitution = 0.6
friction = 0.3
rolling_friction = 0.1
rolling_damping = 0.3
cohesion = {energy}
stiffness = 2000
[[contact]]
between = ["glass", "steel"]
restitution = 0.7
friction = 0.4
rolling_friction = 0.05
rolling_damping = 0.3
cohesion = {energy}
stiffness = 3000
"""
SOME = {
    "duration": 0.05, "seed": 1, "samples": 0.01, "normal": "hertz", "rolling": "none",
    "cohesion": "none", "energy": 0.0,
}  # fmt: skip
PACK = """
[[particles]]
kind = "pack"
material = "glass"
sizes = "{sizes}"
count = {count}
lower = [{low}, {low}, {low}]
upper = [{wide}, {wide}, {high}]
velocity = [0.2, 0.1, -0.5]
"""
WIDE = 0.02


def planes(high=0.0):
    """Floor and four sides of a box, and a lid."""
    rows = []
    for axis, a in enumerate("xyz"):
        for side in (0, 1):
            point, normal = [0.0] * 3, [0.0] * 3
            point[axis], normal[axis] = side * (WIDE if axis < 2 else high), 1.0 - 2.0 * side
            if axis < 2 or side == 0 or high:
                rows.append(
                    f'name = "{a}{side}"\nkind = "plane"\npoint = {point}\nnormal = {normal}'
                )
    return "".join(f'\n[[wall]]\nmaterial = "steel"\n{row}\n' for row in rows)


def rectangles():
    """The same box out of rectangles, which are meshes there."""
    e = WIDE
    rows = [
        ("floor", [0, 0, 0], [e, 0, 0], [0, e, 0]),
        ("left", [0, 0, 0], [0, e, 0], [0, 0, 3 * e]),
        ("right", [e, 0, 0], [0, e, 0], [0, 0, 3 * e]),
        ("front", [0, 0, 0], [e, 0, 0], [0, 0, 3 * e]),
        ("back", [0, e, 0], [e, 0, 0], [0, 0, 3 * e]),
    ]  # fmt: skip
    return "".join(
        f'\n[[wall]]\nmaterial = "steel"\nname = "{n}"\nkind = "rectangle"\ncorner = {c}\na = {a}\n'
        f"b = {b}\n"
        for n, c, a, b in rows
    )


def pack(count, *, sizes="uniform:1mm,1.5mm", high=0.03, low=0.0):
    return PACK.format(count=count, sizes=sizes, wide=WIDE - low, high=high, low=low)


def both(folder, text, ranks=1):
    """The case in both engines, run to the end."""
    path = folder / "case.toml"
    path.write_text(text)
    case = load_particle_case(path)
    own = ParticleRun(case, {}, threads=1)
    for _ in own.go_on():
        pass
    return own, theirs(folder, path, ranks)


def theirs(folder, path, ranks=1):
    run = LiggghtsRun(load_particle_case(path), {}, folder / f"work{ranks}", ranks=ranks)
    for _ in run.go_on():
        pass
    return run


def apart(own, their):
    """Largest distance of the same sphere in both, in the mean diameter."""
    a, b = own.simulation, their.simulation
    assert a.steps == b.steps
    assert (a.labels == b.labels).all()
    assert np.allclose(a.radii, b.radii, rtol=1e-12)
    assert np.allclose(a.masses, b.masses, rtol=1e-9)
    return abs(a.centres - b.centres).max() / (2.0 * a.radii.mean())


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


def test_the_verb_writes_what_our_engine_writes(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(
        HEAD.format(**SOME).replace("[law]", "frames = 0.02\n[law]") + planes() + pack(10)
    )
    for engine in ("greybed", "liggghts"):
        words = ["simulate", str(path), "--out", str(tmp_path / engine), "--quiet"]
        assert main([*words, "--engine", engine]) == 0
    own, their = (
        {str(p.relative_to(tmp_path / engine)) for p in (tmp_path / engine).rglob("*")}
        for engine in ("greybed", "liggghts")
    )
    left = {name for name in their if name.split("/")[0] == "liggghts"}
    assert {"liggghts/in.liggghts", "liggghts/start.data", "liggghts/log.liggghts"} <= left
    # Frames of our engine are taken at looks.
    files = [{n for n in names if not n.startswith("frames/")} for names in (own, their - left)]
    assert files[0] - files[1] == {"checkpoint.npz"}
    assert files[1] <= files[0]
    frames = {f"frames/frame_{step:010d}.vtu" for step in (0, 2000, 4000)}
    assert frames <= their
    assert not list((tmp_path / "liggghts" / "liggghts").glob("*.bin"))
    summary = [
        json.loads((tmp_path / engine / "summary.json").read_text())
        for engine in ("greybed", "liggghts")
    ]
    assert summary[1]["engine"] == "liggghts"
    assert "3.8" in summary[1]["engine_version"]
    assert summary[1]["ranks"] == 1
    assert summary[1]["particle_steps_per_second"] > 0.0
    for name in ("particles", "steps", "time_step_s", "mass_kg", "height_m"):
        assert summary[0][name] == pytest.approx(summary[1][name], rel=1e-6)
    with open(tmp_path / "liggghts" / "history.csv") as stream:
        assert len(list(csv.DictReader(stream))) == 6


STREAM = """
[[particles]]
kind = "stream"
material = "glass"
sizes = "{sizes}"
rate = 0.02
mass = 0.004
lower = [0.002, 0.002, 0.03]
upper = [0.018, 0.018, 0.05]
velocity = [0, 0, -0.5]
[[particles]]
kind = "pack"
material = "glass"
sizes = "mono:1mm"
count = 30
at = 0.1
lower = [0, 0, 0.06]
upper = [0.02, 0.02, 0.08]
"""


@pytest.mark.parametrize("sizes", ["mono:1.2mm", "uniform:1mm,1.4mm", "discrete:1mm=0.5,1.4mm=0.5"])
def test_a_stream_brings_its_mass_at_its_rate_with_its_sizes(tmp_path, sizes):
    path = tmp_path / "case.toml"
    path.write_text(
        HEAD.format(**{**SOME, "duration": 0.3}) + planes() + STREAM.format(sizes=sizes)
    )
    run = theirs(tmp_path, path)
    sim, history = run.simulation, run.tally.history
    pack = 30 * 4.0 / 3.0 * np.pi * 1e-9 * 2500
    largest = 2500 * 4.0 / 3.0 * np.pi * 1.4e-3**3
    # LIGGGHTS ends with the look (200 steps) in which the mass is full.
    assert sim.masses.sum() - pack == pytest.approx(0.004, abs=200 * 1e-5 * 0.02 + largest)
    time = np.array([row["time [s]"] for row in history])
    mass = np.array([row["mass [kg]"] for row in history]) - pack * (time > 0.1)
    early = (time > 0.02) & (time < 0.16)
    # A particle weighs 3 % of what comes in the time.
    assert np.polyfit(time[early], mass[early], 1)[0] == pytest.approx(0.02, rel=0.06)
    radii = sim.radii
    if sizes.startswith("mono"):
        assert set(np.round(radii, 9)) == {1.2e-3, 1e-3}
    if sizes.startswith("discrete"):
        mine = np.sort(radii)
        assert set(np.round(mine, 9)) == {1e-3, 1.4e-3}
        share = (mine[mine > 1.2e-3] ** 3).sum() * 2500 * 4 / 3 * np.pi / 0.004
        assert share == pytest.approx(0.5, abs=0.15)  # random: a hundred particles
    if sizes.startswith("uniform"):
        assert radii.min() >= 1e-3 - 1e-9
        assert radii.max() <= 1.4e-3 + 1e-9
        assert len(np.unique(np.round(radii, 8))) > 10


def test_the_engine_says_why_it_stopped(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(HEAD.format(**SOME) + planes() + pack(10))
    run = LiggghtsRun(load_particle_case(path), {}, tmp_path / "work")
    text = run.deck.text.replace("pair_coeff * *", "pair_coeff * * nonsense")
    object.__setattr__(run.deck, "text", text)
    with pytest.raises(
        InputError, match=r"LIGGGHTS stopped with exit code 1: ERROR: .*; its log is"
    ):
        list(run.go_on())


def test_a_particle_that_leaves_the_bounds_stops_the_run(tmp_path):
    text = HEAD.format(**{**SOME, "duration": 0.2}) + pack(5)
    text += "\n[bounds]\nlower = [-1, -1, -0.01]\nupper = [1, 1, 1]\n"
    path = tmp_path / "case.toml"
    path.write_text(text)
    run = LiggghtsRun(load_particle_case(path), {}, tmp_path / "work")
    with pytest.raises(InputError, match="outside the bounds"):
        list(run.go_on())


@pytest.mark.parametrize("way", [signal.SIGINT, signal.SIGTERM])
def test_a_stopped_run_leaves_no_process_and_no_half_results(tmp_path, way):
    path = tmp_path / "case.toml"
    path.write_text(HEAD.format(**{**SOME, "duration": 500.0}) + planes() + pack(40))
    words = [sys.executable, "-m", "greybed", "simulate", str(path), "--out", str(tmp_path / "out")]
    child = subprocess.Popen([*words, "--engine", "liggghts", "--quiet"], stderr=subprocess.PIPE)
    history = tmp_path / "out" / "history.csv"
    until = time.monotonic() + 60
    while not history.exists() and time.monotonic() < until:
        time.sleep(0.1)
    child.send_signal(way)
    child.communicate(timeout=30)
    assert child.returncode == (130 if way == signal.SIGINT else 143)
    assert not (tmp_path / "out" / "summary.json").exists()
    assert not list((tmp_path / "out").glob("*.part*"))
    work = (tmp_path / "out" / "liggghts").resolve()
    assert (work / DECK).exists()
    for entry in os.listdir("/proc"):
        if entry.isdigit():
            try:
                assert os.readlink(f"/proc/{entry}/cwd") != str(work)
            except OSError:
                continue
