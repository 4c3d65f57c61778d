"""From a study to a diagnosis: look, existence, search, choice, hold-out, and what to say."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from greybed.closures.term import GreyBoxTerm
from greybed.core.errors import InputError
from greybed.core.progress import progress
from greybed.residual.choice import Choice, choose
from greybed.residual.detectable import detectable
from greybed.residual.diagnosis import Dependence, Diagnosis, FoundEffect, Ranked, Rows, Shift
from greybed.residual.experiment import experiment
from greybed.residual.fit import Fit, amplitudes, at_end, fit, offsets
from greybed.residual.holdout import HeldOut, errors, hold_out
from greybed.residual.interval import over_sets
from greybed.residual.look import Look, existence, look, without_hinge
from greybed.residual.problem import Problem, state
from greybed.residual.search import Search, log_odds, search
from greybed.residual.study import Study
from greybed.residual.unnamed import dependence
from greybed.residual.words import remarks, sentence

Array = NDArray[np.float64]

MOST_RANKED = 12
STAGES = 5


def diagnose(study: Study, show: bool = False) -> Diagnosis:
    """Find what the model lacks.

    Parameters
    ----------
    study : Study
        Table, noise, model, parameters, options; see :func:`greybed.residual.read_study`.
    show : bool
        Whether to show progress.

    Returns
    -------
    diagnosis : Diagnosis
        The same for the same study and seed.

    Raises
    ------
    InputError
        If the model cannot be built on these columns, or too few rows can be used.
    """
    from greybed.residual.models import build

    began = time.perf_counter()
    values = {name: item.value for name, item in study.parameters.items()}
    model = build(study.model, study.table, values)
    if model.response and model.response != study.response:
        raise InputError(
            f"{study.file or 'study'}: data.response = {study.response!r}, and the model "
            f"{model.name} predicts {model.response}; take that column, or another model."
        )
    _check_candidates(study, {*model.effects, *model.unavailable})
    with progress(STAGES, "diagnosing", show=show) as advance:
        whole = state(study, model)
        seen = look(whole)
        advance(1)
        options = study.options
        p_value, critical = 1.0, np.inf
        if seen.terms:
            p_value, critical = existence(seen, options.alpha, options.seed)
            if p_value <= options.alpha:
                fewer = without_hinge(whole, seen, critical)
                if fewer is not seen:
                    seen = fewer
                    p_value, critical = existence(seen, options.alpha, options.seed)
        advance(1)
        null = fit(seen.problem, seen.grid, (), seen.t, intervals=True)
        found = Search(null, ())
        choice: Choice | None = None
        if p_value <= options.alpha:
            found = search(seen.problem, seen.grid, seen.scan, seen.terms, seen.t)
            choice = choose(seen.problem, found)
        advance(1)
        held = hold_out(seen, critical)
        advance(1)
        answer = _answer(study, whole, seen, null, found, choice, held, p_value, critical)
        advance(1)
    return Diagnosis(**answer, seconds=time.perf_counter() - began)


def _check_candidates(study: Study, known: set[str]) -> None:
    for name in study.options.candidates or ():
        if name not in known:
            raise InputError(
                f"{study.file or 'study'}: options.candidates names {name!r}, which the model "
                f"{study.model.name} has not; known are {', '.join(sorted(known))}."
            )


def _answer(
    study: Study,
    whole: Problem,
    seen: Look,
    null: Fit,
    found: Search,
    choice: Choice | None,
    held: HeldOut,
    p_value: float,
    critical: float,
) -> dict[str, Any]:
    problem, options = seen.problem, study.options
    final = null if choice is None else _final(seen, choice.chosen)
    verdict = _verdict(seen, choice)
    p = len(problem.names)
    depends: tuple[Dependence, ...] = ()
    closures: tuple[GreyBoxTerm, ...] = ()
    suspect = None
    if choice is not None:
        for term in final.terms:
            if term.kind in ("inside", "outside"):
                one, closure = dependence(problem, seen.grid, final, term)
                depends = (*depends, one)
                if closure is not None and problem.model.transform == "log":
                    closures = (*closures, closure)
    for term in final.terms:
        if term.kind == "label":
            label, value = term.name.split("=", 1)
            suspect = {"label": label, "value": value}
    trial = None
    rivals: tuple[tuple[str, ...], ...] = ()
    if choice is not None and choice.rivals:
        rivals = tuple(tuple(sorted(r.names)) for r in choice.rivals)
        trial = experiment(problem, choice.rivals, options.seed)
    switched = amplitudes(final.terms, final.u, p)
    answer: dict[str, Any] = {
        "verdict": verdict,
        "effects": _effects(seen, final, found),
        "rivals": rivals,
        "experiment": trial,
        "depends_on": depends,
        "closures": closures if verdict == "unknown" else (),
        "suspect": suspect,
        "error": errors(problem, held, options.seed),
        "parameters": _shifts(problem, final),
        "detectable": detectable(seen, null, critical) if choice is None else {},
        "p_value": p_value,
        "alpha": options.alpha,
        "ranking": _ranking(problem, found),
        "not_identifiable": seen.hidden,
        "unavailable": dict(problem.model.unavailable),
        "noise": _noise(study, seen, final),
        "left_out": _left_out(study, whole, seen),
        "transform": problem.model.transform,
        "model": problem.model.settings(problem.parameters(final.u[:p]), switched),
        "case": problem.model.next_case(_next_parameters(problem, final), switched),
        "rows": _rows(study, whole, seen, final, held),
    }
    answer["remarks"] = remarks(study, seen, choice, answer)
    answer["sentence"] = sentence(answer)
    return answer


def _final(seen: Look, chosen: Fit) -> Fit:
    """The chosen set fitted once more, with intervals."""
    return fit(seen.problem, seen.grid, chosen.terms, chosen.u, intervals=True)


def _verdict(seen: Look, choice: Choice | None) -> str:
    if choice is not None:
        return choice.verdict
    if seen.excess is not None:
        return "unknown"
    named = any(term.kind == "effect" for term in seen.terms)
    return "none" if named or not seen.hidden else "not-identifiable"


def _effects(seen: Look, final: Fit, found: Search) -> tuple[FoundEffect, ...]:
    p = len(seen.problem.names)
    candidates = sum(term.kind == "effect" for term in seen.terms)
    listed = []
    for term, k in zip(final.terms, offsets(final.terms, p), strict=True):
        if term.effect is None:
            continue
        unit = term.effect.typical
        estimate, *ends = final.flat[k]
        width = (ends[1] - ends[0]) / (2.0 * stats.norm.isf(0.025))
        # one-sided test of amplitude 0 with all other terms in, times the number of candidates
        p_value = candidates * float(stats.norm.sf(estimate / width))
        low, high = sorted(float(end) * unit for end in over_sets(seen, final, found, term))
        listed.append(
            FoundEffect(
                name=term.effect.name,
                amplitude=float(final.u[k]) * unit,
                ci95=(low, high),
                theory=term.effect.theory,
                p_value=min(1.0, p_value),
            )
        )
    return tuple(sorted(listed, key=lambda effect: effect.p_value))


def _shifts(problem: Problem, final: Fit) -> dict[str, Shift]:
    shifts = {}
    after = problem.parameters(final.u[: len(problem.names)])
    for j, name in enumerate(problem.names):
        item = problem.study.parameters[name]
        error = float(np.sqrt(final.covariance[j, j])) * problem.scale[j]
        sd = item.sd or error * (abs(after[name]) if item.value > 0.0 else 1.0)
        shift = (after[name] - item.value) / sd if sd > 0.0 else 0.0
        shifts[name] = Shift(
            before=item.value, after=after[name], sd=sd, shift_sd=shift, free=item.free
        )
    return shifts


def _next_parameters(problem: Problem, final: Fit) -> dict[str, float]:
    """Measured parameters as measured, free ones as calibrated."""
    after = problem.parameters(final.u[: len(problem.names)])
    known = problem.study.parameters
    return {name: after[name] if item.free else item.value for name, item in known.items()}


def _ranking(problem: Problem, found: Search) -> tuple[Ranked, ...]:
    p = len(problem.names)
    ranked = []
    best = max((log_odds(f) for f in found.fits), default=0.0)
    everything = [*found.fits[:MOST_RANKED], found.null]
    for made in everything:
        sizes, remark = [], ""
        for term, k in zip(made.terms, offsets(made.terms, p), strict=True):
            unit = term.effect.typical if term.effect else 1.0
            sizes.append(float(made.u[k]) * unit)
        end = at_end(made, p)
        if end is not None:
            remark = f"{end} stands at the end of the range that physics allows"
        ranked.append(
            Ranked(
                names=made.names,
                amplitudes=tuple(sizes),
                log_odds=log_odds(made) - best,
                selectable=not remark,
                remark=remark,
            )
        )
    return tuple(sorted(ranked, key=lambda item: -item.log_odds))


def _noise(study: Study, seen: Look, final: Fit) -> dict[str, Any]:
    systematic = seen.problem.systematic(seen.t)
    return {
        "random": final.sigma,
        "group": final.tau,
        "stated_random": study.noise.relative,
        "systematic": float(np.sqrt(np.mean(np.diag(systematic)))),
        "outliers": int(seen.screened.outlier.sum()),
        "varies_with": seen.screened.varies_with,
    }


def _left_out(study: Study, whole: Problem, seen: Look) -> tuple[Mapping[str, Any], ...]:
    listed = list(whole.left_out)
    for i in whole.index[seen.screened.outlier]:
        reason = "an outlier: no explanation that suits the other rows reaches it"
        listed.append({"row": int(study.table.rows[i]), "reason": reason})
    return tuple(sorted(listed, key=lambda item: item["row"]))


def _rows(study: Study, whole: Problem, seen: Look, final: Fit, held: HeldOut) -> Rows:
    n = len(study.table)
    index = seen.problem.index
    log = whole.model.transform == "log"

    def back(values: Array) -> Array:
        full = np.full(n, np.nan)
        full[index] = np.exp(values) if log else values
        return full

    nothing = np.zeros(len(whole.names))
    base = np.full(n, np.nan)
    everywhere = whole.predict(nothing, {})
    base[whole.index] = np.exp(everywhere) if log else everywhere
    before, after = np.full(n, np.nan), np.full(n, np.nan)
    before[whole.index] = whole.z - everywhere
    after[index] = seen.problem.z - final.fitted
    sd = np.full(n, np.nan)
    sd[whole.index] = final.sigma * np.sqrt(seen.screened.weight)
    used = np.zeros(n, dtype=bool)
    used[index] = True
    group = np.full(n, -1, dtype=np.int64)
    group[whole.index] = whole.group
    covariates = {name: study.table.columns[name] for name in whole.covariates()}
    return Rows(
        measured=study.table.columns[study.response],
        base=base,
        with_effect=back(final.fitted),
        held_out=back(held.with_effect),
        residual_before=before,
        residual_after=after,
        sd=sd,
        used=used,
        group=group,
        covariates=covariates,
        units={name: study.table.units.get(name, "") for name in covariates},
    )
