"""The search over sets of terms: screened by linear evidence, decided by nonlinear fits."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from greybed.residual.evidence import Scan, log_sum
from greybed.residual.fit import Fit, fit
from greybed.residual.noise import NoiseGrid
from greybed.residual.problem import Problem
from greybed.residual.terms import Term

Array = NDArray[np.float64]

MOST_TERMS = 3
LOG_EACH_MORE = float(np.log(0.6))  # prior odds that one more term is missing
BEAM = 24  # sets of each size that the next size grows from
BREADTH = 14  # sets that are fitted
NARROW = 6  # and in a fold of a hold-out, where only the best is asked for


@dataclass(frozen=True)
class Search:
    """Fits of the best sets, best first; ``null`` is the base model with its parameters."""

    null: Fit
    fits: tuple[Fit, ...]


def _set_scores(scan: Scan, sets: NDArray[np.int64]) -> Array:
    """Log evidence of sets of atoms, shape (len(sets),); sets (N, k) of atom numbers."""
    k = sets.shape[1]
    total = np.full((len(scan.coarse), len(sets)), -np.inf)
    mean = scan.mean[sets]
    diagonal = scan.precision[sets]
    log_prior = 0.5 * np.log(diagonal).sum(axis=1)
    for i, h in enumerate(scan.coarse):
        q = scan.gram[i][sets[:, :, None], sets[:, None, :]]
        c = scan.dot[h][sets]
        qm = np.einsum("nij,nj->ni", q, mean)
        b = c - qm
        inner = q + np.eye(k) * diagonal[:, :, None]
        solved = np.linalg.solve(inner, b[..., None])[..., 0]
        total[i] = (
            scan.log_null[h]
            + 0.5 * np.einsum("ni,ni->n", b, solved)
            + np.einsum("ni,ni->n", mean, c)
            - 0.5 * np.einsum("ni,ni->n", mean, qm)
            - 0.5 * np.linalg.slogdet(inner)[1]
            + log_prior
        )
    return log_sum(total, axis=0) + scan.log_weight[sets].sum(axis=1)


def screened_sets(
    scan: Scan, terms: list[Term], breadth: int
) -> list[tuple[tuple[int, ...], Array]]:
    """Sets of terms worth a nonlinear fit, with the atoms to start from.

    Parameters
    ----------
    scan : Scan
        Of all terms.
    terms : list of Term
        The terms.
    breadth : int
        How many.

    Returns
    -------
    sets : list of (term numbers, atom numbers)
        About ``breadth``, best first; every single named effect is among the candidates.
    """
    best: dict[tuple[int, ...], tuple[float, tuple[int, ...]]] = {}

    def enter(sets: NDArray[np.int64], scores: Array) -> None:
        for atoms, score in zip(sets, scores, strict=True):
            key = tuple(sorted(int(scan.term[a]) for a in atoms))
            if key not in best or score > best[key][0]:
                best[key] = (float(score), tuple(int(a) for a in atoms))

    singles = np.arange(len(scan.mean))[:, None]
    enter(singles, _set_scores(scan, singles))
    # one representative atom of each term keeps the sets few; the fit finds the exponent
    for size in range(2, MOST_TERMS + 1):
        parents = sorted((v[0], v[1]) for k, v in best.items() if len(k) == size - 1)[::-1]
        grown = set()
        for _, atoms in parents[: BEAM if size > 2 else 3 * BEAM]:
            held = {int(scan.term[a]) for a in atoms}
            for a in range(len(scan.mean)):
                if int(scan.term[a]) not in held:
                    grown.add(tuple(sorted((*atoms, a))))
        if not grown:
            break
        sets = np.array(sorted(grown))
        enter(sets, _set_scores(scan, sets) + (size - 1) * LOG_EACH_MORE)
    order = sorted(best.items(), key=lambda item: -item[1][0])
    # a set that only adds noise to a better one shows up beside it; leave room for other ideas
    chosen = order[:breadth]
    named = [
        item for item in order[breadth:] if len(item[0]) == 1 and terms[item[0][0]].kind == "effect"
    ]
    return [(key, np.array(atoms)) for key, (_, atoms) in chosen + named[: breadth // 3]]


def search(
    problem: Problem,
    grid: NoiseGrid,
    scan: Scan,
    terms: list[Term],
    start: Array,
    breadth: int = BREADTH,
) -> Search:
    """Find the sets of terms that the data and the priors like best.

    Parameters
    ----------
    problem, grid, scan, terms
        The rows, their noise, and everything that may explain them.
    start : ndarray (p,)
        Parameters to start from.
    breadth : int
        How many sets to fit.

    Returns
    -------
    search : Search
        All fits made, best first; subsets of the best are always among them.
    """
    null = fit(problem, grid, (), start)
    fits: dict[tuple[int, ...], Fit] = {}

    def enter(key: tuple[int, ...], atoms: dict[int, int]) -> None:
        members = tuple(terms[i] for i in key)
        made = []
        # two starts: theory, and what the data say by themselves
        for free in (False, True):
            u = [*start]
            for i in key:
                numbers = np.flatnonzero(scan.term == i)
                atom = terms[i].atoms[int(np.flatnonzero(numbers == atoms[i])[0])]
                u.append(_first_amplitude(scan, atoms[i], terms[i], free and len(key) == 1))
                if terms[i].size == 2:
                    u.append(atom.exponent if atom.exponent else 0.1)
            made.append(fit(problem, grid, members, np.array(u)))
            if len(key) > 1 or terms[key[0]].kind != "effect":
                break
        fits[key] = max(made, key=_log_odds)

    for key, atoms in screened_sets(scan, terms, breadth):
        enter(key, {int(scan.term[a]): int(a) for a in atoms})
    best = max(fits, key=lambda key: _log_odds(fits[key]))
    representative = {int(i): int(np.flatnonzero(scan.term == i)[0]) for i in scan.term}
    for size in range(1, len(best)):
        for key in combinations(best, size):
            if key not in fits:
                enter(key, {i: _best_atom(scan, i, representative[i]) for i in key})
    return Search(null, tuple(sorted(fits.values(), key=lambda f: -_log_odds(f))))


def _best_atom(scan: Scan, term: int, otherwise: int) -> int:
    numbers = np.flatnonzero(scan.term == term)
    scores = scan.singles()[numbers]
    return int(numbers[int(np.argmax(scores))]) if np.isfinite(scores).any() else otherwise


def _first_amplitude(scan: Scan, atom: int, term: Term, free: bool) -> float:
    if term.kind == "effect" and not free:
        return float(scan.mean[atom])
    h = int(np.argmax(scan.log_null))
    weight = 1e-12 if free else scan.precision[atom]
    value = float(scan.dot[h, atom] / (scan.norm[h, atom] + weight))
    return value if value != 0.0 else 1e-3


def _log_odds(made: Fit) -> float:
    """Evidence with the prior of the number of terms."""
    return made.log_evidence + max(0, len(made.terms) - 1) * LOG_EACH_MORE


log_odds = _log_odds
