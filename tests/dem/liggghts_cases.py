"""Cases for the tests of LIGGGHTS: spheres in a box, and both engines run on them."""

from __future__ import annotations

import numpy as np

from greybed.dem.case import load_particle_case
from greybed.dem.liggghts import LiggghtsRun
from greybed.dem.runner import ParticleRun

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
