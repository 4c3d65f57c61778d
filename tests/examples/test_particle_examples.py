"""The example cases of particles: each is read, starts and runs; their effects switch as stated."""

from __future__ import annotations

import copy
from pathlib import Path

import numpy as np
import pytest

from greybed.core.config import build, read_toml
from greybed.dem.case import ParticleCase, load_particle_case
from greybed.dem.results import results_of
from greybed.dem.runner import ParticleRun
from greybed.residual.models.case import put
from greybed.residual.models.particle_runner import ParticleRunner

EXAMPLES = Path(__file__).parents[2] / "examples"
CASES = sorted((EXAMPLES / "particles").glob("*.toml"))
STUDY = EXAMPLES / "hopper_study/silo.toml"


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_each_case_starts_and_is_measured(path):
    run = ParticleRun(load_particle_case(path), {}, threads=1)
    for _ in run.go_on(600):
        pass
    sim = run.simulation
    assert sim.steps == 600
    # Free fall, until something is met.
    fallen = sim.velocities[:, 2] - run.case.gravity[2] * sim.time
    assert np.abs(np.median(fallen)) < 0.5
    results = results_of(run)
    assert results["particles"] == sim.count_of() >= 1
    assert set(results["measures"]) == {table.name for table in run.case.measure}


def test_the_page_lists_them():
    page = (EXAMPLES.parent / "docs/particle_cases.md").read_text()
    assert len(CASES) >= 12
    for path in CASES:
        name = path.name.replace("rig_b.toml", "rig_a.toml").replace("rig_c.toml", "rig_a.toml")
        assert f"`{name}`" in page


def test_effects_of_the_silo_are_those_of_its_case(tmp_path):
    runner = ParticleRunner(STUDY, "particles", tmp_path)
    content = read_toml(STUDY)
    switches = runner.switches()
    assert switches["rolling-resistance"].excluded(content) is None
    assert switches["cohesion"].excluded(content) is None
    assert "contact.friction" in switches["wall-friction"].excluded(content)
    rolls, sticks, slick = (copy.deepcopy(content) for _ in range(3))
    switches["rolling-resistance"].apply(rolls, 0.3)
    switches["cohesion"].apply(sticks, 50.0)
    slick["contact"][1]["friction"] = 0.0
    assert switches["wall-friction"].excluded(slick) is None
    switches["wall-friction"].apply(slick, 0.2)
    assert [c["friction"] for c in slick["contact"]] == [0.4, 0.2]
    assert "has it" in switches["rolling-resistance"].excluded(rolls)
    assert "has it" in switches["cohesion"].excluded(sticks)
    case = build(ParticleCase, rolls, STUDY)
    assert case.contact_law.rolling == "epsd-modified"
    assert {c.rolling_friction for c in case.contact} == {0.3}
    case = build(ParticleCase, sticks, STUDY)
    assert [c.cohesion for c in case.contact] == [50.0, 0.0]
    losing = copy.deepcopy(content)
    assert switches["velocity-dependent-restitution"].excluded(losing) is None
    switches["velocity-dependent-restitution"].apply(losing, 0.25)
    assert "has it" in switches["velocity-dependent-restitution"].excluded(losing)
    case = build(ParticleCase, losing, STUDY)
    assert case.contact_law.normal == "viscoelastic"
    assert [c.restitution for c in case.contact] == [0.4, 0.4]
    assert {(c.slow_restitution, c.reference_speed) for c in case.contact} == {(0.5, 1.0)}
    assert case.contact[0].reference_radius == pytest.approx(2e-3, rel=1e-6)
    long = copy.deepcopy(content)
    assert "one size" in switches["particle-shape"].excluded(long)
    long["particles"][0]["sizes"] = "mono:2mm"
    assert switches["particle-shape"].excluded(long) is None
    switches["particle-shape"].apply(long, 0.5)
    assert "has it" in switches["particle-shape"].excluded(long)
    (shape,) = build(ParticleCase, long, STUDY).shape
    assert shape.length == pytest.approx(1.5 * shape.diameter)
    assert shape.clump().equivalent_radius == pytest.approx(2e-3, rel=1e-6)
    for table, why in (({"normal": "linear"}, "'hertz'"), ({"cohesion": "jkr"}, "'jkr'")):
        other = {**content, "law": table}
        assert why in switches["velocity-dependent-restitution"].excluded(other)
    put(content, "wall.funnel.radius", 0.02)
    put(content, "contact.particles.friction", 0.1)
    assert content["wall"][1]["radius"] == 0.02
    assert runner.reseed(content, 7)["seed"] == 7
    assert content["seed"] == 1


def test_a_run_gives_the_outputs_of_a_summary(tmp_path):
    content = read_toml(STUDY)
    content["duration"] = 0.02
    content["particles"][0]["count"] = 50
    runner = ParticleRunner(STUDY, "height_m", tmp_path)
    height = runner.run(content)
    assert 0.0 < height < 0.2
    assert runner.run(content) == height
    assert runner.run(runner.reseed(content, 5)) != height
