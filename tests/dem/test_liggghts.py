"""Trajectories against LIGGGHTS 3.8: the same start, laws and steps in both programs.

Skipped where no ``liggghts`` is installed (Debian: apt-get install liggghts). What differs there by
default, as its headers say (Debian: libliggghts-dev) and as these runs show:

- the spring of a contact that has parted stays, and pulls when the two touch again within one list,
  unless ``contact_distance_factor`` is above 1;
- ``sjkr`` acts on friction only with ``tangential_reduce on``;
- ``epsd`` multiplies the spin on a wall by (r - d / 2) / (r - d), where d is the overlap. Here it
  is the spin itself, so that ``epsd`` is compared away from walls.
"""

from __future__ import annotations

import re
import shutil
import subprocess

import numpy as np
import pytest

from greybed.core.walls import Plane
from greybed.dem import Contact, ContactLaw, Material, Simulation, SolidWall

pytestmark = pytest.mark.skipif(
    shutil.which("liggghts") is None, reason="liggghts is not installed (apt-get install liggghts)"
)

GLASS = Material(2500.0, 5e6, 0.3, "glass")
EDGE, STEP = 0.02, 2e-6
# Model and settings for LIGGGHTS, law and contact for greybed.
LAWS = {
    "plain": ("", "", ContactLaw(), Contact(0.7, 0.3)),
    "undamped sideways": (
        "", "tangential_damping off", ContactLaw(tangential_damping=False), Contact(0.7, 0.3),
    ),
    "sjkr": (
        "cohesion sjkr", "tangential_reduce on",
        ContactLaw(cohesion="sjkr"), Contact(0.7, 0.3, cohesion=2e4),
    ),
    "epsd": (
        "rolling_friction epsd", "", ContactLaw(rolling="epsd"),
        Contact(0.7, 0.3, rolling_friction=0.2, rolling_damping=0.3),
    ),
}  # fmt: skip
PLANES = [
    Plane([side * EDGE * (k == axis) for k in range(3)],
          [(1.0 - 2.0 * side) * (k == axis) for k in range(3)])
    for axis in range(3) for side in (0, 1)
]  # fmt: skip


def theirs(folder, start, law, steps, every):
    """Centres, velocities and spins by LIGGGHTS, shape (frames, n, 9)."""
    centres, radii, velocities, spins = start
    model, settings = LAWS[law][:2]
    model = f"hertz tangential history {model}"
    lines = [f"start\n\n{len(radii)} atoms\n1 atom types"]
    lines += [f"0 {EDGE} {a}lo {a}hi" for a in "xyz"]
    lines.append("\nAtoms\n")
    for k, (x, r) in enumerate(zip(centres.tolist(), radii.tolist(), strict=True), 1):
        lines.append(f"{k} 1 {2 * r!r} 2500 " + " ".join(map(repr, x)))
    lines.append("\nVelocities\n")
    for k, row in enumerate(np.hstack([velocities, spins]).tolist(), 1):
        lines.append(f"{k} " + " ".join(map(repr, row)))
    (folder / "data").write_text("\n".join(lines) + "\n")
    walls = "\n".join(
        f"fix w{a}{side} all wall/gran model {model} primitive type 1 {a}plane {side * EDGE} "
        f"{settings}"
        for a in "xyz"
        for side in (0, 1)
    )
    (folder / "in").write_text(f"""atom_style granular
atom_modify map array
boundary f f f
newton off
communicate single vel yes
units si
read_data data
neighbor 0.001 bin
neigh_modify delay 0 contact_distance_factor 1.5
fix m1 all property/global youngsModulus peratomtype 5.e6
fix m2 all property/global poissonsRatio peratomtype 0.3
fix m3 all property/global coefficientRestitution peratomtypepair 1 0.7
fix m4 all property/global coefficientFriction peratomtypepair 1 0.3
fix m5 all property/global coefficientRollingFriction peratomtypepair 1 0.2
fix m6 all property/global coefficientRollingViscousDamping peratomtypepair 1 0.3
fix m7 all property/global cohesionEnergyDensity peratomtypepair 1 20000
pair_style gran model {model} {settings}
pair_coeff * *
timestep {STEP}
fix g all gravity 9.81 vector 0.0 0.0 -1.0
{walls}
fix i all nve/sphere
dump d all custom {every} out id x y z vx vy vz omegax omegay omegaz
dump_modify d sort id format "%d{" %.17g" * 9}"
thermo 100000
run {steps}
""")
    done = subprocess.run(
        ["liggghts", "-in", "in"], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout[-2000:]
    frames = re.split(r"ITEM: ATOMS.*\n", (folder / "out").read_text())[1:]
    frames = [frame.split("ITEM")[0].split() for frame in frames]
    return np.array(frames, dtype=float).reshape(len(frames), -1, 10)[:, :, 1:]


def own(start, law, steps, every):
    """The same by greybed."""
    centres, radii, velocities, spins = start
    sim = Simulation(
        centres, radii, GLASS, LAWS[law][3], law=LAWS[law][2], walls=[SolidWall(p) for p in PLANES],
        velocities=velocities, spins=spins, time_step=STEP, threads=1,
    )  # fmt: skip
    frames = []
    for frame in range(steps // every + 1):
        sim.run(every if frame else 0)
        frames.append(np.hstack([sim.centres, sim.velocities, sim.spins]))
    return np.array(frames)


def two(gap):
    """Two spheres of different size that meet askew, with spins."""
    radii = np.array([1e-3, 1.5e-3])
    along = np.array([0.8, 0.36, 0.48])
    first = np.array([8e-3, 8e-3, 10e-3])
    return (
        np.array([first, first + (radii.sum() + gap) * along]), radii,
        np.array([[0.4, 0.1, 0.3], [-0.2, 0.1, -0.1]]), np.array([[20.0, 50, 0], [0, -30, 40]]),
    )  # fmt: skip


def ten():
    """Ten spheres of different size that fall into the box."""
    rng = np.random.default_rng(3)
    grid = np.array([[i, j, k] for k in range(3) for j in range(2) for i in range(2)])[:10]
    return (
        4e-3 + 6e-3 * grid + rng.uniform(-1e-3, 1e-3, (10, 3)), rng.uniform(1e-3, 2e-3, 10),
        rng.uniform(-0.5, 0.5, (10, 3)) - [0, 0, 0.3], rng.uniform(-50, 50, (10, 3)),
    )  # fmt: skip


def swarm():
    """Ten spheres that fly at each other, far from the walls."""
    rng = np.random.default_rng(5)
    k = np.arange(10) + 0.5
    up, turn = 1.0 - 0.2 * k, np.pi * (1.0 + np.sqrt(5.0)) * k
    flat = np.sqrt(1.0 - up**2)
    away = np.column_stack([flat * np.cos(turn), flat * np.sin(turn), up])
    return (
        0.5 * EDGE + 6e-3 * away, rng.uniform(0.8e-3, 1.2e-3, 10),
        rng.uniform(-0.1, 0.1, (10, 3)) - 0.8 * away, rng.uniform(-50, 50, (10, 3)),
    )  # fmt: skip


def off(folder, start, law, steps):
    """Largest distance of the same sphere in both programs, in the smallest diameter."""
    a, b = own(start, law, steps, steps // 20), theirs(folder, start, law, steps, steps // 20)
    assert a.shape == b.shape == (21, len(start[1]), 9)
    assert np.linalg.norm(a[-1, :, 6:] - start[3], axis=1).min() > 2.0  # friction turns them all
    return abs(a - b)[:, :, :3].max() / (2.0 * start[1].min()), a


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("gap", [1e-4, -1e-5], ids=["apart", "touching"])
def test_two_spheres_go_the_same_way(tmp_path, law, gap):
    assert off(tmp_path, two(gap), law, 4_000)[0] < 1e-6


@pytest.mark.parametrize("law", LAWS)
def test_ten_spheres_that_meet_go_the_same_way(tmp_path, law):
    most, a = off(tmp_path, swarm(), law, 5_000)
    assert most < 1e-6
    assert abs(a[:, :, :3] / EDGE - 0.5).max() < 0.44  # no wall was touched


# Not epsd: see above.
@pytest.mark.parametrize("law", [law for law in LAWS if law != "epsd"])
def test_ten_spheres_in_a_box_go_the_same_way(tmp_path, law):
    most, a = off(tmp_path, ten(), law, 30_000)
    assert most < 1e-6
    assert (a[:, :, 2].min(axis=0) < 2e-3).sum() >= 5  # so many have been at the floor


def test_the_comparison_sees_a_small_difference(tmp_path):
    """A friction that is off by 0.3 % takes the box another way."""
    start = ten()
    LAWS["rougher"] = ("", "", ContactLaw(), Contact(0.7, 0.301))
    try:
        assert off(tmp_path, start, "rougher", 30_000)[0] > 1e-4
    finally:
        del LAWS["rougher"]
