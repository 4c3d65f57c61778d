"""The answer of a calibration, and how it is put together."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2 as chi2_distribution

from greybed.calibration.advice import (
    Check,
    NextTest,
    Transfer,
    checks,
    next_tests,
    transfers,
    what_limits,
)
from greybed.calibration.best import best_point, cheapest_as_good
from greybed.calibration.identify import (
    Direction,
    Verdict,
    directions,
    effective_number,
    verdicts,
)
from greybed.calibration.isolines import Overlap, overlap
from greybed.calibration.metamodel import Metamodel
from greybed.calibration.posterior import REGION, Posterior, sample_posterior
from greybed.calibration.search import Search
from greybed.calibration.sensitivity import (
    Budget,
    Quality,
    budget,
    pearson,
    quality,
    sobol_indices,
    unresponsive,
)

Array = NDArray[np.float64]

# Chance of a misfit as large below which no parameter set is said to fit.
MISFIT = 0.01
# Chains whose R-hat is above this do not agree (Vehtari et al. 2021 recommend 1.01 for tails).
AGREE = 1.05


@dataclass(frozen=True, kw_only=True)
class Answer:
    """What a calibration has come to.

    Attributes
    ----------
    best : mapping of str to float
        The mode of the posterior; fixed parameters, too [SI].
    best_point : ndarray (d,)
        The same in the unit cube [-].
    posterior : Posterior
        Samples.
    model : Metamodel
        Surrogates, with the runs.
    chi2, freedom, p_value : float
        Misfit at the best set, measured numbers less parameters that they are worth, and the chance
        of a misfit as large; p is None without freedom [-].
    fits : bool
        Whether the best set lies within the errors.
    directions, verdicts, quality, budget, checks, next_tests, transfers : list
        As their classes say.
    pearson, sobol_first, sobol_total : mapping of str to ndarray (d,)
        Sensitivities by measure [-].
    overlap : Overlap
        Shares of the prior within the bands of the measures.
    cheapest : (dict, float) or None
        A set that fits as well with less work, and its share of the work.
    limits : str
        What would narrow the answer.
    sentence : str
        The answer in words.
    notes : list of str
        How runs were chosen, and what to beware of.
    extra : dict
        Results of the strategy itself, such as ANOVA tables.
    runs, made, found, failed : int
        Jobs, runs made now, runs from the store, failed runs [-].
    seconds, run_seconds : float
        In all, and in runs that were made now [s].
    """

    best: dict[str, float]
    best_point: Array
    posterior: Posterior
    model: Metamodel
    chi2: float
    freedom: float
    p_value: float | None
    fits: bool
    directions: list[Direction]
    verdicts: list[Verdict]
    quality: list[Quality]
    budget: list[Budget]
    checks: list[Check]
    next_tests: list[NextTest]
    transfers: list[Transfer]
    pearson: dict[str, Array]
    sobol_first: dict[str, Array]
    sobol_total: dict[str, Array]
    overlap: Overlap
    cheapest: tuple[dict[str, float], float] | None
    limits: str
    sentence: str
    notes: list[str] = field(default_factory=list)
    extra: dict[str, Any] = field(default_factory=dict)
    runs: int = 0
    made: int = 0
    found: int = 0
    failed: int = 0
    seconds: float = 0.0
    run_seconds: float = 0.0
    store: Path | None = None

    @property
    def open_directions(self) -> list[Direction]:
        """Those that the data leave open."""
        return [d for d in self.directions if not d.determined]


def answer(search: Search, begin: float) -> Answer:
    """Put the answer of a finished search together; ``begin`` is when it began [s]."""
    study, campaign, o = search.study, search.campaign, search.study.options
    model = search.fit(anew=True)
    space = study.space
    posterior = sample_posterior(model.log_posterior, space, o.seed)
    best = best_point(model, o.seed, posterior.points)
    found = directions(model, best)
    misfit = float(model.chi2(best[None])[0])
    freedom = model.numbers + model.outside[1] - effective_number(found)
    p_value = float(chi2_distribution.sf(misfit, freedom)) if freedom >= 0.5 else None
    fits = p_value is None or p_value >= MISFIT
    labels = [e.response.label for e in model.emulators]
    first, total = {}, {}
    for emulator in [*model.emulators, *model.others.values()]:
        label = emulator.response.label
        first[label], total[label] = sobol_indices(emulator, space, o.seed)
    step = max(1, len(posterior.points) // 1000)
    budgets = [budget(e, posterior.points[::step]) for e in model.emulators]
    shares = {b.label: (b.measurement, b.replicates, b.surrogate) for b in budgets}
    checked = checks(model, posterior)
    tests = next_tests(model, posterior)
    cheap = cheapest_as_good(model, best, posterior.points[posterior.density >= posterior.level()])
    words = verdicts(model, posterior)
    return Answer(
        best=space.named(best),
        best_point=best,
        posterior=posterior,
        model=model,
        chi2=misfit,
        freedom=freedom,
        p_value=p_value,
        fits=fits,
        directions=found,
        verdicts=words,
        quality=[quality(e, o.seed) for e in [*model.emulators, *model.others.values()]],
        budget=budgets,
        checks=checked,
        next_tests=tests,
        transfers=transfers(model, posterior, best, found, o.seed),
        pearson={e.response.label: pearson(e) for e in [*model.emulators, *model.others.values()]},
        sobol_first=first,
        sobol_total=total,
        overlap=overlap(model),
        cheapest=None if cheap is None else (space.named(cheap[0]), cheap[1]),
        limits=what_limits(model, shares),
        sentence=_sentence(fits, found, words, tests, checked),
        notes=[*search.notes, *_warnings(model, posterior, labels)],
        extra=search.extra,
        runs=campaign.spent,
        made=campaign.made,
        found=campaign.found,
        failed=sum(o.results is None for _, tries in campaign.finished for o in tries),
        seconds=time.perf_counter() - begin,
        run_seconds=campaign.seconds,
        store=campaign.store.path,
    )


def _sentence(
    fits: bool, found: list[Direction], words: list[Verdict], tests: list[NextTest],
    checked: list[Check],
) -> str:  # fmt: skip
    if not fits:
        worst = max((c for c in checked if not c.held_out), key=lambda c: abs(c.pull))
        return (
            "No parameter set fits all measures within their errors; the worst is "
            f"{worst.label}, {abs(worst.pull):.1f} standard deviations off: something is missing "
            "in the model or the data, which greybed diagnose looks for."
        )
    left = [d for d in found if not d.determined]
    n = len(found)
    known = (
        f"The data determine {n - len(left)} of {n} directions"
        if left
        else f"The data determine all {n} parameters"
        if n > 1 and all(v.word == "determined" for v in words)
        else f"The data determine all {n} directions"
        if n > 1
        else "The data determine the parameter"
    )
    if not left:
        return known + "."
    text = f"{known}; open: {'; '.join(d.words for d in left)}."
    if tests and tests[0].information > 0.05:
        what = "measure once more" if tests[0].repeat else "make"
        text += f" The test to {what} next is {tests[0].name}."
    return text


def _warnings(model: Metamodel, posterior: Posterior, labels: list[str]) -> list[str]:
    notes = []
    quiet = unresponsive(model)
    if quiet:
        notes.append(
            f"No response beyond the scatter of replicates: {', '.join(quiet)}. These data tell "
            "nothing about the parameters."
        )
    if float(posterior.r_hat.max()) > AGREE:
        notes.append(
            f"The chains do not agree (R-hat {posterior.r_hat.max():.3f}): take the intervals as "
            "rough."
        )
    modes = posterior.modes()
    if modes > 1:
        notes.append(
            f"The {100.0 * REGION:.0f} % region has {modes} separate parts: several parameter sets "
            "fit, with none between them."
        )
    failed = {
        name: int((~rows.good).sum()) for name, rows in model.rows.items() if (~rows.good).any()
    }
    for name, count in failed.items():
        notes.append(
            f"{count} of {len(model.rows[name].good)} runs of {name} failed; where they do is "
            "part of the answer (a logistic Gaussian process), reasons are in the store."
        )
    return notes
