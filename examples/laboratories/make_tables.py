"""Runs the laboratory in LIGGGHTS and writes its tables.

Needs ``liggghts`` (Debian package of that name, 3.8.0 used); about ten minutes on one core.
Run: python make_tables.py [silo] [impacts] [rolling] [held-out] [--out FOLDER]
``held-out`` makes the experiments of all three that no study reads.
"""

import argparse
import math
import re
import subprocess
import tempfile
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
SEEDS = ((100003, 200003), (100019, 200017), (100043, 200023))
DENSITY = 2500.0  # [kg/m3]

# silo: radius [m], number of spheres, height to pour from [m]
FILLS = (
    (0.015, 150, 0.07),
    (0.015, 300, 0.12),
    (0.015, 600, 0.22),
    (0.015, 1000, 0.36),
    (0.02, 300, 0.07),
    (0.02, 700, 0.15),
    (0.02, 1300, 0.27),
)
SPHERE = 0.0025  # radius [m]
ROUGH = 0.5  # coefficient of friction between sphere and wall

# impact: speeds of approach [m/s], series at each, shots of a series, how far they miss (sd) [m]
SPEEDS = (0.02, 0.035, 0.06, 0.1, 0.17, 0.3, 0.5, 0.8, 1.3, 2.0)
SERIES = 4
SHOTS = 5
MISS = 2.5e-4

# rolling: speeds of the launch [m/s], launches at each, what the launcher scatters (sd), the table
LAUNCHES = (1.5, 2.0, 3.0, 4.0)
TRIES = 5
LAUNCHER = 0.01
FRICTION, ROLLING = 0.42, 0.1

# held out: a narrower silo, filled higher; slower and faster impacts; slower and faster launches
NEW_FILLS = ((0.0125, 700, 0.36), (0.0125, 250, 0.14))
NEW_SPEEDS = (0.01, 4.0)
NEW_LAUNCHES = (1.2, 5.0)


def run(deck: str, **variables: float) -> list[list[float]]:
    """Numbers of every line ``MEASURED`` that a deck prints."""
    words = [word for key, value in variables.items() for word in ("-var", key, str(value))]
    with tempfile.TemporaryDirectory() as folder:
        ran = subprocess.run(
            ["liggghts", "-in", str(HERE / deck), "-log", "none", *words],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
        )
    found = re.findall(r"^MEASURED (.*)$", ran.stdout, re.M)
    if ran.returncode or not found:
        raise RuntimeError(ran.stdout[-2000:])
    return [[float(word) for word in line.split()] for line in found]


def measure_silo(
    radius: float, count: int, top: float, friction: float, seeds: tuple[int, int]
) -> tuple[int, float, float]:
    """Spheres, force on the floor [N] and height [m] of one fill."""
    ((spheres, force, height),) = run(
        "silo/silo.in",
        seed=seeds[0],
        seed2=seeds[1],
        count=count,
        friction=friction,
        radius=radius,
        top=top,
    )
    return int(spheres), force, height


def measure_impact(speed: float, across: float, above: float, viscous: bool) -> float:
    """Speed of parting over speed of approach, along the line of approach [-]."""
    radius, stiffness = 0.002, 1.33e8
    mass = 0.5 * DENSITY * 4.0 / 3.0 * math.pi * radius**3
    # contact of Hertz spheres (Johnson, Contact Mechanics, section 11.4), in 2000 steps
    spring = stiffness * math.sqrt(0.5 * radius)
    contact = 2.94 * (1.25 * mass / spring) ** 0.4 * speed**-0.2
    step = contact / 2000.0
    ((parting,),) = run(
        "impacts/impact.in",
        law=int(viscous),
        speed=speed,
        across=across,
        above=above,
        step=step,
        steps=int((1.4e-4 / speed + 2.0 * contact) / step),
    )
    if parting <= 0.0:
        raise RuntimeError(f"at {speed} m/s the spheres have not parted")
    return parting / speed


def silo_table(path: Path, friction: float, fills: tuple[tuple[float, int, float], ...]) -> None:
    mass = DENSITY * 4.0 / 3.0 * math.pi * SPHERE**3
    with open(path, "w") as stream:
        stream.write(
            "silo_diameter [mm],fill_height [mm],fill_mass [g],floor_pressure [Pa],fill,seed\n"
        )
        for number, (radius, count, top) in enumerate(fills):
            for seeds in SEEDS:
                spheres, force, height = measure_silo(radius, count, top, friction, seeds)
                stream.write(
                    f"{2e3 * radius:g},{1e3 * height:.5g},{1e3 * mass * spheres:.6g},"
                    f"{force / (math.pi * radius**2):.6g},F{number + 1},{seeds[0]}\n"
                )
                stream.flush()


def impact_table(path: Path, viscous: bool, speeds: tuple[float, ...], first: int = 1) -> None:
    with open(path, "w") as stream:
        stream.write("impact_velocity [m/s],restitution,series,seed\n")
        for number, speed in enumerate(speeds):
            for series in range(SERIES):
                seed = 1000 * (number + first) + 10 * series + viscous
                aims = MISS * np.random.default_rng(seed).standard_normal((SHOTS, 2))
                found = [measure_impact(speed, x, y, viscous) for x, y in aims]
                stream.write(f"{speed:g},{np.mean(found):.5f},{series + 1},{seed}\n")
                stream.flush()


def rolling_table(path: Path, rolling: float, speeds: tuple[float, ...], seed: int) -> None:
    rng = np.random.default_rng(seed)
    with open(path, "w") as stream:
        stream.write("speed [m/s],repeat,energy [J]\n")
        for speed in speeds:
            for repeat in range(TRIES):
                true = speed * math.exp(LAUNCHER * rng.standard_normal())
                ((energy,),) = run(
                    "rolling/roll.in", speed=true, friction=FRICTION, rolling=rolling
                )
                stream.write(f"{speed:g},{repeat + 1},{energy:.5g}\n")


def silo(folder: Path) -> None:
    """``silo/rough_walls.csv`` and ``silo/smooth_walls.csv``."""
    silo_table(folder / "silo/rough_walls.csv", ROUGH, FILLS)
    silo_table(folder / "silo/smooth_walls.csv", 0.0, FILLS)


def impacts(folder: Path) -> None:
    """``impacts/viscous_impacts.csv`` and ``impacts/constant_impacts.csv``."""
    impact_table(folder / "impacts/viscous_impacts.csv", True, SPEEDS)
    impact_table(folder / "impacts/constant_impacts.csv", False, SPEEDS)


def rolling(folder: Path) -> None:
    """``rolling/rolling.csv``."""
    rolling_table(folder / "rolling/rolling.csv", ROLLING, LAUNCHES, seed=1)


def held_out(folder: Path) -> None:
    """The experiments that no study reads: ``*_held_out.csv``."""
    rolling_table(folder / "rolling/rolling_held_out.csv", ROLLING, NEW_LAUNCHES, seed=2)
    for name, viscous in (("viscous_impacts", True), ("constant_impacts", False)):
        impact_table(folder / f"impacts/{name}_held_out.csv", viscous, NEW_SPEEDS, first=21)
    silo_table(folder / "silo/rough_walls_held_out.csv", ROUGH, NEW_FILLS)


LABORATORIES = {"silo": silo, "impacts": impacts, "rolling": rolling, "held-out": held_out}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", default=list(LABORATORIES))
    parser.add_argument("--out", type=Path, default=HERE)
    wanted = parser.parse_args()
    for wanted_name in wanted.names:
        LABORATORIES[wanted_name](wanted.out)
