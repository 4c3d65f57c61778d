"""Makes measured.csv: heat from the floor of the bed with radiation on, other rays, and noise.

The study that reads it has radiation switched off. Run in this folder: python make_table.py
"""

from dataclasses import replace
from pathlib import Path

import numpy as np

from greybed.core.readers import read_packing
from greybed.coupling.case import load_case, run_case, view_factors

HERE = Path(__file__).parent
NOISE = 0.02  # relative, of each reading
TEMPERATURES = (500.0, 600.0, 700.0, 800.0, 900.0, 1000.0, 1100.0, 1200.0)  # K
REPEATS = 4


def main() -> None:
    case = load_case(HERE / "bed.toml")
    case = replace(case, radiation=replace(case.radiation, source="traced", rays=5000, seed=77))
    packing = read_packing(case.packing.file, walls=case.walls)
    rows = view_factors(case, packing)
    generator = np.random.default_rng(20)
    with open(HERE / "measured.csv", "w") as stream:
        stream.write("floor_temperature [degC],repeat,heat_flow [W]\n")
        for temperature in TEMPERATURES:
            floor = replace(case.wall[0], temperature=temperature)
            hot = replace(case, wall=(floor, *case.wall[1:]))
            _, result = run_case(hot, packing, rows)
            flow = result.wall_conduction[0] + result.wall_radiation[0]
            for repeat in range(REPEATS):
                read = flow * np.exp(NOISE * generator.standard_normal())
                stream.write(f"{temperature - 273.15:.2f},{repeat + 1},{read:.5g}\n")


if __name__ == "__main__":
    main()
