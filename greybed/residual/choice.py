"""From ranked sets to a verdict: the smallest adequate set, and what cannot be told from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.residual.fit import Fit, at_end, extra, offsets
from greybed.residual.problem import Problem
from greybed.residual.search import Search, log_odds
from greybed.residual.terms import FORM, Term

Array = NDArray[np.float64]

DECISIVE = float(np.log(20.0))  # log odds beyond which a rival is refuted
EACH_MORE = float(np.log(3.0))  # log odds that one more term must win to be named
MOVED = 0.3  # relative change of an amplitude that makes one more effect another explanation
FORM_ERROR = 0.25  # an unnamed remainder below this share of a named effect is its form's error


@dataclass(frozen=True)
class Choice:
    """What to say.

    Attributes
    ----------
    verdict : str
        ``effect``, ``ambiguous``, ``unknown`` or ``suspect-data``.
    chosen : Fit
        The set that is reported, and what predictions are made with.
    rivals : tuple of Fit
        All sets that the data cannot tell apart, the chosen one first; empty unless ambiguous.
    remainder : Term or None
        An unnamed term that is small enough to be the error of a named effect's form.
    """

    verdict: str
    chosen: Fit
    rivals: tuple[Fit, ...] = ()
    remainder: Term | None = None


def _kinds(made: Fit) -> set[str]:
    return {term.kind for term in made.terms}


def _inside(made: Fit) -> set[int]:
    return {id(term) for term in made.terms}


def _smallest(best: Fit, fits: tuple[Fit, ...]) -> Fit:
    """Smallest subset of ``best`` that is nearly as likely."""
    chosen = best
    for made in fits:
        if _inside(made) < _inside(best) and made.terms:
            gain = log_odds(best) - log_odds(made)
            lost = len(best.terms) - len(made.terms)
            if gain < EACH_MORE * lost and (
                len(made.terms) < len(chosen.terms)
                or (len(made.terms) == len(chosen.terms) and log_odds(made) > log_odds(chosen))
            ):
                chosen = made
    return chosen


def choose(problem: Problem, found: Search) -> Choice:
    """Decide between the sets that were fitted.

    Parameters
    ----------
    problem : Problem
        The rows.
    found : Search
        Fits of all sets considered.

    Returns
    -------
    choice : Choice
        A rival within a factor 20 of posterior odds makes it ambiguous, unless it only adds
        terms or is an unnamed law where a named one does as well.
    """
    p = len(problem.names)
    finite = [f for f in found.fits if np.isfinite(f.log_evidence)]
    fits = tuple(f for f in finite if at_end(f, p) is None)
    if not fits:
        return Choice("unknown", found.null)
    chosen = _smallest(fits[0], fits)
    if "inside" in _kinds(chosen):
        named = [f for f in fits if _kinds(f) <= {"effect"}]
        if named and log_odds(fits[0]) - log_odds(named[0]) < DECISIVE:
            chosen = _smallest(named[0], fits)
    if _kinds(chosen) == {"inside"}:
        # a named effect whose shape is a little off may look like a law of its own
        own = [f for f in fits if _kinds(f) == {"effect"}]
        near = [f for f in own if _shape_gap(found.null, chosen, f) < DECISIVE]
        if near:
            chosen = _smallest(near[0], fits)
        mended = [f for f in fits if not near and _kinds(f) == {"effect", "inside"}]
        if mended and log_odds(fits[0]) - log_odds(mended[0]) < DECISIVE:
            _, small = _without_form_error(problem, mended[0], fits)
            chosen = mended[0] if small is not None else chosen
    chosen, remainder = _without_form_error(problem, chosen, fits)
    top = max(log_odds(chosen), log_odds(fits[0]))
    rivals: list[Fit] = []
    for made in fits:
        if made is chosen or _gap(found, fits, chosen, made, top) > DECISIVE:
            continue
        if _inside(made) > _inside(chosen) and (
            _kinds(chosen) != {"effect"} or not _moves(problem, chosen, made)
        ):
            continue
        if any(_inside(r) < _inside(made) for r in rivals):
            continue
        if "inside" in _kinds(made) and "inside" not in _kinds(chosen):
            continue
        if remainder is not None and id(remainder) in _inside(made):
            continue
        rivals = [r for r in rivals if not _inside(made) < _inside(r)]
        rivals.append(made)
    rivals = [r for r in rivals if not _inside(r) < _inside(chosen)]
    if (problem.prior_sd > 1.0).any():
        rivals += _without_trifles(found, fits, chosen)
    if rivals:
        return Choice("ambiguous", chosen, (chosen, *rivals), remainder)
    kinds = _kinds(chosen)
    if "label" in kinds:
        return Choice("suspect-data", chosen)
    if kinds & {"inside", "outside"}:
        return Choice("unknown", chosen)
    return Choice("effect", chosen, remainder=remainder)


def _gap(found: Search, fits: tuple[Fit, ...], chosen: Fit, made: Fit, top: float) -> float:
    """Log odds against a rival, the shapes of both trusted no further than laws hold.

    Where two explanations fit nearly alike, the data could part them only by the exact shapes of
    their laws. That part of the odds is limited to what a shape error of ``FORM`` leaves; the
    part that comes from the amplitudes that theory allows stays.
    """
    gap = top - log_odds(made)
    if gap <= DECISIVE or _kinds(made) | _kinds(chosen) != {"effect"}:
        return gap
    if len(made.terms) != len(chosen.terms):
        return gap
    common = _inside(made) & _inside(chosen)
    without = next((f for f in (found.null, *fits) if _inside(f) == common), None)
    if without is None:
        return gap
    return gap + _shape_gap(without, chosen, made) - (log_odds(chosen) - log_odds(made))


def _shape_gap(without: Fit, chosen: Fit, made: Fit) -> float:
    """Log odds of ``chosen`` against ``made``, shapes trusted to ``FORM`` of the effect.

    ``without`` is the fit without what the two are about.
    """
    own = float(np.sqrt(np.mean((chosen.fitted - without.fitted) ** 2)))
    apart = float(np.sqrt(np.mean((chosen.fitted - made.fitted) ** 2)))
    from_data = max(chosen.log_likelihood - made.log_likelihood, 0.0)
    trusted = 0.5 * (apart / max(FORM * own, 1e-300)) ** 2
    return log_odds(chosen) - log_odds(made) - from_data + min(from_data, trusted)


def _without_trifles(found: Search, fits: tuple[Fit, ...], chosen: Fit) -> list[Fit]:
    """Smaller sets that a shape error of ``FORM`` would leave as likely.

    With a free parameter in the fit, most of an effect can be absorbed, and what is left of it
    is no larger than the error of another one's shape.
    """
    smaller = []
    for made in fits:
        if not made.terms or not _inside(made) < _inside(chosen) or _kinds(chosen) != {"effect"}:
            continue
        if _shape_gap(found.null, chosen, made) < EACH_MORE:
            smaller.append(made)
    return smaller


def _moves(problem: Problem, chosen: Fit, larger: Fit) -> bool:
    """Whether one more effect changes what the chosen ones are, and so explains it otherwise."""
    if "inside" in _kinds(larger):
        return False
    p = len(problem.names)
    before = dict(zip(chosen.names, chosen.u[offsets(chosen.terms, p)], strict=True))
    after = dict(zip(larger.names, larger.u[offsets(larger.terms, p)], strict=True))
    return any(abs(after[name] - before[name]) > MOVED * abs(before[name]) for name in before)


def _without_form_error(
    problem: Problem, chosen: Fit, fits: tuple[Fit, ...]
) -> tuple[Fit, Term | None]:
    """Leave out an unnamed term that only mends the shape of a named effect.

    Published forms hold to some 10 to 20 % of the effect itself; a remainder of that size says
    nothing about another cause.
    """
    unnamed = [term for term in chosen.terms if term.kind == "inside"]
    if len(unnamed) != 1 or "effect" not in _kinds(chosen):
        return chosen, None
    reduced = next((f for f in fits if _inside(f) == _inside(chosen) - {id(unnamed[0])}), None)
    if reduced is None:
        return chosen, None
    p = len(problem.names)
    with_all = chosen.fitted
    term = unnamed[0]
    k = offsets(chosen.terms, p)[chosen.terms.index(term)]
    own = np.concatenate([np.zeros(p), chosen.u[k : k + term.size]])
    alone = extra((term,), own, p, problem)
    base = problem.predict(chosen.u[:p], {})
    named = with_all - base - alone
    size = float(np.std(alone)) / max(float(np.std(named)), 1e-300)
    return (reduced, term) if size < FORM_ERROR else (chosen, None)
