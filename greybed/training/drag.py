"""Training of closures of filtered drag: data set -> fit -> closure with its card."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed._version import __version__
from greybed.closures.drag.filtered import MARKER_SETS, FilteredDragClosure, Gate
from greybed.closures.drag.filtered.closure import CONVENTION, HIDDEN
from greybed.closures.drag.filtered.features import DragMarkerSet
from greybed.closures.drag.filtered.limits import check_limits
from greybed.closures.predictors import Forest, Network, Predictor
from greybed.closures.viewfactor.closure import Domain
from greybed.core import InputError
from greybed.core.progress import progress
from greybed.training.drag_rows import MOST_ROWS, DragRows, drag_rows, gate_of
from greybed.training.drag_score import force_of, guesses, score_of, score_table

Array = NDArray[np.float64]

EPOCHS = 20
FOLDS = 5
LEAST_CASES = 3
LEAST_ROWS = 500
SHARES = (0.25, 0.5, 1.0)


def fit(
    rows: DragRows,
    kind: str,
    chosen: DragMarkerSet,
    gate: Gate,
    *,
    seed: int,
    epochs: int,
    hidden: tuple[int, ...] = HIDDEN,
) -> FilteredDragClosure:
    """One fit to rows, without spread and card."""
    rows = rows.thinned(MOST_ROWS, seed)
    predictor: Predictor
    if kind == "mlp":
        from greybed.training.drag_network import fit_drag_network

        predictor = fit_drag_network(rows, chosen, gate, seed=seed, epochs=epochs, hidden=hidden)
    else:
        from greybed.training.drag_forest import fit_drag_forest

        predictor = fit_drag_forest(rows, chosen, gate, seed=seed)
    return FilteredDragClosure(chosen, predictor, Domain.of(chosen.features(rows.of(chosen))), gate)


def flows_of(data: Any) -> NDArray[np.int64]:
    """A number for each case, the same for cases of one flow, whatever their grids and boxes.

    A closure that has seen a flow on a finer grid or in a wider box has seen it: such cases are
    held out together.
    """
    seen: dict[tuple[object, ...], int] = {}
    found = [
        seen.setdefault(
            (
                case.source, case.dimension, case.diameter, case.particle_density,
                case.gas_density, case.gas_viscosity, case.law, case.mean_solid_fraction,
            ),
            len(seen),
        )
        for case in data.cases
    ]  # fmt: skip
    return np.array(found, dtype=np.int64)


def folds_of(group: NDArray[np.int64], seed: int, most: int = FOLDS) -> NDArray[np.int64]:
    """A fold (n,) for every row, the same for all rows of a group, groups dealt out at random."""
    names = np.unique(group)
    dealt = np.random.default_rng(seed).permutation(len(names)) % min(most, len(names))
    return np.asarray(dealt[np.searchsorted(names, group)])


def train_drag(
    data: Any,
    kind: str = "mlp",
    markers: str = "plain",
    *,
    seed: int = 0,
    epochs: int = EPOCHS,
    hidden: tuple[int, ...] = HIDDEN,
    random_rows: bool = True,
    show_progress: bool = False,
) -> tuple[FilteredDragClosure, DragRows, dict[str, Array]]:
    """Train a closure; scores on held-out cases are in its card.

    The closure is fitted to all cases. Its scores are those of fits that had not seen the case of
    a row: cases are dealt into five folds, or as many as there are, those of one flow into one.
    The spread is fitted to the errors of these.

    Parameters
    ----------
    data : FilteredDrag
        From :func:`greybed.datasets.filtered_drag.read_filtered_drag`.
    kind : str
        ``mlp`` or ``forest``.
    markers : str
        ``plain``, ``gradient``, and for networks ``linear`` and ``full``.
    seed : int
        Of the fit and the folds.
    epochs : int
        Passes of a network over its rows [-].
    hidden : tuple of int
        Neurons of each layer of a network.
    random_rows : bool
        Whether to score folds of random rows too, to show how much that flatters.
    show_progress : bool
        Draw a progress bar.

    Returns
    -------
    closure : FilteredDragClosure
    rows : DragRows
        What was fitted and scored.
    forces : dict of (n, 3) arrays
        What each guess and the closure's held-out fits say of these rows.

    Raises
    ------
    InputError
        If the data set counts something else than the fraction kept, has too few cases to hold
        one out or too few rows, or the form does not exist.
    """
    chosen = MARKER_SETS[markers]
    _check(data, kind, markers, seed, epochs)
    gate = gate_of(data)
    rows = drag_rows(data).thinned(4 * MOST_ROWS, seed)
    if len(rows) < LEAST_ROWS:
        raise InputError(
            f"the data set has {len(rows)} rows with particles, at least {LEAST_ROWS} are needed; "
            "run its cases longer or take more filters."
        )
    options: dict[str, Any] = {"seed": seed, "epochs": epochs, "hidden": hidden}
    by_case = folds_of(flows_of(data)[rows.case], seed)
    count = int(by_case.max()) + 1
    by_row = np.random.default_rng(seed + 1).permutation(len(rows)) % count
    total = 1 + count * (2 if random_rows else 1)
    label = f"training {kind} on {markers} markers"
    with progress(total, label, show=show_progress) as advance:
        held, kept = np.zeros_like(rows.force), np.zeros(len(rows))
        dealt: dict[str, Array] = {name: np.zeros_like(rows.force) for name in guesses(rows)}
        mixed = np.zeros_like(rows.force)
        for fold in range(count):
            out = np.flatnonzero(by_case == fold)
            some, left = rows.take(np.flatnonzero(by_case != fold)), rows.take(out)
            trial = fit(some, kind, chosen, gate, **options)
            held[out] = force_of(trial, left)
            kept[out] = trial.predict(**left.of(chosen)).kept_along
            for name, guess in guesses(some).items():
                dealt[name][out] = guess(left)
            advance(1)
            if random_rows:
                out = np.flatnonzero(by_row == fold)
                some, left = rows.take(np.flatnonzero(by_row != fold)), rows.take(out)
                mixed[out] = force_of(fit(some, kind, chosen, gate, **options), left)
                advance(1)
        closure = _whole(rows, kind, chosen, gate, kept, options)
        advance(1)
    forces = {**dealt, "closure": held}
    scores = score_table(rows, forces)
    closure.card.update(_facts(data, rows, closure, seed))
    closure.card["title"] = f"filtered drag, {kind}, {markers} markers"
    closure.card["score"] = {**scores[-1], "cases": len(np.unique(rows.case)), "folds": count}
    closure.card["guesses"] = scores[:-1]
    if random_rows:
        closure.card["random_rows"] = score_of(rows, mixed)
    closure.card["coverage95"] = _coverage(closure, rows, kept)
    closure.card["by_case"] = [
        {"case": data.cases[k].name, **score_of(rows.take(own), held[own])}
        for k in np.unique(rows.case)
        for own in [np.flatnonzero(rows.case == k)]
    ]
    closure.card["limits"] = {case.name: case.error for case in check_limits(closure)}
    return closure, rows, forces


def _check(data: Any, kind: str, markers: str, seed: int, epochs: int) -> None:
    if kind == "forest" and MARKER_SETS[markers].linear:
        raise InputError(
            "a forest has no linear part, for its leaves hold quotients of forces; take the model "
            "mlp, or the markers plain or gradient."
        )
    if not 0 <= seed <= 2**32 - 1:
        raise InputError(f"seed = {seed} [-] must lie in 0 ... {2**32 - 1}; mend it.")
    if not 1 <= epochs <= 100_000:
        raise InputError(f"epochs = {epochs} [-] must lie in 1 ... 100000; mend it.")
    convention = getattr(data, "convention", CONVENTION)
    if convention != CONVENTION:
        raise InputError(
            f"the data set counts drag as {convention!r}, and this closure needs {CONVENTION!r}; "
            "convert it (kept = 1 - lost)."
        )
    cases = len(np.unique(flows_of(data)[data.case]))
    if cases < LEAST_CASES:
        raise InputError(
            f"the data set has {cases} cases of different flows, at least {LEAST_CASES} are needed "
            "to hold one out and still fit; run more cases."
        )


def _whole(
    rows: DragRows, kind: str, chosen: DragMarkerSet, gate: Gate, kept: Array,
    options: dict[str, Any],
) -> FilteredDragClosure:  # fmt: skip
    """The fit to all rows, with the spread of the held-out ones."""
    closure = fit(rows, kind, chosen, gate, **options)
    predictor = closure.predictor
    if isinstance(predictor, Network):
        from greybed.training.drag_network import with_spread

        predictor = with_spread(predictor, rows, kept, chosen, gate, options["seed"])
    else:
        from greybed.training.drag_forest import forest_with_spread

        assert isinstance(predictor, Forest)
        predictor = forest_with_spread(predictor, rows, kept, chosen, gate)
    return FilteredDragClosure(chosen, predictor, closure.domain, gate)


def _coverage(closure: FilteredDragClosure, rows: DragRows, kept: Array) -> float:
    """Share of clean rows whose H lies in the stated interval of 95 % around held-out fits."""
    p = closure.predict(**rows.of(closure.markers))
    clean = rows.clean & (p.stderr > 0.0)
    relative = (p.stderr / p.kept_along)[clean]
    off = np.abs(rows.kept - kept)[clean]
    return float((off <= 1.96 * relative * kept[clean]).mean())


def _facts(data: Any, rows: DragRows, closure: FilteredDragClosure, seed: int) -> dict[str, Any]:
    used = [data.cases[k] for k in np.unique(rows.case)]
    laws = sorted({str(case.law) for case in used})
    numbers = [array.size for name, array in closure.predictor.arrays().items() if name != "bent"]
    return {
        "convention": CONVENTION,
        "data_sha256": str(getattr(data, "digest", "")),
        "seed": seed,
        "greybed": __version__,
        "law": ", ".join(laws),
        "cases": len(used),
        "sources": sorted({str(case.source) for case in used}),
        "dimensions": sorted({int(case.dimension) for case in used}),
        "numbers": int(sum(numbers)),
        "rows": len(rows),
        "gate": {k: float(v) for k, v in vars(closure.gate).items()},
        "ranges": {
            name: [float(value.min()), float(value.max())]
            for name, value in rows.of(closure.markers).items()
        },
        "materials": [
            {
                "diameter_m": float(case.diameter),
                "particle_density_kg_m3": float(case.particle_density),
                "gas_density_kg_m3": float(case.gas_density),
                "gas_viscosity_Pa_s": float(case.gas_viscosity),
            }
            for case in used
        ],
    }


def drag_curve(
    data: Any,
    kind: str,
    markers: str,
    *,
    shares: Sequence[float] = SHARES,
    seed: int = 0,
    epochs: int = EPOCHS,
    hidden: tuple[int, ...] = HIDDEN,
) -> list[dict[str, Any]]:
    """Learning curve: held-out scores against the number of cases to train on.

    Each of the folds is held out in turn, and the rest is thinned to a share of its cases.

    Returns
    -------
    list of dict
        ``cases``, ``drift_r2``, ``kept_r2``, ``kept_rms``, by growing number.
    """
    chosen, gate = MARKER_SETS[markers], gate_of(data)
    rows = drag_rows(data).thinned(MOST_ROWS, seed)
    fold = folds_of(flows_of(data)[rows.case], seed)
    points = []
    for share in shares:
        held, most = np.zeros_like(rows.force), []
        for k in range(int(fold.max()) + 1):
            others = np.unique(rows.case[fold != k])
            few = max(1, round(share * len(others)))
            drawn = np.random.default_rng(seed + k).permutation(others)[:few]
            some = rows.take(np.flatnonzero(np.isin(rows.case, drawn)))
            out = np.flatnonzero(fold == k)
            trial = fit(some, kind, chosen, gate, seed=seed, epochs=epochs, hidden=hidden)
            held[out] = force_of(trial, rows.take(out))
            most.append(few)
        s = score_of(rows, held)
        wanted = ("drift_r2", "kept_r2", "kept_rms")
        points.append({"cases": float(np.mean(most)), **{name: s[name] for name in wanted}})
    return points
