"""Source paper 001, on its twin: two frictions from four measures, the optimum of a factorial.

Katterfeld et al.: the parameters are where the isoline bands of shear angle, angle of repose, mass
and mass flow overlap; the full factorial needs 64 runs for it, a surrogate fewer than 23.
"""

import numpy as np

from greybed.calibration import Options, Parameter, Space, Study, Target, calibrate
from greybed.calibration.designs import full_factorial
from greybed.calibration.twins import DrawDownTwin

ERRORS = {"shear_angle": 1.0, "repose_angle": 1.0, "mass": 0.015, "mass_flow": 0.03}
SPACE = Space(
    [
        Parameter(name="friction", low=0.1, high=0.9),
        Parameter(name="rolling_friction", low=0.02, high=0.8),
    ]
)
TRUTH = np.array([0.45, 0.3])  # in the unit square


def exact(u):
    return np.array(list(DrawDownTwin.exact(SPACE.named(u)).values()))


def study(names, runs=15):
    value = dict(zip(ERRORS, exact(TRUTH), strict=True))
    return Study(
        space=SPACE,
        experiments={"draw-down": DrawDownTwin()},
        roles={"draw-down": "calibration"},
        targets=tuple(
            Target(experiment="draw-down", measure=n, value=np.array([value[n]]),
                   sd=np.array([ERRORS[n]])) for n in names
        ),
        options=Options(runs=runs, seed=2),
    )  # fmt: skip


def misfit(u):
    return float((((exact(u) - exact(TRUTH)) / list(ERRORS.values())) ** 2).sum())


def test_fifteen_runs_are_as_good_as_the_factorial():
    twin, grid = DrawDownTwin(), full_factorial(8, 2)
    sums = []
    for k, u in enumerate(grid):
        run = np.array(list(twin.run(SPACE.named(u), k).values()))
        sums.append((((run - exact(TRUTH)) / list(ERRORS.values())) ** 2).sum())
    factorial = misfit(grid[int(np.argmin(sums))])
    found = calibrate(study(ERRORS))
    assert misfit(found.best_point) <= factorial
    # All four together leave a small part of what each leaves alone.
    assert found.overlap.together < 0.35 * min(found.overlap.alone.values())
    assert not found.open_directions


def test_one_measure_leaves_a_line():
    found = calibrate(study(["shear_angle"], runs=10))
    assert len(found.open_directions) == 1
    assert found.p_value is None  # nothing is left to test the fit with
