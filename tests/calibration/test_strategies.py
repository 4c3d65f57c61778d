"""Strategies: direct searches, one group after another, screening, and the analysis of variance."""

import numpy as np
import pytest

from greybed.calibration import Options, Parameter, Space, Study, Target, calibrate
from greybed.calibration.anova import active_factors, anova
from greybed.calibration.runs import Campaign
from greybed.calibration.search import Search
from greybed.calibration.store import Store
from greybed.calibration.strategies import BY_NAME
from greybed.calibration.strategies.direct import mirrored, misfit_of
from greybed.calibration.twins import DrumTwin
from greybed.core.errors import InputError


def best_misfit(study):
    """Misfit of the best single run that a strategy has made."""
    with Campaign(study.experiments, Store(":memory:"), seed=study.options.seed) as campaign:
        search = Search(study, campaign)
        BY_NAME[study.options.strategy](search)
        return [misfit_of(study, {o[-1].experiment: o[-1].results}) for _, o in campaign.finished]


@pytest.mark.parametrize("strategy", ["direct-cma", "direct-bayes"])
def test_direct_searches_come_down(make_study, strategy):
    study = make_study(runs=42, strategy=strategy, noise=False)
    rows = best_misfit(study)
    assert len(rows) <= 42
    # Scatter of replicates alone gives a misfit of about 0.6 (their variance over that of the
    # data); random points of the ranges have a median above 20.
    assert min(rows) < 1.5
    assert np.median(rows[-10:]) < np.median(rows[:10])


def test_points_outside_are_mirrored():
    np.testing.assert_allclose(mirrored(np.array([-0.2, 0.4, 1.3, 2.1])), [0.2, 0.4, 0.7, 0.1])


def test_the_misfit_of_a_failed_run_is_infinite(make_study):
    assert misfit_of(make_study(), {"draw-down": None}) == np.inf


def test_groups_come_one_after_another(make_study):
    study = make_study(runs=30)
    parameters = [
        Parameter(name="friction", low=0.1, high=0.9, group=1),
        Parameter(name="rolling_friction", low=0.02, high=0.8, group=2),
    ]
    staged = Study(
        space=Space(parameters), experiments=study.experiments, roles=study.roles,
        targets=study.targets, options=Options(runs=30, strategy="sequential"),
    )  # fmt: skip
    found = calibrate(staged)
    assert [note[:8] for note in found.notes[:2]] == ["Group 1:", "Group 2:"]
    truth = staged.space.unit([[0.45, 0.25]])
    assert found.model.log_posterior(truth)[0] > found.posterior.level(0.999)
    assert found.runs == 30


def test_anova_of_an_orthogonal_design_adds_up():
    rng = np.random.default_rng(0)
    z = np.array([[a, b, c] for a in (0, 1) for b in (0, 1) for c in (0, 1)], float)
    y = 3.0 + 2.0 * z[:, 0] - 1.0 * z[:, 1] + 0.1 * rng.standard_normal(8)
    rows = anova(z, y, "abc")
    assert [r.source for r in rows] == ["a", "b", "c", "residual"]
    total = ((y - y.mean()) ** 2).sum()
    assert sum(r.squares for r in rows) == pytest.approx(total)
    # The effect of a factor is the difference of the means at its two levels.
    assert rows[0].effect == pytest.approx(y[z[:, 0] == 1].mean() - y[z[:, 0] == 0].mean())
    # F of one factor is the square of Student's t of its slope.
    from scipy import stats

    terms = np.column_stack([np.ones(8), z])
    beta, left, *_ = np.linalg.lstsq(terms, y, rcond=None)
    sd = np.sqrt(left[0] / 4 * np.linalg.inv(terms.T @ terms)[1, 1])
    assert rows[0].f == pytest.approx((beta[1] / sd) ** 2)
    assert rows[0].p == pytest.approx(2 * stats.t.sf(abs(beta[1] / sd), 4))
    assert active_factors([rows]) == (0, 1)


def drum_study(runs=60, **options):
    ranges = {
        "friction": (0.2, 0.8), "rolling_friction": (0.0, 0.1), "cohesion": (0.02, 0.3),
        "wall_friction": (0.2, 0.8), "wall_rolling_friction": (0.0, 0.1),
        "wall_cohesion": (0.02, 0.3),
    }  # fmt: skip
    space = Space([Parameter(name=n, low=a, high=b) for n, (a, b) in ranges.items()])
    exact = DrumTwin.exact(
        {"friction": 0.465, "rolling_friction": 0.0135, "cohesion": 0.1918, "wall_friction": 0.5}
    )
    errors = {"break_energy": 0.4, "rest_energy": 0.4, "avalanche_energy": 0.2, "period": 0.02}
    return Study(
        space=space,
        experiments={"drum": DrumTwin()},
        roles={"drum": "calibration"},
        targets=tuple(
            Target(experiment="drum", measure=n, value=np.array([v]), sd=np.array([errors[n]]))
            for n, v in exact.items()
        ),
        options=Options(runs=runs, strategy="screening", surrogate="quadratic", **options),
    )


def test_screening_finds_the_active_factors():
    found = calibrate(drum_study())
    assert set(found.extra["active"]) == {"friction", "rolling_friction", "cohesion"}
    words = {v.name: v.word for v in found.verdicts}
    assert words["wall_cohesion"] == "open"
    assert words["cohesion"] == "determined"


def test_screening_refuses_too_few_runs():
    with pytest.raises(InputError, match="a two-level design of 6 parameters needs 19"):
        calibrate(drum_study(runs=10))
