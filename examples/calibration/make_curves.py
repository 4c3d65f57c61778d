"""Curves of the study drop_twin.toml: means of ten repeats of the twin of a drop test, with errors.

python examples/calibration/make_curves.py
"""

from pathlib import Path

import numpy as np

from greybed.calibration.twins import BEANS, DropTwin

TRUTH = dict(zip(BEANS, (0.5, 0.4, 0.3, 0.35, 0.5, 0.5, 0.2), strict=True))
rng = np.random.default_rng(17)
repeats = [DropTwin().curves(TRUTH, rng.standard_normal(4)) for _ in range(10)]
for name in ("front", "tail"):
    rows = np.array([curves[name] for curves in repeats])
    error = np.maximum(rows.std(axis=0, ddof=1) / np.sqrt(10), 2e-3)
    table = np.column_stack([DropTwin.times, rows.mean(axis=0), error])
    with open(Path(__file__).parent / f"drop_{name}.csv", "w") as stream:
        stream.write("at [s],value [m],sd [m]\n")
        np.savetxt(stream, table, delimiter=",", fmt="%.6g")
