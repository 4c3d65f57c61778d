"""Source paper 002, on a synthetic twin with seven parameters: which time signal tells what.

Kirsch (2020) calibrates by visible area (a), centre of mass (b), front and tail (c). On the twin
the signals are formulae that follow his table of sensitivities; what is tested is that the method
tells which parameters each target determines, and to which process it carries over.
"""

import numpy as np
import pytest

from greybed.calibration import Options, Parameter, Space, Study, Target, calibrate
from greybed.calibration.experiment import named
from greybed.calibration.twins import BEANS, DropTwin, FunnelTwin

TRUTH = dict(zip(BEANS, (0.5, 0.4, 0.3, 0.35, 0.5, 0.5, 0.2), strict=True))
TARGETS = {"a": ("area",), "b": ("centre",), "c": ("front", "tail")}


class Residence(DropTwin):
    """The filling process: only the time between first and last particle."""

    measures = named(DropTwin.measures["residence"])

    def run(self, values, seed):
        return {"residence": super().run(values, seed)["residence"]}

    def identity(self):
        return "residence"


def measured(name):
    """Mean of ten repeats, as in the paper, and its standard deviation over all of them."""
    rng = np.random.default_rng(17)
    rows = np.array([DropTwin().curves(TRUTH, rng.standard_normal(4))[name] for _ in range(10)])
    return rows.mean(axis=0), np.maximum(rows.std(axis=0, ddof=1) / np.sqrt(10), 2e-3)


def study(names, runs=45):
    targets = []
    for name in names:
        value, sd = measured(name)
        targets.append(
            Target(experiment="drop", measure=name, at=DropTwin.times, value=value, sd=sd,
                   correlation=0.1)
        )  # fmt: skip
    return Study(
        space=Space([Parameter(name=name, low=0.0, high=1.0) for name in BEANS]),
        experiments={"drop": DropTwin(), "filling": Residence("filling"), "funnel": FunnelTwin()},
        roles={"drop": "calibration", "filling": "process", "funnel": "process"},
        targets=tuple(targets),
        options=Options(runs=runs, seed=1, batch=15),
    )


@pytest.fixture(scope="module", params=TARGETS)
def answered(request):
    return request.param, calibrate(study(TARGETS[request.param]))


def test_the_truth_is_in_what_each_target_leaves(answered):
    _, found = answered
    u = found.model.space.of(TRUTH)
    assert found.fits
    assert found.model.log_posterior(u[None])[0] > found.posterior.level(0.999)


def test_signals_determine_a_few_directions_and_say_so(answered):
    _, found = answered
    known = [d for d in found.directions if d.determined]
    assert 1 <= len(known) < 7
    words = {v.name: v.word for v in found.verdicts}
    # No signal of a drop tells the restitution of walls: as in the paper's table 5.
    assert words["wall_restitution"] == "open"


def test_the_strongest_sensitivities_are_those_of_the_table(answered):
    """Table 5: residence time by dynamic friction on walls, discharge by that between grains."""
    target, found = answered
    strongest = {
        label: BEANS[int(np.abs(found.pearson[label]).argmax())] for label in found.pearson
    }
    assert strongest["filling.residence"] == "wall_dynamic_friction"
    assert strongest["funnel.time"] == "dynamic_friction"
    if target == "c":
        assert strongest["drop.tail"] == "wall_dynamic_friction"


def test_front_and_tail_carry_over_to_the_filling(answered):
    target, found = answered
    filling = next(t for t in found.transfers if t.label == "filling.residence")
    if target == "c":
        assert filling.cosine["drop.tail"] > 0.8
        assert filling.covered > 0.7
        low, middle, high = filling.interval
        from greybed.calibration.twins import residence_time

        assert low < residence_time(TRUTH) < high
        assert high - low < 0.5 * (filling.before[1] - filling.before[0])
        assert abs(middle / residence_time(TRUTH) - 1.0) < 0.1
