"""Calibration on analytic twins: runs, coverage, trade-offs, overhead, surrogates. Prints a table.

    python benchmarks/calibration.py [NAME ...] [--studies N]

Names: factorial, coverage, tradeoff, overhead, grid, seven; all of them by default. The twins are
formulae (greybed/calibration/twins.py), so what is measured is the method, not a simulation.
``coverage`` and ``tradeoff`` tell each study on the error stream, so that a run that is stopped
is not lost; ``--first`` goes on from there.
"""

import argparse
import sys
import time
from dataclasses import replace

import numpy as np

from greybed.calibration import Options, Parameter, Space, Study, Target, calibrate
from greybed.calibration.best import best_point
from greybed.calibration.designs import full_factorial, latin_hypercube
from greybed.calibration.posterior import sample_posterior
from greybed.calibration.responses import response_of
from greybed.calibration.runs import Campaign
from greybed.calibration.search import Search
from greybed.calibration.store import Store
from greybed.calibration.strategies import BY_NAME
from greybed.calibration.surrogates import GaussianProcess, Sample
from greybed.calibration.twins import BEANS, DrawDownTwin, DropTwin, HeapTwin, HopperTwin

FRICTIONS = Space(
    [
        Parameter(name="friction", low=0.1, high=0.9),
        Parameter(name="rolling_friction", low=0.02, high=0.8),
    ]
)
ERRORS = {"shear_angle": 1.0, "repose_angle": 1.0, "mass": 0.015, "mass_flow": 0.03}


def exact(u):
    """Measures of the draw-down twin without scatter, (4,)."""
    return np.array(list(DrawDownTwin.exact(FRICTIONS.named(u)).values()))


def draw_down(seed, truth, runs):
    rng = np.random.default_rng([seed, 99])
    value = exact(truth)
    targets = tuple(
        Target(
            experiment="draw-down", measure=name,
            value=np.array([value[k] + sd * rng.standard_normal()]), sd=np.array([sd]),
        )
        for k, (name, sd) in enumerate(ERRORS.items())
    )  # fmt: skip
    return Study(
        space=FRICTIONS, experiments={"draw-down": DrawDownTwin()},
        roles={"draw-down": "calibration"}, targets=targets,
        options=Options(runs=runs, seed=seed),
    )  # fmt: skip


def misfit(study, u):
    """Exact squared error at a point, in units of the data's errors."""
    data = np.array([t.value[0] for t in study.targets])
    return float((((exact(u) - data) / np.array(list(ERRORS.values()))) ** 2).sum())


class Watched(Search):
    """A search that notes the best set after each fit."""

    def fit(self, *, anew=False):
        model = super().fit(anew=anew)
        best = best_point(model, self.study.options.seed)
        self.trace.append({"runs": self.campaign.spent, "misfit": misfit(self.study, best)})
        return model


def factorial(studies):
    """Runs until the best set is as good as that of 64 runs on a grid."""
    first, settled = [], []
    grid = full_factorial(8, 2)
    for seed in range(studies or 20):
        rng = np.random.default_rng([seed, 3])
        study = draw_down(seed, 0.15 + 0.7 * rng.random(2), 30)
        twin = DrawDownTwin()
        data = np.array([t.value[0] for t in study.targets])
        errors = []
        for k, u in enumerate(grid):
            run = np.array(list(twin.run(FRICTIONS.named(u), 1000 * seed + k).values()))
            errors.append(float((((run - data) / list(ERRORS.values())) ** 2).sum()))
        goal = misfit(study, grid[int(np.argmin(errors))])
        with Campaign(study.experiments, Store(":memory:"), seed=seed) as campaign:
            search = Watched(study, campaign)
            BY_NAME["response-surface"](search)
            search.fit()
        good = [row["misfit"] <= goal for row in search.trace]
        runs = [row["runs"] for row in search.trace]
        first.append(next((r for r, g in zip(runs, good, strict=True) if g), 99))
        bad = [r for r, g in zip(runs, good, strict=True) if not g]
        settled.append(max(bad) + 1 if bad else runs[0])
    print(
        f"factorial  runs to the 64-run factorial's optimum, {len(first)} seeds: median "
        f"{np.median(first):g} (worst {max(first)}), for good from {np.median(settled):g} on "
        f"(median; worst {max(settled)})"
    )


FIRST = 0  # seed of the first study of coverage and tradeoff


def told(*words):
    """One study, as it comes."""
    print(*words, file=sys.stderr, flush=True)


def coverage(studies):
    """Share of studies whose 90 % region holds the truth."""
    region, interval = [], []
    for seed in range(FIRST, FIRST + (studies or 100)):
        truth = np.random.default_rng([seed, 7]).random(2)
        study = draw_down(seed, truth, 16)
        with Campaign(study.experiments, Store(":memory:"), seed=seed) as campaign:
            search = Search(study, campaign)
            BY_NAME["response-surface"](search)
            model = search.fit(anew=True)
        posterior = sample_posterior(model.log_posterior, FRICTIONS, seed)
        density = float(model.log_posterior(truth[None])[0])
        region.append([density >= posterior.level(share) for share in (0.5, 0.9)])
        ends = posterior.interval()
        interval.append((ends[:, 0] <= truth) & (truth <= ends[:, 1]))
        told("coverage", seed, *map(int, region[-1]), *map(int, interval[-1]))
    half, most = np.mean(region, axis=0)
    print(
        f"coverage   {len(region)} studies of 16 runs: the 90 % region holds the truth in "
        f"{100 * most:.0f} %, the 50 % region in {100 * half:.0f} %, 90 % intervals in "
        f"{100 * np.mean(interval):.0f} %"
    )


def tradeoff(studies):
    """One angle of repose, two frictions: one open direction, and the test that ends it."""
    one, named = [], []
    for seed in range(FIRST, FIRST + (studies or 100)):
        truth = 0.15 + 0.7 * np.random.default_rng([seed, 5]).random(2)
        scatter = 0.7 * np.random.default_rng([seed, 6]).standard_normal()
        angle = HeapTwin.exact(FRICTIONS.named(truth)) + scatter
        study = Study(
            space=FRICTIONS,
            experiments={"heap": HeapTwin(), "wider": HeapTwin("wider"), "hopper": HopperTwin()},
            roles={"heap": "calibration", "wider": "candidate", "hopper": "candidate"},
            targets=(Target(experiment="heap", measure="angle", value=np.array([angle]),
                            sd=np.array([0.7])),),
            planned={"wider.angle": 0.7, "hopper.flow": 0.005},
            options=Options(runs=14, seed=seed),
        )  # fmt: skip
        found = calibrate(study)
        one.append(len(found.open_directions) == 1)
        named.append(found.next_tests[0].name == "hopper")
        told("tradeoff", seed, int(one[-1]), int(named[-1]))
    print(
        f"tradeoff   {len(one)} studies of 14 runs: one open direction in {100 * np.mean(one):.0f} "
        f"%, the hopper named as the next test in {100 * np.mean(named):.0f} %"
    )


def beans(runs, seed=1, **options):
    space = Space([Parameter(name=name, low=0.0, high=1.0) for name in BEANS])
    twin, truth = DropTwin(), dict(zip(BEANS, (0.5, 0.4, 0.3, 0.35, 0.5, 0.5, 0.2), strict=True))
    rng = np.random.default_rng([seed, 17])
    many = [twin.curves(truth, rng.standard_normal(4)) for _ in range(10)]
    targets = []
    for name in ("area", "centre", "front", "tail"):
        rows = np.array([curves[name] for curves in many])
        targets.append(
            Target(
                experiment="drop", measure=name, at=twin.times, value=rows.mean(axis=0),
                sd=np.maximum(rows.std(axis=0, ddof=1), 2e-3), correlation=0.1,
            )
        )  # fmt: skip
    return Study(
        space=space, experiments={"drop": twin}, roles={"drop": "calibration"},
        targets=tuple(targets), options=Options(runs=runs, seed=seed, **options),
    )  # fmt: skip


def overhead(studies):
    """Time of the method itself, for a run."""
    for name, study in (
        ("2 parameters, 4 scalars, 40 runs", draw_down(1, np.array([0.4, 0.3]), 40)),
        ("7 parameters, 4 curves, 120 runs, ten together", beans(120, batch=10)),
    ):
        begin = time.process_time()
        found = calibrate(study)
        spent = time.process_time() - begin
        print(f"overhead   {name}: {spent / found.runs:.2f} s of one core for a run, the answer "
              "included")  # fmt: skip


def grid(studies):
    """CoP with 100 runs of a stored grid against a tuned process of scikit-learn."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel

    points = full_factorial(31, 2)
    values = np.array([exact(u) for u in points])
    scatter = np.array([0.8, 0.8, 0.012, 0.02])
    rows = []
    for seed in range(studies or 5):
        rng = np.random.default_rng([seed, 8])
        chosen = rng.permutation(len(points))[:100]
        rest = np.setdiff1d(np.arange(len(points)), chosen)
        runs = values[chosen] + scatter * rng.standard_normal((100, 4))
        for k in range(4):
            ours = GaussianProcess(Sample.of(points[chosen], runs[:, k])).predict(points[rest])[0]
            kernel = ConstantKernel() * Matern([0.5, 0.5], nu=2.5) + WhiteKernel(0.05)
            other = GaussianProcessRegressor(
                kernel, normalize_y=True, n_restarts_optimizer=8, random_state=seed
            ).fit(points[chosen], runs[:, k])
            truth = values[rest, k]
            rows.append([cop(truth, ours), cop(truth, other.predict(points[rest]))])
    ours, theirs = np.array(rows).T
    print(
        f"grid       CoP of 100 runs, {len(rows)} cases: {ours.mean():.4f} here, "
        f"{theirs.mean():.4f} with scikit-learn; least difference {(ours - theirs).min():+.4f}"
    )


def cop(truth, predicted):
    return 1.0 - float(((truth - predicted) ** 2).sum() / ((truth - truth.mean()) ** 2).sum())


def seven(studies):
    """CoP of the errors of time signals: 950 runs as in the paper, and fewer by their shapes."""
    study = beans(40)
    space, twin = study.space, DropTwin()
    rng = np.random.default_rng(23)
    test = rng.random((1500, 7))
    curves = [twin.curves(space.named(u)) for u in test]
    x950 = latin_hypercube(317, 7, 1)
    r950 = [[twin.run(space.named(u), 3 * k + r) for r in range(3)] for k, u in enumerate(x950)]
    few = {n: latin_hypercube(n, 7, 2) for n in (60, 100, 150, 200, 250)}
    runs = {n: [twin.run(space.named(u), 9000 + k) for k, u in enumerate(x)]
            for n, x in few.items()}  # fmt: skip
    for target in study.targets:
        name = target.measure
        probe = replace(target, sd=np.full_like(target.sd, float(target.sd.mean())))
        first = response_of(probe, [r[0][name] for r in r950])
        truth = np.array([first.rmse([twin.times.tolist(), c[name].tolist()]) for c in curves])
        y = np.array([[first.rmse(r[name]) for r in three] for three in r950])
        sample = Sample.of(np.repeat(x950, 3, axis=0), y.ravel())
        scores = {"950 (error of 317 points, three each)":
                  cop(truth, GaussianProcess(sample).predict(test)[0])}  # fmt: skip
        for n, x in few.items():
            made = response_of(probe, [r[name] for r in runs[n]])
            white = np.array([made.whitened(r[name]) for r in runs[n]])
            numbers = white @ made.shapes.T
            rest = (white - numbers @ made.shapes).mean(axis=0)
            parts = [
                GaussianProcess(Sample.of(x, numbers[:, k])).predict(test)[0]
                for k in range(numbers.shape[1])
            ]
            whole = np.column_stack(parts) @ made.shapes + rest
            predicted = np.sqrt(((whole * probe.sd) ** 2).mean(axis=1))
            scores[f"{n}"] = cop(truth, predicted)
        print(f"seven      {name}: CoP by runs: "
              + ", ".join(f"{k} {v:.4f}" for k, v in scores.items()))  # fmt: skip


TABLE = {f.__name__: f for f in (factorial, coverage, tradeoff, overhead, grid, seven)}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", choices=[*TABLE, []], help="which")
    parser.add_argument("--studies", type=int, default=0, help="instead of the full number")
    parser.add_argument("--first", type=int, default=0, help="seed of the first study")
    options = parser.parse_args()
    FIRST = options.first
    for chosen in options.names or TABLE:
        begin = time.perf_counter()
        TABLE[chosen](options.studies)
        print(f"           ({time.perf_counter() - begin:.0f} s)", flush=True)
