"""Runs of particles that go wrong: what is said, and the state that is left on disk."""

from __future__ import annotations

import json

import pytest

from greybed.cli.main import main
from greybed.dem.case import load_particle_case
from greybed.dem.runner import ParticleRun

CASE = """
kind = "particles"
duration = "10 ms"
#TOP
[output]
samples = "1 ms"
frames = "4 ms"
[[material]]
name = "glass"
density = 2500
youngs_modulus = "5 MPa"
poissons_ratio = 0.3
[[contact]]
between = ["glass", "glass"]
restitution = 0.5
friction = 0.3
[[wall]]
name = "floor"
kind = "plane"
normal = [0, 0, 1]
[[particles]]
kind = "pack"
material = "glass"
sizes = "mono:1mm"
count = 20
lower = ["0 mm", "0 mm", "0 mm"]
upper = ["10 mm", "10 mm", "10 mm"]
#PARTICLES
#END
"""
HOLES = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 2 3 4\n"
MESH = '[[wall]]\nkind = "mesh"\nname = "box"\nfile = "box.obj"\n'
LATE = """[[particles]]
kind = "pack"
material = "glass"
sizes = "mono:1mm"
count = 300
at = "5 ms"
lower = [0, 0, 0]
upper = [0.01, 0.01, 0.01]
"""


def simulate(tmp_path, text):
    (tmp_path / "case.toml").write_text(text)
    (tmp_path / "box.obj").write_text(HOLES)
    out = tmp_path / "out"
    return main(["simulate", str(tmp_path / "case.toml"), "--out", str(out), "--quiet"]), out


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("#PARTICLES", "velocity = [0, 0, -1000]", "moves at 1e+03 m/s, more than its radius"),
        ("#PARTICLES", "velocity = [0, 0, -1e160]", "which is no place"),
        ("#TOP", "gravity = [0, 0, -30000]", "of a radius, more than 0.3"),
        (
            "#TOP",
            "gravity = [3000, 0, 0]\nbounds = {lower = [0, 0, 0], upper = [0.011, 0.1, 0.1]}",
            "outside the bounds; close the walls",
        ),
    ],
)
@pytest.mark.filterwarnings("ignore:overflow")
def test_a_run_that_fails_at_once_leaves_its_start(tmp_path, capsys, old, new, says):
    code, out = simulate(tmp_path, CASE.replace(old, new))
    assert code == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert says in said
    for part in ("case.toml: step ", "particle", "[m]", "; the last good state is in "):
        assert part in said
    run = ParticleRun(load_particle_case(tmp_path / "case.toml"), {})
    run.restore(out / "checkpoint.npz")
    assert run.simulation.steps <= int(said.split("step ")[1].split(":")[0])


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"5 MPa"', '"-5 MPa"', "material[0].youngs_modulus = -5e+06 [Pa] must be above 0; mend"),
        ("friction = 0.3", "", "contact[0].friction is missing; give a number [-]"),
        ('between = ["glass", "glass"]', 'between = ["glass", "gl"]', "no material is called 'gl'"),
        ("count = 20", "count = 2000", "only 69 of 2000 particles find room"),
        ("mono:1mm", "mono:9mm", "does not fit into a region"),
        ("#END", LATE, "300 particles of 1.26e-06 [m3] find no room in a region of 1e-06 [m3]"),
        ("#TOP", 'time_step = "1 ms"', "exceeds 0.4 of Rayleigh's time 0.000122 [s]; take at most"),
        ("#END", MESH, "has holes or open rims, where particles fall through; mend it"),
    ],
)
def test_bad_input_is_refused_before_the_first_step(tmp_path, capsys, old, new, says):
    code, out = simulate(tmp_path, CASE.replace(old, new))
    assert code == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert says in said
    assert "case.toml: " in said
    assert not (out / "checkpoint.npz").exists()


def test_an_open_mesh_may_be_meant(tmp_path):
    assert simulate(tmp_path, CASE.replace("#END", MESH + "open = true\n"))[0] == 0


def test_frames_in_one_file_survive_a_stop(tmp_path, monkeypatch):
    import h5py

    text = CASE.replace("frames", 'format = "vtkhdf"\nframes')
    original = ParticleRun.go_on

    def stopped(self):
        for done in original(self):
            yield done
            if self.simulation.time > 6e-3:
                raise KeyboardInterrupt

    monkeypatch.setattr(ParticleRun, "go_on", stopped)
    code, out = simulate(tmp_path, text)
    assert code == 130
    assert len(list((out / "frames").glob("*.npz"))) == 2
    monkeypatch.setattr(ParticleRun, "go_on", original)
    assert simulate(tmp_path, text)[0] == 0
    straight = ParticleRun(load_particle_case(tmp_path / "case.toml"), {})
    with h5py.File(out / "frames.vtkhdf") as file:
        times = file["VTKHDF/Steps/Values"][:]
        points = file["VTKHDF/Points"][:].reshape(3, 20, 3)
    for time, there in zip(times, points, strict=True):
        for _ in straight.go_on(round(time / straight.simulation.time_step)):
            pass
        assert (straight.simulation.centres == there).all()


def test_frames_of_an_older_case_go(tmp_path):
    text = CASE.replace("frames", 'format = "vtkhdf"\nframes')
    code, out = simulate(tmp_path, CASE)
    assert code == 0
    assert len(list((out / "frames").glob("*.vtu"))) == 3
    code, out = simulate(tmp_path, text)
    assert code == 0
    assert not list((out / "frames").iterdir())
    import h5py

    with h5py.File(out / "frames.vtkhdf") as file:
        assert file["VTKHDF/Steps"].attrs["NSteps"] == 3
        assert file["VTKHDF/NumberOfPoints"][:].tolist() == [20, 20, 20]
        kept = file["VTKHDF/Points"][:]
    # The same command finds the end and leaves the file as it is.
    assert simulate(tmp_path, text)[0] == 0
    with h5py.File(out / "frames.vtkhdf") as file:
        assert (file["VTKHDF/Points"][:] == kept).all()
    assert json.loads((out / "summary.json").read_text())["steps_found_from_stopped_run"] > 0
