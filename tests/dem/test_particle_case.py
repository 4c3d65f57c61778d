"""Cases of particles: streams, sinks, gates and servo walls; stopped and continued; refusals."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from greybed.cli.main import main
from greybed.core import InputError
from greybed.core.readers import read_packing
from greybed.dem.case import load_particle_case
from greybed.dem.insertion import Region, random_places
from greybed.dem.runner import ParticleRun

HEAD = """
kind = "particles"
duration = "0.25 s"
seed = 3
[output]
samples = "10 ms"
frames = "100 ms"
checkpoints = "50 ms"
[[material]]
name = "glass"
density = 2500
youngs_modulus = "5 MPa"
poissons_ratio = 0.3
[[material]]
name = "steel"
density = 7800
youngs_modulus = "5 MPa"
poissons_ratio = 0.3
[[contact]]
between = ["glass", "glass"]
restitution = 0.5
friction = 0.3
rolling_friction = 0.1
[[contact]]
between = ["glass", "steel"]
restitution = 0.5
friction = 0.4
"""
SILO = (
    HEAD
    + """
[[wall]]
name = "side"
kind = "cylinder"
radius = "15 mm"
material = "steel"
[[wall]]
name = "gate"
kind = "disc"
radius = "16 mm"
normal = [0, 0, 1]
material = "steel"
removed = "0.15 s"
[[particles]]
kind = "pack"
material = "glass"
sizes = "uniform:1mm,1.5mm"
count = 100
lower = ["-15 mm", "-15 mm", "0 mm"]
upper = ["15 mm", "15 mm", "40 mm"]
round = true
[[particles]]
kind = "stream"
material = "glass"
sizes = "mono:1mm"
rate = "10 g/s"
mass = "1 g"
lower = ["-10 mm", "-10 mm", "50 mm"]
upper = ["10 mm", "10 mm", "60 mm"]
velocity = [0, 0, -0.5]
round = true
[[sink]]
name = "below"
lower = [-1, -1, -1]
upper = [1, 1, -0.04]
[[measure]]
name = "mix"
kind = "compartments"
axis = "z"
lower = "-50 mm"
upper = "50 mm"
count = 1
[[measure]]
name = "core"
kind = "solid"
lower = ["-15 mm", "-15 mm", "-40 mm"]
upper = ["15 mm", "15 mm", "0 mm"]
"""
)


def case_of(tmp_path, text):
    (tmp_path / "case.toml").write_text(text)
    return load_particle_case(tmp_path / "case.toml")


def test_a_silo_fills_opens_and_empties(tmp_path):
    run = ParticleRun(case_of(tmp_path, SILO), {}, threads=1)
    for _ in run.go_on():
        pass
    rows = run.tally.history
    count = np.array([row["particles [-]"] for row in rows])
    mass = np.array([row["mass [kg]"] for row in rows])
    gone = np.array([row["mass in below [kg]"] for row in rows])
    time = np.array([row["time [s]"] for row in rows])
    ball = 2500 * 4 / 3 * math.pi * 1e-9
    # The stream: 10 g/s from the start on, to a particle and two looks; nothing lost or made.
    late = ball + 2 * 0.01 * run.look * run.simulation.time_step
    put = mass + gone - mass[0]
    filling = time < 0.09
    np.testing.assert_allclose(put[filling], 0.01 * time[filling], atol=late)
    assert put[-1] == pytest.approx(1e-3, abs=2 * ball)
    assert (gone[time < 0.15] == 0.0).all()
    assert gone[-1] > 0.2 * mass[0]
    assert count.max() > 140
    below = [row["force z on gate [N]"] for row in rows]
    assert -below[14] == pytest.approx(9.81 * mass[14], rel=0.5)
    assert below[-1] == 0.0


def test_a_skin_moves_nobody(tmp_path):
    places, bytes_each = [], []
    for skin in ("0.1 mm", "2 mm"):
        run = ParticleRun(
            case_of(tmp_path, SILO.replace("seed = 3", f'seed = 3\nskin = "{skin}"')), {}, threads=1
        )
        for _ in run.go_on(until=round(0.08 / run.simulation.time_step)):
            pass
        places.append(run.simulation.centres)
        bytes_each.append(run.simulation.bytes_per_particle)
    # Forces are added in another order: to round-off, grown by the collisions of 80 ms.
    np.testing.assert_allclose(places[0], places[1], atol=1e-9)
    assert bytes_each[1] > 1.2 * bytes_each[0]


def test_a_stopped_run_goes_on_with_the_same_bits(tmp_path):
    whole = ParticleRun(case_of(tmp_path, SILO), {}, threads=2)
    for _ in whole.go_on():
        pass
    first = ParticleRun(case_of(tmp_path, SILO), {}, threads=1)
    for _ in first.go_on(whole.steps // 2 + 77):
        pass
    first.save(tmp_path / "half.npz", key="k")
    second = ParticleRun(case_of(tmp_path, SILO), {}, threads=1)
    assert second.restore(tmp_path / "half.npz") == {"key": "k"}
    for _ in second.go_on():
        pass
    assert second.simulation.centres.tobytes() == whole.simulation.centres.tobytes()
    assert second.tally.sunk == whole.tally.sunk
    assert [row["mass [kg]"] for row in second.tally.history][-1] == float(
        whole.simulation.masses.sum()
    )


def test_a_servo_wall_presses_with_the_force_asked_for(tmp_path):
    lid = """
[[wall]]
name = "side"
kind = "cylinder"
radius = "10 mm"
[[wall]]
name = "floor"
kind = "plane"
normal = [0, 0, 1]
[[wall]]
name = "lid"
kind = "plane"
point = [0, 0, "16 mm"]
normal = [0, 0, -1]
velocity = [0, 0, -0.1]
servo = "1 N"
[[particles]]
kind = "pack"
material = "glass"
sizes = "mono:1.5mm"
count = 80
lower = ["-10 mm", "-10 mm", "0 mm"]
upper = ["10 mm", "10 mm", "16 mm"]
round = true
"""
    run = ParticleRun(case_of(tmp_path, HEAD + lid), {}, threads=1)
    for _ in run.go_on():
        pass
    force = [row["force z on lid [N]"] for row in run.tally.history]
    assert np.mean(force[-10:]) == pytest.approx(1.0, rel=0.1)
    assert run.tally.history[-1]["height [m]"] < 0.0155


def test_the_verb_writes_pictures_and_goes_on(tmp_path, capsys, monkeypatch):
    (tmp_path / "case.toml").write_text(SILO)
    words = ["simulate", str(tmp_path / "case.toml"), "--out", str(tmp_path / "out"), "--quiet"]

    def stopped(self):
        self.save_calls = getattr(self, "save_calls", 0)
        for done in original(self):
            yield done
            if self.simulation.time > 0.12:
                raise KeyboardInterrupt

    original = ParticleRun.go_on
    monkeypatch.setattr(ParticleRun, "go_on", stopped)
    assert main(words) == 130
    monkeypatch.setattr(ParticleRun, "go_on", original)
    assert main([*words, "--movie"]) == 0
    said = capsys.readouterr().out
    assert "went on from a stopped run at step" in said
    out = tmp_path / "out"
    results = json.loads((out / "summary.json").read_text())
    assert results["particle_steps_per_second"] > 0
    assert results["sinks"]["below"]["particles"] > 20
    assert 0 < results["measures"]["core"]["solid_fraction"] < 0.7
    shares = np.array(results["measures"]["mix"]["mass_shares"], dtype=float)
    np.testing.assert_allclose(shares, 1.0)
    straight = ParticleRun(load_particle_case(tmp_path / "case.toml"), {})
    for _ in straight.go_on():
        pass
    final = read_packing(out / "final.h5")
    np.testing.assert_array_equal(final.centres, straight.simulation.centres)
    assert (out / "movie.gif").read_bytes()[:6] == b"GIF89a"
    assert (out / "frames.pvd").read_text().count("<DataSet") == 3
    lines = (out / "history.csv").read_text().splitlines()
    assert len(lines) == len(straight.tally.history) + 1


def test_random_places_are_apart_and_inside():
    region = Region((0, 0, 0), (0.02, 0.02, 0.05), True)
    radii = np.linspace(2e-3, 1e-3, 200)
    taken = [[0.01, 0.01, 0.02]]
    x = random_places(region, radii, 1, taken=taken, taken_radii=[4e-3])
    assert len(x) == 200
    x, r = np.concatenate([x, taken]), np.append(radii, 4e-3)
    away = np.linalg.norm(x[:, None] - x, axis=2) - r[:, None] - r
    assert away[np.triu_indices(201, 1)].min() >= 0.0
    assert (np.hypot(*(x[:200, :2] - 0.01).T) + radii <= 0.01 + 1e-15).all()
    assert len(random_places(region, np.full(2000, 2e-3), 1)) < 400
    with pytest.raises(InputError, match="does not fit into a region"):
        random_places(region, [0.011], 1)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (('youngs_modulus = "5 MPa"', "youngs_modulus = -1"), r"\[0\].youngs_modulus = -1 "),
        (('between = ["glass", "steel"]', 'between = ["glass", "stel"]'), "no material is called"),
        (('between = ["glass", "steel"]', 'between = ["steel", "steel"]'), "'glass' and 'steel'"),
        (('between = ["glass", "steel"]', 'between = ["glass"]'), "must be two names"),
        (("count = 100", "count = 5000"), "only .* of 5000 particles find room"),
        (('sizes = "mono:1mm"', 'sizes = "mono:1"'), "unit"),
        (('kind = "stream"', 'kind = "steam"'), "did you mean 'stream'"),
        (("seed = 3", 'seed = 3\ntime_step = "1 ms"'), "exceeds 0.4 of Rayleigh's time"),
        (('name = "gate"', 'name = "side"'), "name 'side' is used twice"),
        (('kind = "pack"', 'kind = "pack"\nat = "1 s"'), None),
    ],
)  # fmt: skip
def test_bad_cases_are_refused_before_the_first_step(tmp_path, change, says):
    assert change[0] in SILO
    text = SILO.replace(*change, 1)
    if says is None:  # all that come at the start come later
        text = text.replace('rate = "10 g/s"', 'rate = "10 g/s"\nstarts = "1 s"')
        says = "no particles are there at the start"
    with pytest.raises(InputError, match=says):
        ParticleRun(case_of(tmp_path, text), {})


def test_effects_are_switches(tmp_path):
    rolling = SILO.replace("seed = 3", 'seed = 3\nlaw.rolling = "epsd"')
    on = case_of(tmp_path, rolling)
    off = case_of(
        tmp_path, rolling.replace("seed = 3", "seed = 3\neffects.rolling_resistance = false")
    )
    assert on.contact_law.rolling == "epsd"
    assert off.contact_law.rolling == "none"
    slick = case_of(tmp_path, SILO.replace("seed = 3", "seed = 3\neffects.wall_friction = false"))
    contacts = slick.contacts({"glass"})
    assert contacts["glass", "steel"].friction == 0.0
    assert contacts["glass", "glass"].friction == 0.3


def test_an_effect_that_is_off_leaves_the_reference_restitution(tmp_path):
    """The viscoelastic law off is Hertz's with the restitution of the reference impact."""
    viscous = SILO.replace("[output]", '[law]\nnormal = "viscoelastic"\n[output]').replace(
        "restitution = 0.5", 'restitution = 0.5\nreference_speed = 1\nreference_radius = "1.2 mm"'
    )
    plain = ParticleRun(case_of(tmp_path, SILO), {}, threads=1)
    off = viscous + "[effects]\nvelocity_restitution = false\n"
    ends = {}
    for name, text in (("on", viscous), ("off", off)):
        run = ParticleRun(case_of(tmp_path, text), {}, threads=1)
        assert run.simulation.time_step == plain.simulation.time_step
        for _ in run.go_on(2_000):
            pass
        ends[name] = run.simulation.centres
    for _ in plain.go_on(2_000):
        pass
    np.testing.assert_array_equal(ends["off"], plain.simulation.centres)
    assert np.abs(ends["on"] - ends["off"]).max() > 1e-6
