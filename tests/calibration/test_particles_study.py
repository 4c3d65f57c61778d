"""A whole study over the particle engine, small enough for seconds, against a closed form."""

import math
from pathlib import Path

from greybed.calibration import calibrate
from greybed.calibration.read import read_study

ROOT = Path(__file__).parents[2]


def test_friction_from_the_tilt_at_which_grains_slide(tmp_path):
    study = read_study(ROOT / "examples/calibration/plate.toml")
    found = calibrate(study, tmp_path)
    assert found.fits
    assert found.verdicts[0].word == "determined"
    # Coulomb: tan 25 deg = 0.466. They are seen to slide one or two degrees late at this rate of
    # tilt, so the friction that explains 25 deg is 0.02 to 0.04 lower; the datum's error is 0.02.
    low, high = study.space.values(found.posterior.interval().T)[:, 0]
    assert low < math.tan(math.radians(25.0)) - 0.02 < high + 0.02
    assert abs(found.best["wall_friction"] - 0.44) < 0.05
    # Other runs of the same study come from the store.
    again = calibrate(study, tmp_path)
    assert again.made == 0
    assert again.best == found.best
