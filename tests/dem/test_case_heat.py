"""Heat in cases of particles: steady flux, arrivals, conservation, the same bits after a stop."""

from __future__ import annotations

import json

import numpy as np
import pytest

from greybed.cli.main import main
from greybed.core import InputError
from greybed.dem.case import load_particle_case
from greybed.dem.results import results_of
from greybed.dem.runner import ParticleRun

BOX = """
kind = "particles"
duration = "0.12 s"
seed = 1
gravity = [0, 0, 0]
look = "1 ms"
[output]
samples = "2 ms"
frames = "60 ms"
[heat]
temperature = "350 K"
[[material]]
name = "powder"
density = 2500
youngs_modulus = "5 MPa"
poissons_ratio = 0.3
conductivity = 2.0
heat_capacity = "0.01 J/kg/K"
[[contact]]
between = ["powder", "powder"]
restitution = 0.3
friction = 0.5
[periodic]
lower = [0, 0, 0]
upper = ["8 mm", "8 mm", "60 mm"]
axes = "xy"
[[wall]]
name = "floor"
kind = "plane"
normal = [0, 0, 1]
temperature = "400 K"
[[wall]]
name = "lid"
kind = "plane"
point = [0, 0, "21 mm"]
normal = [0, 0, -1]
velocity = [0, 0, -0.3]
servo = "0.32 N"
temperature = "300 K"
[[particles]]
kind = "pack"
material = "powder"
sizes = "uniform:0.9mm,1.1mm"
count = 90
lower = [0, 0, 0]
upper = ["8 mm", "8 mm", "21 mm"]
[[measure]]
name = "bed"
kind = "conduction"
walls = ["floor", "lid"]
lower = "2 mm"
upper = "8 mm"
area = "64 mm2"
[[measure]]
name = "stress"
kind = "stress"
lower = [0, 0, "2 mm"]
upper = ["8 mm", "8 mm", "8 mm"]
"""


def run_of(tmp_path, text=BOX, **more):
    (tmp_path / "case.toml").write_text(text)
    return ParticleRun(load_particle_case(tmp_path / "case.toml"), {}, **more)


def ended(run, until=None):
    for _ in run.go_on(until):
        pass
    return run


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return ended(run_of(tmp_path_factory.mktemp("box"), threads=1))


def test_a_pressed_bed_carries_a_steady_flux(whole):
    bed = results_of(whole)["measures"]["bed"]
    # What the floor gives goes into the lid, and what is between agrees with the chain of contacts.
    assert abs(bed["imbalance"]) < 0.02
    pairs, between, _, _ = whole.heat.conductances()
    z, t = whole.simulation.centres[:, 2], whole.heat.temperatures
    i, j = pairs.T
    up = np.where(z[i] < z[j], 1.0, -1.0)
    crossing = (np.minimum(z[i], z[j]) < 5e-3) & (np.maximum(z[i], z[j]) >= 5e-3)
    through = (between * (t[i] - t[j]) * up)[crossing].sum()
    assert bed["heat_flow_W"] == pytest.approx(through, rel=0.02)
    assert bed["gradient_K_per_m"] < 0.0
    assert 0.05 < bed["conductivity_W_per_m_K"] / 2.0 < 0.3
    assert 300.0 < t.min() < 320.0 < 380.0 < t.max() < 400.0


def test_heat_goes_nowhere(whole):
    row = whole.tally.history[-1]
    capacity = whole.heat.capacities.sum()
    given = row["heat from floor [J]"] + row["heat from lid [J]"]
    assert capacity * (row["mean temperature [K]"] - 350.0) == pytest.approx(given, abs=1e-10)
    assert abs(row["heat from floor [J]"]) > 1e-4


def test_the_stress_is_that_of_the_lid(whole):
    found = np.array(results_of(whole)["measures"]["stress"]["stress_Pa"])
    assert found[2, 2] == pytest.approx(0.32 / 64e-6, rel=0.01)


def test_a_stopped_run_has_the_same_temperatures(tmp_path, whole):
    first = ended(run_of(tmp_path, threads=2), whole.steps // 2 + 13)
    first.save(tmp_path / "half.npz")
    second = run_of(tmp_path, threads=1)
    second.restore(tmp_path / "half.npz")
    with pytest.raises(InputError, match="holds no temperatures"):
        second.heat.go_back({})
    ended(second)
    assert second.heat.temperatures.tobytes() == whole.heat.temperatures.tobytes()
    assert second.heat.from_walls.tobytes() == whole.heat.from_walls.tobytes()
    assert second.tally.history[-1] == whole.tally.history[-1]


def test_tables_bring_their_own_temperatures(tmp_path):
    more = """
[[particles]]
kind = "pack"
material = "powder"
sizes = "mono:1mm"
count = 4
at = "1 ms"
temperature = "60 degC"
lower = [0, 0, "14 mm"]
upper = ["8 mm", "8 mm", "20 mm"]
"""
    text = BOX.replace("count = 90", 'count = 40\ntemperature = "390 K"')
    text = text.replace('upper = ["8 mm", "8 mm", "21 mm"]', 'upper = ["8 mm", "8 mm", "13 mm"]')
    run = run_of(tmp_path, text.replace('"0.12 s"', '"3 ms"') + more)
    np.testing.assert_array_equal(run.heat.temperatures, 390.0)
    ended(run)
    np.testing.assert_array_equal(run.heat.temperatures[40:], 333.15)


def test_the_verb_writes_temperatures(tmp_path):
    (tmp_path / "case.toml").write_text(BOX.replace('"0.12 s"', '"10 ms"'))
    out = tmp_path / "out"
    assert main(["simulate", str(tmp_path / "case.toml"), "--out", str(out), "--quiet"]) == 0
    assert b'Name="temperature [K]"' in (out / "final.vtu").read_bytes()
    assert "heat from floor [J]" in (out / "history.csv").read_text().splitlines()[0]
    heat = json.loads((out / "summary.json").read_text())["heat"]
    assert set(heat["from_walls_J"]) == {"floor", "lid"}
    assert 300.0 < heat["mean_temperature_K"] < 400.0


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("conductivity = 2.0", "", "material 'powder' has no conductivity, which"),
        ('[heat]\ntemperature = "350 K"', "", "wall 'floor' has a temperature, but the case has"),
        ('temperature = "300 K"', "", "measure 'bed': no wall 'lid' has a temperature"),
        ('walls = ["floor", "lid"]', 'walls = ["floor", "top"]', "no wall is called 'top'"),
        ('walls = ["floor", "lid"]', 'walls = ["floor"]', "must be two names"),
        ('temperature = "350 K"', "temperature = -3", r"heat.temperature = -3 \[K\] must be above"),
        ("[heat]", "[heat]\nstiffness_ratio = 0", "stiffness_ratio = 0"),
    ],
)
def test_refusals(tmp_path, old, new, says):
    assert old in BOX
    with pytest.raises(InputError, match=says):
        run_of(tmp_path, BOX.replace(old, new, 1))
