"""Particles: steps per second against LIGGGHTS (Debian's package), one core each, in turn.

python benchmarks/dem.py                 20,000 spheres at rest in a box
python benchmarks/dem.py --settling      the same from the loose start, falling
python benchmarks/dem.py --epsd          EPSD rolling resistance and SJKR cohesion in both
python benchmarks/dem.py --threads 2     two threads against mpirun -np 2
python benchmarks/dem.py --large         200,000 spheres against 20,000, ours; LIGGGHTS' beside
python benchmarks/dem.py --memory        bytes per particle at 200,000 spheres, both

Both get the same spheres with all digits, the same laws (Hertz, tangential history, friction) and
the same number of steps; forces, list building and integration are all in the clock, reading and
compiling are not. LIGGGHTS tells its loop time itself; of several skins its fastest is taken, ours
is the default. Debian's package runs EPSD unoptimised, and warns of it. After the steps kinetic
energies must agree to 2 % and contacts to 1 %. The settled bed is made once and kept in --work. The
last line is the median of the ratios of the pairs.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from greybed.core.walls import Plane
from greybed.dem import Contact, ContactLaw, Material, Simulation, SolidWall

RADIUS, STEP = 2e-3, 1e-5
WIDE, HIGH = 0.1, 0.3
SPHERES, SETTLE = 20_000, 30_000
TILES = (5, 2)  # beds beside each other: 200,000 spheres
GLASS = Material(2500.0, 5e6, 0.45, "glass")
SKINS = (0.05, 0.1, 0.25, 0.5)  # of LIGGGHTS, in radii
PLAIN = "hertz tangential history"
RICH = f"{PLAIN} cohesion sjkr rolling_friction epsd"
# Falling spheres are chaotic: a start off by 1e-13 m changes the energy by 0.2 %, and another skin
# of LIGGGHTS by up to 1 %.
SAME_ENERGY, SAME_CONTACTS = 0.02, 0.01


@dataclass
class State:
    """Spheres in a box from the origin."""

    centres: np.ndarray
    velocities: np.ndarray
    spins: np.ndarray
    edges: tuple[float, float, float] = (WIDE, WIDE, HIGH)


@dataclass
class Run:
    """Million sphere steps per second, kinetic energy [J], contacts, memory [B]."""

    rate: float
    kinetic: float
    contacts: int
    memory: float


def loose() -> State:
    """A jittered lattice that falls."""
    rng = np.random.default_rng(0)
    grid = np.stack(np.meshgrid(*map(np.arange, (22, 22, 42)), indexing="ij"), -1).reshape(-1, 3)
    grid = grid[np.argsort(grid[:, 2], kind="stable")][:SPHERES]
    centres = 4.5e-3 * grid + 2.5e-3 + rng.uniform(-2e-4, 2e-4, grid.shape)
    return State(centres, np.tile([0.0, 0.0, -0.5], (SPHERES, 1)), np.zeros((SPHERES, 3)))


def settled(work: Path) -> State:
    """The loose start after 0.3 s, from the work folder if it is there."""
    path = work / f"settled_{SPHERES}_{SETTLE}.npz"
    if not path.exists():
        print(f"settling {SPHERES} spheres once, kept in {path}", flush=True)
        sim = ours(loose(), False, len(os.sched_getaffinity(0)))
        sim.run(SETTLE)
        work.mkdir(parents=True, exist_ok=True)
        np.savez(path, c=sim.centres, v=sim.velocities, w=sim.spins)
    stored = np.load(path)
    return State(stored["c"], stored["v"], stored["w"])


def tiled(bed: State) -> State:
    """Ten beds beside each other in one box."""
    shifts = [np.array([i * WIDE, j * WIDE, 0.0]) for i in range(TILES[0]) for j in range(TILES[1])]
    n = len(shifts)
    return State(
        np.concatenate([bed.centres + shift for shift in shifts]),
        np.tile(bed.velocities, (n, 1)), np.tile(bed.spins, (n, 1)),
        (TILES[0] * WIDE, TILES[1] * WIDE, HIGH),
    )  # fmt: skip


def ours(state: State, rich: bool, threads: int) -> Simulation:
    """The simulation, before its first step."""
    planes = [
        Plane([side * edge if k == axis else 0.0 for k in range(3)],
              [(1.0 - 2.0 * side) * (k == axis) for k in range(3)])
        for axis, edge in enumerate(state.edges) for side in (0, 1)
    ]  # fmt: skip
    contact = Contact(0.5, 0.5)
    law = ContactLaw()
    if rich:
        contact = Contact(0.5, 0.5, rolling_friction=0.1, rolling_damping=0.3, cohesion=1000.0)
        law = ContactLaw(rolling="epsd", cohesion="sjkr")
    return Simulation(
        state.centres, RADIUS, GLASS, contact, law=law, walls=[SolidWall(p) for p in planes],
        time_step=STEP, velocities=state.velocities, spins=state.spins, threads=threads,
        most_overlap=1.0,
    )  # fmt: skip


def greybed(state: State, options: argparse.Namespace, steps: int) -> Run:
    """Steps after a warm-up, timed."""
    sim = ours(state, options.epsd, options.threads)
    sim.run(options.warm)
    begin = time.perf_counter()
    sim.run(steps)
    seconds = time.perf_counter() - begin
    n = len(state.centres)
    return Run(
        1e-6 * n * steps / seconds, sim.energies.kinetic, len(sim.contacts), sim.bytes_per_particle
    )


def write_data(state: State, path: Path) -> None:
    """The spheres as LIGGGHTS reads them."""
    n, edges = len(state.centres), state.edges
    sides = "".join(f"0 {e:g} {a}lo {a}hi\n" for e, a in zip(edges, "xyz", strict=True))
    with open(path, "w") as out:
        out.write(f"bed\n\n{n} atoms\n1 atom types\n{sides}\nAtoms\n\n")
        for k, p in enumerate(state.centres.tolist(), 1):
            out.write(f"{k} 1 {2 * RADIUS!r} 2500 {p[0]!r} {p[1]!r} {p[2]!r}\n")
        out.write("\nVelocities\n\n")
        table = np.hstack([state.velocities, state.spins]).tolist()
        for k, row in enumerate(table, 1):
            out.write(f"{k} " + " ".join(map(repr, row)) + "\n")


def deck(state: State, options: argparse.Namespace, skin: float, steps: int) -> str:
    """LIGGGHTS' input."""
    model = RICH if options.epsd else PLAIN
    # Cohesion acts on friction here always, there only if told.
    settings = "tangential_reduce on" if options.epsd else ""
    walls = "\n".join(
        f"fix w{axis}{side} all wall/gran model {model} primitive type 1 {axis}plane {side * e:g} "
        f"{settings}"
        for axis, e in zip("xyz", state.edges, strict=True)
        for side in (0, 1)
    )
    # The bed fills a third of the height: to cut it across is best.
    cut = f"processors {options.threads} 1 1\n" if options.threads > 1 else ""
    return f"""atom_style granular
atom_modify map array
boundary f f f
newton off
communicate single vel yes
units si
{cut}read_data data
neighbor {skin * RADIUS:g} bin
neigh_modify delay 0
fix m1 all property/global youngsModulus peratomtype 5.e6
fix m2 all property/global poissonsRatio peratomtype 0.45
fix m3 all property/global coefficientRestitution peratomtypepair 1 0.5
fix m4 all property/global coefficientFriction peratomtypepair 1 0.5
fix m5 all property/global coefficientRollingFriction peratomtypepair 1 0.1
fix m6 all property/global coefficientRollingViscousDamping peratomtypepair 1 0.3
fix m7 all property/global cohesionEnergyDensity peratomtypepair 1 1000
pair_style gran model {model} {settings}
pair_coeff * *
timestep {STEP:g}
fix gravi all gravity 9.81 vector 0.0 0.0 -1.0
{walls}
fix integr all nve/sphere
compute touching all contact/atom
compute ends all reduce sum c_touching
thermo_style custom step atoms ke c_ends cpu
thermo 1000000
thermo_modify lost error norm no format float %.10g
run {options.warm}
run {steps}
"""


def liggghts(state: State, options: argparse.Namespace, skin: float, steps: int) -> Run:
    """Steps after a warm-up, by LIGGGHTS' own loop time; memory is the peak of the process."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_data(state, folder / "data")
        (folder / "in").write_text(deck(state, options, skin, steps))
        command = ["liggghts", "-in", "in", "-echo", "none"]
        if options.threads > 1:
            command = ["mpirun", "--bind-to", "none", "-np", str(options.threads), *command]
        allow = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"}
        with open(folder / "out", "w") as out:
            child = subprocess.Popen(
                command, cwd=folder, stdout=out, stderr=subprocess.STDOUT,
                env={**os.environ, **allow, "OMP_NUM_THREADS": "1"},
            )  # fmt: skip
            _, status, usage = os.wait4(child.pid, 0)
            child.returncode = os.waitstatus_to_exitcode(status)
        text = (folder / "out").read_text()
    found = re.findall(r"^(.+)\nLoop time of (\S+) on", text, re.M)
    if child.returncode or len(found) != 2:
        raise SystemExit(f"LIGGGHTS has failed:\n{text[-2000:]}")
    last, seconds = found[1]
    _, atoms, kinetic, ends, _ = map(float, last.split())
    return Run(
        1e-6 * atoms * steps / float(seconds), kinetic, round(ends / 2), 1024.0 * usage.ru_maxrss
    )


def compare(state: State, options: argparse.Namespace) -> int:
    """Both in turn; returns the exit code."""
    n, steps = len(state.centres), options.steps
    short = argparse.Namespace(**{**vars(options), "warm": 100})
    greybed(state, short, 10)  # compiles
    trials = {skin: liggghts(state, options, skin, steps).rate for skin in SKINS}
    best = max(trials, key=trials.__getitem__)
    shown = ", ".join(f"{skin:g} r {rate:.2f}" for skin, rate in trials.items())
    print(f"LIGGGHTS by its skin [M sphere steps/s]: {shown}")
    ours, theirs = [], []
    for pair in range(options.pairs):
        ours.append(greybed(state, options, steps))
        theirs.append(liggghts(state, options, best, steps))
        a, b = ours[-1], theirs[-1]
        print(
            f"pair {pair + 1}: greybed {a.rate:.2f}, LIGGGHTS {b.rate:.2f} M/s; kinetic energies "
            f"{a.kinetic:.6g} and {b.kinetic:.6g} J, contacts {a.contacts} and {b.contacts}",
            flush=True,
        )
    ratio = statistics.median(a.rate / b.rate for a, b in zip(ours, theirs, strict=True))
    same = (
        abs(a.kinetic / b.kinetic - 1.0) < SAME_ENERGY
        and abs(a.contacts / b.contacts - 1.0) < SAME_CONTACTS
    )
    print(
        f"{n} spheres, {steps} steps, {options.threads} thread(s): greybed "
        f"{statistics.median(a.rate for a in ours):.2f}, LIGGGHTS "
        f"{statistics.median(b.rate for b in theirs):.2f} M sphere steps/s (skin {best:g} r)"
    )
    if not same:
        print("energies or contacts differ: not the same work")
        return 1
    print(f"ratio {ratio:.3f}")
    return 0


def large(bed: State, options: argparse.Namespace) -> int:
    """The rate of ten beds over that of one."""
    many = tiled(bed)
    greybed(bed, options, 10)  # compiles
    ratios = []
    for pair in range(options.pairs):
        a, b = greybed(many, options, options.steps // 5), greybed(bed, options, options.steps)
        ratios.append(a.rate / b.rate)
        print(
            f"pair {pair + 1}: {len(many.centres)} spheres {a.rate:.2f}, {SPHERES} "
            f"{b.rate:.2f} M sphere steps/s",
            flush=True,
        )
    if shutil.which("liggghts") is not None:
        a = liggghts(many, options, 0.1, options.steps // 5)
        b = liggghts(bed, options, 0.1, options.steps)
        print(f"LIGGGHTS: {a.rate:.2f} and {b.rate:.2f}, ratio {a.rate / b.rate:.3f}")
    print(f"ratio {statistics.median(ratios):.3f}")
    return 0


def memory(bed: State, options: argparse.Namespace) -> int:
    """What 180,000 more spheres add to the largest resident memory of each process."""
    peaks = []
    for state, flag in ((bed, "small"), (tiled(bed), "large")):
        child = subprocess.run(
            [sys.executable, __file__, "--peak", flag, "--work", options.work],
            capture_output=True, text=True, check=True,
        )  # fmt: skip
        mine, lists = map(float, child.stdout.split()[-2:])
        peaks.append((mine, liggghts(state, options, 0.25, 100).memory, lists))
        print(
            f"{len(state.centres)} spheres: greybed {mine / 2**20:.0f} MiB (state and lists "
            f"{lists:.0f} B each), LIGGGHTS {peaks[-1][1] / 2**20:.0f} MiB",
            flush=True,
        )
    more = len(bed.centres) * (TILES[0] * TILES[1] - 1)
    a, b = ((peaks[1][k] - peaks[0][k]) / more for k in (0, 1))
    print(f"per sphere more, peaks with reading: greybed {a:.0f} B, LIGGGHTS {b:.0f} B")
    print(f"ratio {a / b:.3f}")
    return 0


def main() -> int:
    """Read the options and run what they ask for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--settling", action="store_true")
    parser.add_argument("--epsd", action="store_true")
    parser.add_argument("--large", action="store_true")
    parser.add_argument("--memory", action="store_true")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--pairs", type=int, default=5, help="runs of each, in turn (default 5)")
    parser.add_argument("--steps", type=int, default=2000, help="in the clock (default 2000)")
    parser.add_argument("--warm", type=int, default=500, help="before the clock (default 500)")
    parser.add_argument("--work", default="runs/dem", help="folder of the settled bed")
    parser.add_argument("--peak", choices=("small", "large"), help=argparse.SUPPRESS)
    options = parser.parse_args()
    bed = loose() if options.settling else settled(Path(options.work))
    if options.peak:
        run = greybed(tiled(bed) if options.peak == "large" else bed, options, 100)
        print(1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, run.memory)
        return 0
    cores = sorted(os.sched_getaffinity(0))[-options.threads :]
    os.sched_setaffinity(0, cores)
    if options.large:
        return large(bed, options)
    if shutil.which("liggghts") is None:
        print("needs LIGGGHTS (Debian: apt-get install liggghts)")
        return 2
    return memory(bed, options) if options.memory else compare(bed, options)


if __name__ == "__main__":
    sys.exit(main())
