"""Makes measured.csv and clean.csv: discharge of the silo with rolling resistance, and without.

Each reading is a run of its own with other places at the start, and 1 % of noise of the scale. The
study that reads the tables knows of no rolling resistance. Run in this folder: python make_table.py
"""

from pathlib import Path
from tempfile import gettempdir

import numpy as np

from greybed.core.config import read_toml
from greybed.residual.models.particle_runner import ParticleRunner

HERE = Path(__file__).parent
ORIFICES = (13e-3, 15e-3, 17e-3)  # radii [m]
REPEATS = 4
ROLLING = 0.3
NOISE = 0.01


def main() -> None:
    runner = ParticleRunner(HERE / "silo.toml", "", Path(gettempdir()))
    generator = np.random.default_rng(30)
    for file, rolling in (("measured.csv", ROLLING), ("clean.csv", 0.0)):
        lines = ["orifice_radius [mm],repeat,discharge [g/s]"]
        for radius in ORIFICES:
            for repeat in range(REPEATS):
                case = read_toml(HERE / "silo.toml")
                case["wall"][1]["radius"] = radius
                case["seed"] = 100 + repeat + (50 if rolling else 0)
                if rolling:
                    runner.switches()["rolling-resistance"].apply(case, rolling)
                rate = runner.simulate(case)["sinks"]["below"]["mass_kg_per_s"]
                rate *= np.exp(NOISE * generator.standard_normal())
                lines.append(f"{1e3 * radius:g},{repeat + 1},{1e3 * rate:.5g}")
        (HERE / file).write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
