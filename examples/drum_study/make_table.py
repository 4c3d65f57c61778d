"""Makes measured.csv and clean.csv: slope in the drum with rolling resistance, and without.

Each reading is a run of its own with other places at the start, and 1 % of noise of the camera. The
study that reads the tables knows of no rolling resistance. Run in this folder: python make_table.py
"""

from pathlib import Path
from tempfile import gettempdir

import numpy as np

from greybed.core.config import read_toml
from greybed.residual.models.particle_runner import ParticleRunner

HERE = Path(__file__).parent
SPEEDS = (15.0, 30.0)  # [rpm]
REPEATS = 6
ROLLING = 0.15
NOISE = 0.01


def main() -> None:
    runner = ParticleRunner(HERE / "drum.toml", "", Path(gettempdir()))
    generator = np.random.default_rng(31)
    for file, rolling in (("measured.csv", ROLLING), ("clean.csv", 0.0)):
        lines = ["speed [rpm],repeat,slope [deg]"]
        for speed in SPEEDS:
            for repeat in range(REPEATS):
                case = read_toml(HERE / "drum.toml")
                case["wall"][0]["spin"][1] = f"{speed} rpm"
                case["seed"] = 100 + repeat + (50 if rolling else 0)
                if rolling:
                    runner.switches()["rolling-resistance"].apply(case, rolling)
                angle = runner.simulate(case)["measures"]["surface"]["mean_angle_deg"]
                angle *= np.exp(NOISE * generator.standard_normal())
                lines.append(f"{speed:g},{repeat + 1},{angle:.4g}")
        (HERE / file).write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
