"""Source paper 003: who lands where, in the rig of two hoppers and in a vessel. See README.md.

    python examples/papers/charging_003.py [--seeds N]

Cases A, B and C are examples/particles/segregation_rig_*.toml with a longer time step. The vessel
is a slice 0.2 m wide that repeats; 60 g of beads of 6 mm and as much of 3 mm fall together at its
centre, or at both walls. Shares of coarse beads are of the outer and the inner third.
"""

import argparse
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from record import HERE, Record

from greybed.calibration.experiments.case import run_case
from greybed.core.config import read_toml

CASES = Path(__file__).parents[1] / "particles"
HALF, DEEP, FROM = 0.1, 0.02, 0.11  # half the width, depth of the slice, height of the fall [m]


def vessel(where, seed):
    """Case of the vessel, charged at its ``centre`` or ``boundary``."""
    grip = {"restitution": 0.4, "friction": 0.5, "rolling_friction": 0.1}
    names = {"coarse": 3e-3, "fine": 1.5e-3}
    material = {"density": 2500.0, "youngs_modulus": 2e6, "poissons_ratio": 0.25}
    spots = [0.0] if where == "centre" else [-HALF + 0.013, HALF - 0.013]
    streams = [
        {"kind": "stream", "material": name, "sizes": f"mono:{radius}m",
         "rate": 0.06 / len(spots), "mass": 0.06 / len(spots),
         "lower": [x - 0.012, 0.0, FROM], "upper": [x + 0.012, DEEP, FROM + 0.03],
         "velocity": [0.0, 0.0, -0.3]}
        for name, radius in names.items() for x in spots
    ]  # fmt: skip
    return {
        "kind": "particles", "duration": 1.4, "time_step": 5e-5, "seed": seed,
        "law": {"rolling": "constant-torque"},
        "material": [{"name": name, **material} for name in names],
        "contact": [{"between": list(pair), **grip} for pair in
                    (("coarse", "coarse"), ("coarse", "fine"), ("fine", "fine"))],
        "periodic": {"lower": [-HALF, 0.0, 0.0], "upper": [HALF, DEEP, 0.2], "axes": "y"},
        "wall": [
            {"name": "floor", "kind": "plane", "normal": [0.0, 0.0, 1.0]},
            {"name": "left", "kind": "plane", "point": [-HALF, 0.0, 0.0],
             "normal": [1.0, 0.0, 0.0]},
            {"name": "right", "kind": "plane", "point": [HALF, 0.0, 0.0],
             "normal": [-1.0, 0.0, 0.0]},
        ],
        "particles": streams,
        "measure": [{"name": "compartments", "kind": "compartments", "axis": "x", "lower": -HALF,
                     "upper": HALF, "count": 12}],
        "output": {"samples": 0.02},
    }  # fmt: skip


def made(record, key, content):
    """A run and its compartments."""
    if key not in record.runs:
        begin = time.process_time()
        results, _ = run_case(content, CASES / "case.toml", lambda _: {})
        found = results["measures"]["compartments"]
        record.runs[key] = {
            "first_share": [None if s[0] is None else round(s[0], 4) for s in found["mass_shares"]],
            "intensity": round(found["intensity_of_segregation"], 4),
            "particles": results["particles"], "cpu_s": round(time.process_time() - begin, 1),
        }  # fmt: skip
        record.save()
    print(key, record.runs[key], flush=True)
    return record.runs[key]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--cases", default="ABC", help="of the rig")
    options = parser.parse_args()
    record = Record("charging_003", "mass share of the first material (left beads, coarse) in 12 "
                    "compartments from left to right")  # fmt: skip
    figure, panels = plt.subplots(1, 2, figsize=(8, 3.2))
    at = np.arange(1, 13)
    for where in ("centre", "boundary"):
        rows = [made(record, f"{where} seed {seed}", vessel(where, seed))
                for seed in range(options.seeds)]  # fmt: skip
        share = np.array([run["first_share"] for run in rows], float).mean(axis=0)
        outer, inner = np.nanmean(share[[0, 1, 10, 11]]), np.nanmean(share[4:8])
        print(f"{where}: share of coarse beads {outer:.3f} at the walls, {inner:.3f} at the centre")
        panels[1].plot(at, share, "o-", label=f"charged at the {where}")
    for case in options.cases:
        content = read_toml(CASES / f"segregation_rig_{case.lower()}.toml")
        run = made(record, f"rig {case}", content | {"time_step": "50 us"})
        panels[0].plot(at, np.array(run["first_share"], float), "o-", label=f"case {case}")
    panels[0].set(xlabel="compartment", ylabel="mass share of the left hopper")
    panels[1].set(xlabel="compartment", ylabel="mass share of coarse beads")
    for panel in panels:
        panel.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(HERE / "charging_003.png", dpi=90)


if __name__ == "__main__":
    main()
