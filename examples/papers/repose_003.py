"""Source paper 003: angle of repose over sliding and rolling friction, reduced. See README.md.

    python examples/papers/repose_003.py [--seeds N]

The paper's nine pairs of friction (0.5, 0.7, 0.9) and rolling friction (0.07, 0.14, 0.21), constant
torque, linear in its direction. Reduced: a lifted cylinder of 400 grains, Hertz' law of 0.5 MPa;
the first and the last pair with 3200 grains of 5 MPa too, for what the size of the heap does.
"""

import argparse

import matplotlib.pyplot as plt
import numpy as np
from record import HERE, Record

from greybed.calibration.experiments import LIBRARY

FRICTION, ROLLING = (0.5, 0.7, 0.9), (0.07, 0.14, 0.21)
LARGE = 3200


def heap_of(count, **changes):
    """A lifted cylinder of so many grains."""
    return LIBRARY["lifting-cylinder"](
        name="heap", count=count, wall_friction=0.7, wall_rolling_friction=0.14,
        rolling_law="constant-torque", **{"time_step": 6e-5, **changes},
    )  # fmt: skip


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=2)
    options = parser.parse_args()
    record = Record("repose_003", "lifting cylinder, angle [deg] and height [m] of the heap")
    for seed in range(options.seeds):
        for friction in FRICTION:
            for rolling in ROLLING:
                values = {"friction": friction, "rolling_friction": rolling}
                record.make(f"{friction} {rolling} seed {seed}", heap_of(400), values, seed)
    for friction, rolling in ((FRICTION[0], ROLLING[0]), (FRICTION[-1], ROLLING[-1])):
        key = f"{LARGE} grains {friction} {rolling}"
        values = {"friction": friction, "rolling_friction": rolling}
        record.make(key, heap_of(LARGE, youngs_modulus=5e6, time_step=2e-5), values, 0)
        print(key, record.runs[key])
    table = np.array([
        [[run["repose_angle"], run["height"]] for key, run in record.runs.items()
         if key.startswith(f"{friction} {rolling} ")]
        for friction in FRICTION for rolling in ROLLING
    ])  # fmt: skip
    angle = table[..., 0].mean(axis=1).reshape(3, 3)
    height = 1e3 * table[..., 1].mean(axis=1).reshape(3, 3)
    figure, panel = plt.subplots(figsize=(4.4, 3.4))
    for k, friction in enumerate(FRICTION):
        print(friction, "angle", np.round(angle[k], 1), "height / mm", np.round(height[k], 2))
        panel.plot(ROLLING, angle[k], "o-", label=f"friction {friction}")
    scatter = table[..., 0].std(axis=1, ddof=1).mean() if options.seeds > 1 else np.nan
    print(f"scatter of single runs {scatter:.1f} deg")
    panel.plot([0.07, 0.21], [33.0, 43.0], "k+", ms=10, label="paper, first and last")
    panel.set(xlabel="rolling friction", ylabel="angle of repose / deg")
    panel.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(HERE / "repose_003.png", dpi=90)


if __name__ == "__main__":
    main()
