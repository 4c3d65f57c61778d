"""Small studies on analytic twins."""

import numpy as np
import pytest

from greybed.calibration import Options, Parameter, Space, Study, Target
from greybed.calibration.twins import DrawDownTwin

FRICTIONS = (
    Parameter(name="friction", low=0.1, high=0.9),
    Parameter(name="rolling_friction", low=0.02, high=0.8),
)
ERRORS = {"shear_angle": 1.0, "repose_angle": 1.0, "mass": 0.015, "mass_flow": 0.03}


def draw_down_study(seed=1, truth=(0.45, 0.25), runs=16, twin=None, noise=True, **options):
    """A draw-down box whose truth is known, measured with errors."""
    twin = twin or DrawDownTwin()
    exact = DrawDownTwin.exact(dict(zip(("friction", "rolling_friction"), truth, strict=True)))
    rng = np.random.default_rng([seed, 99])
    targets = tuple(
        Target(
            experiment=twin.name,
            measure=name,
            value=np.array([value + ERRORS[name] * noise * rng.standard_normal()]),
            sd=np.array([ERRORS[name]]),
        )
        for name, value in exact.items()
    )
    return Study(
        space=Space(FRICTIONS),
        experiments={twin.name: twin},
        roles={twin.name: "calibration"},
        targets=targets,
        options=Options(runs=runs, seed=seed, **options),
    )


@pytest.fixture(scope="session")
def make_study():
    return draw_down_study
