"""Cases with shapes: packs and streams of clumps, sinks, the switch of the shape."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from greybed.core import InputError
from greybed.dem.case import ParticleCase, load_particle_case
from greybed.dem.results import results_of
from greybed.dem.runner import ParticleRun

CASE = """
kind = "particles"
duration = "0.2 s"
seed = 5
[output]
samples = "10 ms"
[[material]]
name = "glass"
density = 2500
youngs_modulus = "5 MPa"
poissons_ratio = 0.3
[[contact]]
between = ["glass", "glass"]
restitution = 0.5
friction = 0.3
[[shape]]
name = "rod"
kind = "spherocylinder"
diameter = "2 mm"
length = "5 mm"
spheres = 4
[[shape]]
name = "pair"
kind = "union"
file = "pair.csv"
[[wall]]
name = "floor"
kind = "plane"
normal = [0, 0, 1]
[[particles]]
kind = "pack"
material = "glass"
sizes = "mono:1mm"
count = 10
lower = ["-10 mm", "-10 mm", "1 mm"]
upper = ["10 mm", "10 mm", "10 mm"]
[[particles]]
kind = "pack"
material = "glass"
shape = "rod"
count = 12
lower = ["-10 mm", "-10 mm", "11 mm"]
upper = ["10 mm", "10 mm", "30 mm"]
[[particles]]
kind = "stream"
material = "glass"
shape = "pair"
rate = "20 g/s"
mass = "2 g"
lower = ["-6 mm", "-6 mm", "40 mm"]
upper = ["6 mm", "6 mm", "50 mm"]
velocity = [0, 0, -0.4]
[[sink]]
name = "beside"
lower = ["15 mm", "-1 m", "-1 m"]
upper = ["1 m", "1 m", "1 m"]
[[measure]]
name = "box"
kind = "solid"
lower = ["-20 mm", "-20 mm", "0 mm"]
upper = ["20 mm", "20 mm", "60 mm"]
"""
PAIR = "x [mm],y [mm],z [mm],radius [mm]\n0,0,0,1\n1.2,0,0,0.8\n"


def case_of(tmp_path: Path, text: str = CASE) -> ParticleCase:
    (tmp_path / "pair.csv").write_text(PAIR)
    (tmp_path / "case.toml").write_text(text)
    return load_particle_case(tmp_path / "case.toml")


def run(case: ParticleCase) -> ParticleRun:
    done = ParticleRun(case, {}, threads=1)
    for _ in done.go_on():
        pass
    return done


def test_packs_and_streams_of_clumps_come_in_whole_and_leave_whole(tmp_path: Path) -> None:
    done = run(case_of(tmp_path))
    sim, tally = done.simulation, done.tally
    results = results_of(done)
    rod, pair = (done.feed.shapes[name] for name in ("rod", "pair"))
    assert tally.inserted[:2] == [10, 12]
    assert tally.inserted[2] > 20
    assert tally.streamed[1] == pytest.approx(12 * 2500 * rod.volume)
    assert tally.streamed[2] == pytest.approx(2e-3, abs=2500 * pair.volume)
    assert sim.masses.sum() + tally.sunk[0] == pytest.approx(sum(tally.streamed), rel=1e-12)
    assert results["particles"] + tally.taken[0] == sum(tally.inserted)
    counts = np.bincount(sim.body_of[sim.body_of >= 0])
    assert set(counts) <= {2, 4}
    assert 0 < results["measures"]["box"]["solid_fraction"] < 0.3
    assert results["measures"]["box"]["mass_kg"] == pytest.approx(
        2500 * results["measures"]["box"]["solid_fraction"] * 40e-3 * 40e-3 * 60e-3, rel=0.05
    )
    assert results["shapes"]["rod"]["deepest_groove_over_radius"] > 0.0


def test_shape_switched_off_gives_spheres_of_the_same_mass(tmp_path: Path) -> None:
    on, off = (
        ParticleRun(case_of(tmp_path, CASE + f"[effects]\nparticle_shape = {value}\n"), {})
        for value in ("true", "false")
    )
    assert len(on.simulation.bodies.masses) > 12
    assert len(off.simulation.bodies.masses) == 0
    assert off.tally.streamed[:2] == pytest.approx(on.tally.streamed[:2], rel=1e-12)
    assert off.simulation.time_step > 0.0


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('shape = "rod"\n', "", "sizes of spheres or the name of a shape"),
        ('shape = "rod"\n', 'shape = "disk"\n', "no shape is called 'disk'; there are rod, pair"),
        ('name = "pair"\n', 'name = "rod"\n', "'rod' is used twice"),
        ('length = "5 mm"', 'length = "1 mm"', "at least the diameter"),
        ('"pair.csv"', '"none.csv"', "cannot read"),
    ],
)
def test_bad_shapes_are_refused(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        ParticleRun(case_of(tmp_path, CASE.replace(old, new)), {})
