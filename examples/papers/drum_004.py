"""Source paper 004: which contact parameters a rotating drum feels, reduced. See README.md.

    python examples/papers/drum_004.py [--seeds N]

A two-level fraction of eight runs (2^(6-3), resolution III) of the paper's six factors between
grains and between grains and drum, in a drum at a Froude number; effects by an analysis of
variance over replicates. Reduced: 150 grains of 4 mm instead of powder, cohesion by the pull-off of
DMT at the same ratio to weight, half a turn instead of 150 avalanches.
"""

import argparse
import math

import numpy as np
from record import Record

from greybed.calibration.experiments import LIBRARY

WEIGHT = 2500.0 * 4.0 / 3.0 * math.pi * 2e-3**3 * 9.81  # of a grain [N]
# Pull-off 4 pi gamma R* over weight: 0.1 ... 2; friction as in the paper's ranges.
GAMMA = [bond * WEIGHT / (4.0 * math.pi * 1e-3) for bond in (0.1, 2.0)]
FACTORS = {
    "friction": (0.3, 0.8), "rolling_friction": (0.01, 0.1), "cohesion": tuple(GAMMA),
    "wall_friction": (0.3, 0.8), "wall_rolling_friction": (0.01, 0.1),
    "wall_cohesion": tuple(GAMMA),
}  # fmt: skip
SIGNS = np.array([[-1 if k >> j & 1 else 1 for j in range(3)] for k in range(8)])
# The last three follow from the first: D = AB, E = AC, F = BC.
DESIGN = np.column_stack(
    [SIGNS, SIGNS[:, 0] * SIGNS[:, 1], SIGNS[:, 0] * SIGNS[:, 2], SIGNS[:, 1] * SIGNS[:, 2]]
)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=2)
    options = parser.parse_args()
    record = Record("drum_004", "angle [deg], break, rest and avalanche energy [J/kg], period [s]")
    drum = LIBRARY["drum"](
        name="drum", count=150, drum=14.0, cohesion_law="dmt", turns=0.35, time_step=1.5e-4
    )
    made = []
    for seed in range(options.seeds):
        for k, row in enumerate(DESIGN):
            values = {n: ends[(s + 1) // 2] for (n, ends), s in zip(FACTORS.items(), row,
                                                                   strict=True)}  # fmt: skip
            made.append((row, record.make(f"run {k} seed {seed}", drum, values, seed)))
    for name in ("angle", "break_energy", "rest_energy"):
        good = [(row, run[name]) for row, run in made if "failed" not in run]
        signs, values = np.array([g[0] for g in good]), np.array([g[1] for g in good])
        columns = np.column_stack([np.ones(len(signs)), signs])
        effect, *_ = np.linalg.lstsq(columns, values, rcond=None)
        free = max(len(values) - 7, 1)
        sd = math.sqrt(((values - columns @ effect) ** 2).sum() / free / len(values))
        words = [f"{n} {e / sd:+.1f}" for n, e in zip(FACTORS, effect[1:], strict=True)]
        print(f"{name}: mean {effect[0]:.4g}; half effects over error:", *words)


if __name__ == "__main__":
    main()
