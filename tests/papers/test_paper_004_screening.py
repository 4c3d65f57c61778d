"""Source paper 004, on its twin: fraction, analysis of variance, composite design, optimum.

Six factors of a rotating drum; between particles friction, rolling resistance and surface energy
are active, those to the drum are not. Truth of the twin is the paper's optimum for Inconel 718.
"""

import numpy as np
import pytest

from greybed.calibration import Options, Parameter, Space, Study, Target, calibrate
from greybed.calibration.twins import DrumTwin

RANGES = {
    "friction": (0.2, 0.8), "rolling_friction": (0.0, 0.1), "cohesion": (0.02, 0.3),
    "wall_friction": (0.2, 0.8), "wall_rolling_friction": (0.0, 0.1), "wall_cohesion": (0.02, 0.3),
}  # fmt: skip
ALLOYS = {
    "In718": {"friction": 0.465, "rolling_friction": 1.35e-2, "cohesion": 0.1918},
    "Ti64": {"friction": 0.651, "rolling_friction": 7.26e-2, "cohesion": 0.0557},
}
ERRORS = {"break_energy": 0.5, "rest_energy": 0.5, "avalanche_energy": 0.25, "period": 0.03}


@pytest.mark.parametrize("alloy", ALLOYS)
def test_the_three_active_factors_and_the_optimum(alloy):
    exact = DrumTwin.exact({**ALLOYS[alloy], "wall_friction": 0.5})
    found = calibrate(
        Study(
            space=Space([Parameter(name=n, low=a, high=b) for n, (a, b) in RANGES.items()]),
            experiments={"drum": DrumTwin()},
            roles={"drum": "calibration"},
            targets=tuple(
                Target(experiment="drum", measure=n, value=np.array([v]),
                       sd=np.array([ERRORS[n]])) for n, v in exact.items()
            ),
            options=Options(runs=60, strategy="screening", surrogate="quadratic", seed=4),
        )
    )  # fmt: skip
    assert set(found.extra["active"]) == set(ALLOYS[alloy])
    assert found.fits
    # The measures at the optimum are within the experiments' standard deviations.
    at = DrumTwin.exact({**found.best, "wall_friction": 0.5})
    off = {n: (at[n] - exact[n]) / ERRORS[n] for n in ERRORS}
    assert max(map(abs, off.values())) < 1.0
    # The other three stay open, and are said to.
    words = {v.name: v.word for v in found.verdicts}
    assert all(words[n] == "open" for n in RANGES if n.startswith("wall_"))
    assert found.runs <= 40
