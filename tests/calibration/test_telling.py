"""What is told: directions, verdicts, information, sensitivities, curves, the store."""

import numpy as np
import pytest

from greybed.calibration import Experiment, Options, Parameter, Space, Study, Target
from greybed.calibration.advice import next_tests, transfers
from greybed.calibration.experiment import Measure, named
from greybed.calibration.identify import directions, effective_number, in_words, verdicts
from greybed.calibration.isolines import bands, overlap
from greybed.calibration.metamodel import Metamodel
from greybed.calibration.posterior import sample_posterior
from greybed.calibration.responses import response_of
from greybed.calibration.runs import Job, seed_of
from greybed.calibration.sensitivity import pearson, sobol_indices
from greybed.calibration.store import Outcome, Store, run_key

SPACE = Space([Parameter(name=n, low=0.0, high=1.0) for n in "abc"])


class Linear(Experiment):
    """Measures that are linear in a, b, c."""

    takes = ("a", "b", "c")

    def __init__(self, name, **weights):
        self.name, self.weights = name, weights
        self.measures = named(*(Measure(name=n) for n in weights))

    def identity(self):
        return ["linear", self.weights]

    def run(self, values, seed):
        return {
            n: float(sum(w * values[k] for w, k in zip(ws, "abc", strict=True)))
            for n, ws in self.weights.items()
        }


def linear_model(sd=0.02):
    """y = a + b is measured; a candidate tells c, another once more a + b, a process wants c."""
    experiments = {
        "sum": Linear("sum", y=(1.0, 1.0, 0.0)),
        "third": Linear("third", y=(0.0, 0.0, 1.0)),
        "same": Linear("same", y=(1.0, 1.0, 0.0)),
        "silo": Linear("silo", flow=(0.0, 0.0, 2.0)),
        "chute": Linear("chute", speed=(2.0, 2.0, 0.0)),
    }
    study = Study(
        space=SPACE,
        experiments=experiments,
        roles={"sum": "calibration", "third": "candidate", "same": "candidate",
               "silo": "process", "chute": "process"},
        targets=(Target(experiment="sum", measure="y", value=np.array([1.0]),
                        sd=np.array([sd])),),
        planned={"third.y": 0.1, "same.y": sd},
        options=Options(runs=40),
    )  # fmt: skip
    points = SPACE.draw(32, 1)
    runs = []
    for name, experiment in experiments.items():
        for u in points:
            values = SPACE.named(u)
            runs.append(
                (Job(name, tuple(values.items())), [Outcome(name, values, 1,
                                                            experiment.run(values, 1))])
            )  # fmt: skip
    return Metamodel(study, runs)


@pytest.fixture(scope="module")
def linear():
    model = linear_model()
    return model, sample_posterior(model.log_posterior, SPACE, seed=1)


def test_directions_of_a_linear_measure(linear):
    model, _ = linear
    found = directions(model, np.full(3, 0.5))
    # J = (1, 1, 0) / sqrt(12) in prior sds over sd 0.02: information 2 / 12 / 0.02^2.
    assert found[0].information == pytest.approx(2.0 / 12.0 / 0.02**2, rel=0.02)
    np.testing.assert_allclose(np.abs(found[0].weights[:2]), np.sqrt(0.5), atol=0.01)
    assert found[0].determined
    assert [d.determined for d in found[1:]] == [False, False]
    # The open ones in as few parameters as possible: a - b, and c alone.
    assert {d.words for d in found[1:]} <= {"a − b", "b − a", "c"}
    assert effective_number(found) == pytest.approx(1.0, abs=0.01)


def test_directions_in_words():
    assert in_words(np.array([0.8, -0.5, 0.02]), ["a", "b", "c"]) == "a − 0.6 b"
    assert in_words(np.array([0.0, 1.0]), ["a", "b"]) == "b"


def test_verdicts_of_a_sum(linear):
    model, posterior = linear
    words = {v.name: v for v in verdicts(model, posterior)}
    assert words["c"].word == "open"
    # a given a + b = 1 is uniform: as wide as before.
    assert words["a"].word == "open"
    assert words["a"].shrink == pytest.approx(1.0, abs=0.05)


def test_one_sided_and_determined_parameters():
    class Known(Metamodel):
        def __init__(self):
            self.space, self.study = SPACE, linear_model().study

    def density(u):
        inside = ((u >= 0) & (u <= 1)).all(axis=1)
        # a is 0.5 +- 0.03, b is anywhere below 0.6, c is free.
        value = -0.5 * ((u[:, 0] - 0.5) / 0.03) ** 2 - np.where(u[:, 1] > 0.6, 50.0, 0.0)
        return np.where(inside, value, -np.inf)

    found = sample_posterior(density, SPACE, seed=2)
    words = [v.word for v in verdicts(Known(), found)]
    assert words == ["determined", "one-sided", "open"]
    assert "b is below 0.5" in verdicts(Known(), found)[1].sentence


def test_information_is_that_of_a_linear_model(linear):
    model, posterior = linear
    tests = {t.name: t for t in next_tests(model, posterior)}
    # c is uniform, variance 1/12, error 0.1: 1/2 log(1 + (1/12) / 0.01).
    assert tests["third"].information == pytest.approx(0.5 * np.log(1 + 1 / 12 / 0.01), rel=0.06)
    # a + b is known to 0.02 and would be measured to 0.02 again: 1/2 log 2.
    assert tests["same"].information == pytest.approx(0.5 * np.log(2.0), rel=0.12)
    assert next_tests(model, posterior)[0].name == "third"
    assert tests["third"].left[2] == pytest.approx(0.1 / np.sqrt(0.1**2 + 1 / 12), rel=0.1)


def test_transfer_knows_what_a_process_asks_for(linear):
    model, posterior = linear
    found = {
        t.label: t
        for t in transfers(model, posterior, np.full(3, 0.5), directions(model, np.full(3, 0.5)), 1)
    }
    silo, chute = found["silo.flow"], found["chute.speed"]
    assert silo.covered < 0.01
    assert silo.cosine["sum.y"] < 0.1
    assert chute.covered > 0.99
    assert chute.cosine["sum.y"] > 0.99
    assert chute.interval[2] - chute.interval[0] == pytest.approx(2 * 1.645 * 0.04, rel=0.2)
    assert silo.interval[2] - silo.interval[0] > 1.6  # 90 % of 0 to 2


def test_sensitivities_of_a_sum(linear):
    model, _ = linear
    emulator = model.emulators[0]
    first, total = sobol_indices(emulator, SPACE, seed=1)
    np.testing.assert_allclose(first, [0.5, 0.5, 0.0], atol=0.02)
    np.testing.assert_allclose(total, [0.5, 0.5, 0.0], atol=0.02)
    np.testing.assert_allclose(pearson(emulator), [np.sqrt(0.5), np.sqrt(0.5), 0.0], atol=0.1)


def test_bands_and_their_share(linear):
    model, _ = linear
    made = bands(model, np.full(3, 0.5), (0, 1))
    pulls = made.pulls["sum.y"]
    x, y = np.meshgrid(made.x, made.y)
    np.testing.assert_allclose(pulls, np.abs(x + y - 1.0) / 0.02, rtol=0.1, atol=0.1)
    # Of the square, |a + b - 1| < 0.04 is 2 * 0.04 - 0.04^2.
    assert overlap(model).together == pytest.approx(0.0784, abs=0.006)


TIMES = np.linspace(0.0, 1.0, 21)


def curve(a, b):
    return [TIMES.tolist(), (a * TIMES + b * TIMES**2).tolist()]


def test_a_curve_becomes_as_many_numbers_as_it_has_shapes():
    target = Target(
        experiment="drop", measure="front", at=TIMES, value=0.5 * TIMES + 0.2 * TIMES**2,
        sd=np.full(21, 0.02),
    )  # fmt: skip
    rng = np.random.default_rng(0)
    runs = [curve(*rng.random(2)) for _ in range(20)]
    made = response_of(target, runs)
    assert len(made.value) <= 2
    np.testing.assert_allclose(made.numbers(curve(0.5, 0.2)), 0.0, atol=1e-9)
    assert made.rmse(curve(0.6, 0.2)) == pytest.approx(0.1 * np.sqrt(np.mean(TIMES**2)))
    # Shapes span nearly all of what moves, so that distances are kept.
    off = made.numbers(curve(0.9, 0.1))
    whole = ((np.array(curve(0.9, 0.1)[1]) - target.value) / 0.02) ** 2
    assert (off**2).sum() == pytest.approx(whole.sum(), rel=0.02)
    assert made.outside < 3.0 * made.outside_freedom
    np.testing.assert_allclose(made.covariance, np.eye(len(made.value)), atol=1e-9)


def test_what_no_run_reaches_of_a_curve_is_misfit():
    bump = np.where(np.abs(TIMES - 0.5) < 0.03, 0.5, 0.0)
    target = Target(
        experiment="drop", measure="front", at=TIMES, value=0.5 * TIMES + bump,
        sd=np.full(21, 0.02),
    )  # fmt: skip
    rng = np.random.default_rng(0)
    made = response_of(target, [curve(*rng.random(2)) for _ in range(20)])
    assert made.outside > 100.0


def test_errors_that_are_alike_along_a_curve_count_less():
    target = Target(
        experiment="drop", measure="front", at=TIMES, value=TIMES, sd=np.full(21, 0.02),
        correlation=10.0,
    )  # fmt: skip
    rng = np.random.default_rng(0)
    made = response_of(target, [[TIMES.tolist(), (TIMES + v).tolist()] for v in rng.random(9)])
    # Fully alike errors of m values: the mean is no better known than one value.
    assert made.covariance[0, 0] == pytest.approx(21.0, rel=0.1)


def test_the_store_keeps_runs_by_all_that_decides_them(tmp_path):
    store = Store(tmp_path / "runs.sqlite")
    experiment = Linear("sum", y=(1.0, 1.0, 0.0))
    values = {"a": 0.1, "b": 0.2, "c": 0.3}
    key = run_key(experiment, values, 7)
    outcome = Outcome("sum", values, 7, {"y": 0.3, "z": [[0.0, 1.0], [2.0, 3.0]]}, "", 1.5)
    store.put(key, outcome)
    store.close()
    again = Store(tmp_path / "runs.sqlite")
    assert again.get(key) == outcome
    assert len(again) == 1
    others = [
        run_key(experiment, {**values, "a": 0.1000001}, 7),
        run_key(experiment, values, 8),
        run_key(Linear("sum", y=(1.0, 1.1, 0.0)), values, 7),
    ]
    assert len({key, *others}) == 4
    assert all(again.get(other) is None for other in others)
    # A parameter that the experiment does not take changes nothing.
    assert run_key(experiment, {**values, "other": 1.0}, 7) == key


def test_seeds_of_replicates_differ_and_stay():
    job = Job("sum", (("a", 0.1),), 0)
    seeds = {seed_of(1, job), seed_of(2, job), seed_of(1, job, 1),
             seed_of(1, Job("sum", (("a", 0.1),), 1))}  # fmt: skip
    assert len(seeds) == 4
    assert seed_of(1, job) == seed_of(1, Job("sum", (("a", 0.1),), 0))
