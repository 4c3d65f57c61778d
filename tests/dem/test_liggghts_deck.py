"""Decks for LIGGGHTS: what they say, meshes, dumps, and what is refused. No engine needed."""

from __future__ import annotations

import os
import stat
import struct

import numpy as np
import pytest

from greybed.cli.main import main
from greybed.core.errors import InputError
from greybed.core.walls import Cone, Cylinder, Disc, Plane, Polygon
from greybed.dem.case import load_particle_case
from greybed.dem.liggghts import limits, process
from greybed.dem.liggghts.deck import deck_of
from greybed.dem.liggghts.dump import FIELDS, read_dump
from greybed.dem.liggghts.meshes import cut, facets, triangles
from greybed.dem.liggghts.sources import classes, primes
from greybed.dem.runner import ParticleRun

CASE = """
kind = "particles"
duration = 0.02
time_step = 1e-5
look = 1e-3
[output]
samples = 5e-3
{law}
[[material]]
name = "glass"
density = 2500
youngs_modulus = 5e6
poissons_ratio = 0.3
[[contact]]
between = ["glass", "glass"]
restitution = 0.5
friction = 0.3
{contact}
[[wall]]
name = "floor"
kind = "plane"
normal = [0, 0, 1]
[[particles]]
kind = "pack"
material = "glass"
sizes = "{sizes}"
count = 5
lower = [0, 0, 0]
upper = [0.02, 0.02, 0.02]
{more}
"""
SOME = {"law": "", "contact": "", "sizes": "mono:1mm", "more": ""}


def case_of(folder, **changed):
    path = folder / "case.toml"
    path.write_text(CASE.format(**{**SOME, **changed}))
    return load_particle_case(path)


def deck(folder, **changed):
    case = case_of(folder, **changed)
    limits.check(case)
    return deck_of(ParticleRun(case, {}, threads=1))


REFUSED = [
    ({"law": '[law]\ncohesion = "jkr"', "contact": "cohesion = 0.1"}, "law.cohesion = 'jkr'"),
    (
        {
            "law": '[law]\nnormal = "viscoelastic"',
            "contact": "reference_speed = 1\nreference_radius = 1e-3",
        },
        "law.normal = 'viscoelastic'",
    ),
    ({"law": '[law]\nnormal = "hysteresis"', "contact": "stiffness = 1e3"}, "law.normal"),
    ({"law": '[law]\nrolling = "viscous"'}, "law.rolling = 'viscous'"),
    ({"contact": "sliding_friction = 0.2"}, "sliding_friction = 0.2"),
    (
        {
            "law": '[law]\nnormal = "linear"',
            "contact": "stiffness = 1e3",
            "sizes": "uniform:1mm,2mm",
        },
        "several sizes of material 'glass'",
    ),
    (
        {
            "more": '[[wall]]\nname = "w"\nkind = "disc"\nnormal = [0, 0, 1]\nradius = 1\n'
            "velocity = [0, 0, 1]\nspin = [1, 0, 0]\n"
        },
        "wall 'w': a velocity and a spin at once",
    ),
    (
        {
            "more": '[[measure]]\nkind = "stress"\nname = "s"\nlower = [0, 0, 0]\n'
            "upper = [1, 1, 1]\n"
        },
        "measure 's', which needs the force of each contact",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("changed", "what"), REFUSED, ids=[what for _, what in REFUSED])
def test_what_liggghts_cannot_do_is_refused_with_the_remedy(tmp_path, changed, what):
    with pytest.raises(InputError) as refused:
        limits.check(case_of(tmp_path, **changed))
    said = str(refused.value)
    assert said.startswith("LIGGGHTS cannot do ")
    assert what in said
    assert "take --engine greybed" in said


def test_numbers_that_liggghts_refuses_are_refused_before(tmp_path):
    low = CASE.replace("restitution = 0.5", "restitution = 0.05").format(**SOME)
    (tmp_path / "low.toml").write_text(low)
    with pytest.raises(InputError, match=r"restitution = 0.05 \[-\].*more than 0.05"):
        limits.check(load_particle_case(tmp_path / "low.toml"))


def test_a_missing_program_is_named_with_its_package(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(InputError, match=r"apt-get install liggghts"):
        process.command(1, "in", "log")
    case_of(tmp_path)
    words = ["simulate", str(tmp_path / "case.toml"), "--out", str(tmp_path / "o")]
    assert main([*words, "--engine", "liggghts"]) == 2
    assert "Debian's package liggghts" in capsys.readouterr().err
    program = tmp_path / "liggghts"
    program.write_text("#!/bin/sh\n")
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    assert process.command(1, "in", "log")[0] == "liggghts"
    with pytest.raises(InputError, match="openmpi-bin"):
        process.command(2, "in", "log")
    with pytest.raises(InputError, match="at least 1"):
        process.command(0, "in", "log")


@pytest.mark.parametrize(
    "words",
    [["--ranks", "2"], ["--engine", "liggghts", "--threads", "2"]],
    ids=["ranks", "threads"],
)
def test_options_of_the_other_engine_are_refused(tmp_path, capsys, words):
    case_of(tmp_path)
    whole = ["simulate", str(tmp_path / "case.toml"), "--out", str(tmp_path / "o"), *words]
    assert main(whole) == 2
    assert "only" in capsys.readouterr().err


def test_the_deck_has_the_laws_and_the_looks_of_the_case(tmp_path):
    more = '[[sink]]\nname = "s"\nlower = [-1, -1, -1]\nupper = [1, 1, -0.5]\n'
    found = deck(
        tmp_path,
        law='[law]\nrolling = "epsd"\ncohesion = "sjkr"\nlimit_force = true',
        contact="rolling_friction = 0.1\ncohesion = 1e3",
        more=more,
    )
    lines = found.text.splitlines()
    assert (
        "pair_style gran model hertz tangential history cohesion sjkr rolling_friction epsd "
        "limitForce on tangential_reduce on" in lines
    )
    assert any("primitive type 2 zplane 0.0 store_force yes" in line for line in lines)
    # 2,000 steps with a look every 100; samples every 500.
    assert 'run 2000 every 100 "delete_atoms region sink_0 compress no"' in lines
    assert any(line.startswith("dump samples all custom 500 ") for line in lines)
    assert lines[-1] == "run 0"
    assert found.columns == 2 + 3 + 2
    # Every digit of the places is in the data file.
    run = ParticleRun(case_of(tmp_path), {}, threads=1)
    rows = found.files["start.data"].split("Atoms")[1].split("Velocities")[0].split("\n")
    rows = np.array([row.split() for row in rows if row.strip()], dtype=float)
    assert (rows[:, 4:] == run.simulation.centres).all()
    assert (rows[:, 2] == 2.0 * run.simulation.radii).all()


def test_walls_begin_stop_and_go_at_looks(tmp_path):
    more = """
[[wall]]
name = "lid"
kind = "disc"
point = [0, 0, 0.05]
normal = [0, 0, -1]
radius = 0.05
velocity = [0, 0, -0.1]
starts = 0.00415
stops = 0.009
removed = 0.012
"""
    text = deck(tmp_path, more=more).text
    stretches = text.split("\nrun ")
    # The first look at or after 415 steps is 500.
    assert [s.split()[0] for s in stretches[1:]] == ["500", "400", "300", "800", "0"]
    assert "fix move_1 all move/mesh mesh mesh_1 linear 0.0 0.0 -0.1" in stretches[1]
    assert "unfix move_1" in stretches[2]
    gone = stretches[3].splitlines()
    assert gone.index("unfix walls") < gone.index("unfix mesh_1")
    assert "\nfix walls" not in stretches[3]


def test_triangles_have_the_area_of_the_shape():
    box = np.array([[-1.0, -1, -1], [1, 1, 1]])

    def area(shape):
        t = triangles(shape, box, 1e-2)
        return 0.5 * np.linalg.norm(np.cross(t[:, 1] - t[:, 0], t[:, 2] - t[:, 0]), axis=1).sum()

    assert area(Plane((0, 0, 0.3), (0, 0, 1))) == pytest.approx(4.0, rel=1e-12)
    # A plane across the diagonal of the cube's faces.
    assert area(Plane((0, 0, 0), (1, 1, 0))) == pytest.approx(4.0 * np.sqrt(2.0), rel=1e-12)
    assert area(Disc((0, 0, 0), (1, 2, 3), 0.5)) == pytest.approx(0.25 * np.pi, rel=1e-12)
    square = Polygon(((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)), "square")
    assert area(square) == pytest.approx(1.0, rel=1e-12)
    # The sides of a polygon of the same area are longer than the circle by (pi / n)^2 / 6.
    tube = Cylinder((0, 0, 0), (0, 0, 1), 0.5, "tube", 1.0)
    assert area(tube) == pytest.approx(tube.area, rel=2e-3)
    endless = Cylinder((0, 0, 0), (0, 0, 1), 0.5)
    assert area(endless) == pytest.approx(2.0 * np.pi, rel=2e-3)
    for end in (0.2, 0.0):
        cone = Cone((0, 0, 0), (0, 1, 0), 0.5, end, 1.0)
        assert area(cone) == pytest.approx(cone.area, rel=5e-3)


@pytest.mark.parametrize("radius", [0.01, 0.1])
def test_small_spheres_do_not_feel_facets(radius):
    smallest = 1e-3
    depth = radius * (1.0 - np.cos(np.pi / facets(radius, smallest)))
    assert depth <= 0.01 * smallest * 1.001


def test_a_periodic_face_cuts_meshes():
    t = np.array([[[0, -1, 0], [2, -1, 0], [2, 3, 0]], [[0, -1, 0], [2, 3, 0], [0, 3, 0]]], float)
    found = cut(t, [[0, 0, -1], [2, 1, 1]], (False, True, False))
    area = 0.5 * np.linalg.norm(
        np.cross(found[:, 1] - found[:, 0], found[:, 2] - found[:, 0]), axis=1
    )
    assert area.sum() == pytest.approx(2.0, rel=1e-12)
    assert found[..., 1].min() == 0.0
    assert found[..., 1].max() == 1.0
    none = cut(t, [[0, 5, -1], [2, 6, 1]], (False, True, False))
    assert none.shape == (0, 3, 3)


def test_classes_have_the_mean_volume_of_the_distribution():
    from greybed.core.sizes import parse_sizes

    sizes = parse_sizes("uniform:1mm,2mm")
    radii, shares = classes(sizes)
    exact = (2.0**4 - 1.0) / 4.0 * 1e-9
    # The midpoint rule of 32 intervals.
    assert shares @ radii**3 == pytest.approx(exact, rel=1e-3)
    radii, shares = classes(parse_sizes("discrete:1mm=0.5,2mm=0.5"))
    mass = shares * radii**3
    assert mass[0] == pytest.approx(mass[1], rel=1e-12)


def test_seeds_are_primes():
    found = primes(3, 10_000)
    assert found == [10_007, 10_009, 10_037]


def test_dumps_are_read_in_the_order_of_numbers(tmp_path):
    width = len(FIELDS.split())
    rows = np.arange(3.0 * width).reshape(3, width)
    rows[:, 0] = [3, 1, 2]
    head = struct.pack("=qqi6i6dii", 700, 3, 0, *[0] * 6, *[0.0] * 6, width, 2)
    blocks = [rows[:2].ravel(), rows[2:].ravel()]  # of two ranks
    body = b"".join(struct.pack("=i", len(b)) + b.tobytes() for b in blocks)
    path = tmp_path / "sample.700.bin"
    path.write_bytes(head + body)
    step, found = read_dump(path)
    assert step == 700
    assert (found == rows[[1, 2, 0]]).all()
    path.write_bytes(head[:20])
    with pytest.raises(InputError, match="cut short"):
        read_dump(path)


def test_a_process_ends_with_its_block(tmp_path):
    with process.started(["sleep", "60"], tmp_path) as child:
        number = child.pid
    assert child.poll() is not None
    with pytest.raises(ProcessLookupError):
        os.kill(number, 0)
