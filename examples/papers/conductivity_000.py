"""Source paper 000: conductivity of a stressed bed, with and without cohesion; see README.md.

    python examples/papers/conductivity_000.py [--seeds N]

Spheres of table 1 between a hot floor and a lid at a constant stress; k* = k / Y = 3.1e-3 where
they stick. Reduced: 200 spheres six diameters wide, no gravity from the start on, a time step of
14 % of Rayleigh's (compressed beds need it), heat that is steady within half a second.
"""

import argparse

import matplotlib.pyplot as plt
import numpy as np
from draw_down_000 import TABLE_1
from record import HERE, Record

from greybed.calibration.experiments import LIBRARY

STRESSES = (1e-5, 2e-4, 2e-3)  # over Young's modulus
COHESION = {"no cohesion": 0.0, "cohesion": 3.1e5}  # [J/m3]
CONDUCTIVITY = 4.0  # of the grains; only ratios to it are told [W/m/K]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=1)
    options = parser.parse_args()
    record = Record("conductivity_000", "stress over Young's modulus; conductivities [W/m/K]")
    for seed in range(options.seeds):
        for stress in STRESSES:
            for name, cohesion in COHESION.items():
                box = LIBRARY["heated-box"](
                    name="box", count=200, stress_ratio=stress, conductivity=CONDUCTIVITY,
                    cohesion=cohesion, **TABLE_1 | {"time_step": 1.8e-5},
                )  # fmt: skip
                record.make(f"{name}, {stress:g}, seed {seed}", box, {}, seed)
    figure, axes = plt.subplots(1, 2, figsize=(8, 3.4))
    for name, colour in zip(COHESION, ("black", "firebrick"), strict=True):
        rows = []
        for stress in STRESSES:
            front = f"{name}, {stress:g},"
            runs = [run for key, run in record.runs.items() if key.startswith(front)]
            values = [[r[k] for k in ("solid_fraction", "conductivity", "wall_conductivity")]
                      for r in runs]  # fmt: skip
            fraction, inner, outer = np.mean(values, axis=0)
            rows.append([fraction, inner / CONDUCTIVITY, outer / CONDUCTIVITY])
            print(f"{name:12s} {stress:7.0e}  solid fraction {fraction:.3f}  lambda* "
                  f"{rows[-1][1]:.4f} (gradient inside), {rows[-1][2]:.4f} (walls)")  # fmt: skip
        fraction, inner, outer = np.array(rows).T
        axes[0].semilogx(STRESSES, fraction, "o-", color=colour, label=name)
        axes[1].loglog(STRESSES, inner, "o-", color=colour, label=f"{name}, gradient inside")
        axes[1].loglog(STRESSES, outer, "x--", color=colour, label=f"{name}, walls")
    axes[0].set(xlabel="stress / Y", ylabel="solid fraction")
    axes[1].set(xlabel="stress / Y", ylabel="conductivity / that of the grains")
    for panel in axes:
        panel.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(HERE / "conductivity_000.png", dpi=90)


if __name__ == "__main__":
    main()
