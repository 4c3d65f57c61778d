"""Source paper 003: the angle of repose over sliding and rolling friction, reduced.

    python examples/calibration/repose_grid.py [--seeds N] [--count N]

Nine pairs of mu (0.5, 0.7, 0.9) and mu_r (0.07, 0.14, 0.21), a lifted cylinder of 400 grains
instead of a large heap; prints the angle and the height of the heap with their errors.
"""

import argparse

import numpy as np

from greybed.calibration.experiments import LIBRARY

parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("--seeds", type=int, default=2)
parser.add_argument("--count", type=int, default=400)
options = parser.parse_args()
heap = LIBRARY["lifting-cylinder"](
    name="heap", count=options.count, wall_friction=0.7, wall_rolling_friction=0.14
)
print("mu    mu_r  angle [deg]   height [mm]")
for friction in (0.5, 0.7, 0.9):
    for rolling in (0.07, 0.14, 0.21):
        values = {"friction": friction, "rolling_friction": rolling}
        runs = [heap.run(values, seed) for seed in range(options.seeds)]
        angle = np.array([run["repose_angle"] for run in runs])
        height = 1e3 * np.array([run["height"] for run in runs])
        root = np.sqrt(len(runs))
        print(
            f"{friction:.2f}  {rolling:.2f}  {angle.mean():5.1f} +- {angle.std(ddof=1) / root:.1f} "
            f"{height.mean():6.2f} +- {height.std(ddof=1) / root:.2f}",
            flush=True,
        )
