"""Runs the silo in LIGGGHTS and writes its tables: rough_walls.csv and smooth_walls.csv.

Needs ``liggghts`` (Debian package of that name, 3.8.0 used); about eight minutes on one core.
Run: python make_tables.py [folder]
"""

import math
import re
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent
SPHERE = 0.0025  # radius [m]
DENSITY = 2500.0  # [kg/m3]
ROUGH = 0.5  # coefficient of friction between sphere and wall
SEEDS = ((100003, 200003), (100019, 200017), (100043, 200023))
# radius of the silo [m], number of spheres, height to pour from [m]
FILLS = (
    (0.015, 150, 0.07),
    (0.015, 300, 0.12),
    (0.015, 600, 0.22),
    (0.015, 1000, 0.36),
    (0.02, 300, 0.07),
    (0.02, 700, 0.15),
    (0.02, 1300, 0.27),
)


def measure(
    radius: float, count: int, top: float, friction: float, seeds: tuple[int, int]
) -> tuple[int, float, float]:
    """Spheres, force on the floor [N] and height of the highest point [m] of one settled column."""
    values = {
        "seed": seeds[0],
        "seed2": seeds[1],
        "count": count,
        "friction": friction,
        "radius": radius,
        "top": top,
    }
    words = [word for key, value in values.items() for word in ("-var", key, str(value))]
    with tempfile.TemporaryDirectory() as folder:
        ran = subprocess.run(
            ["liggghts", "-in", str(HERE / "silo.in"), "-log", "none", *words],
            cwd=folder,
            capture_output=True,
            text=True,
            check=True,
        )
    found = re.search(r"^MEASURED (\S+) (\S+) (\S+)$", ran.stdout, re.M)
    if found is None:
        raise RuntimeError(ran.stdout[-2000:])
    return int(float(found[1])), float(found[2]), float(found[3]) + SPHERE


def main(folder: Path) -> None:
    mass = DENSITY * 4.0 / 3.0 * math.pi * SPHERE**3
    for name, friction in (("rough_walls", ROUGH), ("smooth_walls", 0.0)):
        with open(folder / f"{name}.csv", "w") as stream:
            stream.write(
                "silo_diameter [mm],fill_height [mm],fill_mass [g],floor_pressure [Pa],fill,seed\n"
            )
            for number, (radius, count, top) in enumerate(FILLS):
                for seeds in SEEDS:
                    spheres, force, height = measure(radius, count, top, friction, seeds)
                    stream.write(
                        f"{2e3 * radius:g},{1e3 * height:.5g},{1e3 * mass * spheres:.6g},"
                        f"{force / (math.pi * radius**2):.6g},F{number + 1},{seeds[0]}\n"
                    )
                    stream.flush()


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
