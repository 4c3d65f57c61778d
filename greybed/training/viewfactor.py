"""Training of view-factor closures: data set -> fit -> closure with its card."""

from __future__ import annotations

from typing import Any

import numpy as np

from greybed._version import __version__
from greybed.closures.viewfactor import MARKER_SETS, MarkerSet, ViewFactorClosure
from greybed.closures.viewfactor.closure import Domain
from greybed.closures.viewfactor.limits import check_limits
from greybed.core import InputError
from greybed.core.progress import progress
from greybed.datasets.beds import SPLITS
from greybed.datasets.viewfactor import MOST_SEED, ViewFactorData
from greybed.training.regimes import regimes
from greybed.training.rows import Rows
from greybed.training.score import score

MOST_ROWS = 250_000
MOST_EPOCHS = 100_000
# Passes over the training rows, and how many rows a fit sees at least in all of them.
LEAST_EPOCHS = 40
ROWS_TO_SEE = 2_400_000


def rows_for(data: ViewFactorData, markers: MarkerSet) -> ViewFactorData:
    """The rows of a data set that a marker set is for: pairs of spheres, or spheres and walls."""
    if markers.quantity == "viewfactor":
        return data
    rows = data.walls if markers.quantity == "wallfactor" else data.exchange
    nothing = {name: np.empty(0) for name in (*markers.names, "exact", "factor", "stderr")}
    none = ViewFactorData(nothing, np.empty(0, np.int64), data.packings)
    return none if rows is None else rows


def epochs_for(rows: int) -> int:
    """Passes over so many training rows: 40, and more of them where the rows are few.

    A fit needs steps: with 40 passes over 4,000 rows to walls, small factors came out high.
    """
    return max(LEAST_EPOCHS, min(600, -(-ROWS_TO_SEE // rows)))


def train(
    data: ViewFactorData,
    kind: str = "mlp",
    markers: str = "pencil",
    *,
    seed: int = 0,
    epochs: int | None = None,
    show_progress: bool = False,
) -> ViewFactorClosure:
    """Train a closure; the score on the held-out packings is in its card.

    Parameters
    ----------
    data : ViewFactorData
        Data set with the splits ``train``, ``calibrate`` and ``test``.
    kind : str
        ``mlp`` or ``forest``.
    markers : str
        ``pencil`` or ``published`` for pairs of spheres, ``wall`` for spheres and walls,
        ``exchange`` for exchange factors of pairs.
    seed : int
        Seed of the fit.
    epochs : int, optional
        Passes of the network over the training rows [-]; by default :func:`epochs_for` so many.
    show_progress : bool
        Draw a progress bar.

    Raises
    ------
    InputError
        If a number is out of range, or a split has no packing or too few rows to fit.
    """
    if not 0 <= seed <= MOST_SEED:
        raise InputError(f"seed = {seed} [-] must lie in 0 ... {MOST_SEED}; mend it.")
    if epochs is not None and not 1 <= epochs <= MOST_EPOCHS:
        raise InputError(f"epochs = {epochs} [-] must lie in 1 ... {MOST_EPOCHS}; mend it.")
    marker_set = MARKER_SETS[markers]
    data, beds = rows_for(data, marker_set), ""
    if marker_set.quantity == "wallfactor":
        beds = "walled "
    for split in SPLITS:
        if data.in_split(split).sum() < 100:
            raise InputError(
                f"the data set has {int(data.in_split(split).sum())} {beds}rows in the split "
                f"{split!r}, at least 100 are needed; add {beds}packings with split = {split!r}."
            )
    fitted = Rows.of(data, marker_set, "train", MOST_ROWS, seed)
    held = Rows.of(data, marker_set, "calibrate", MOST_ROWS, seed)
    predictor: Any
    if kind == "mlp":
        from greybed.training.network import fit_network

        epochs = epochs_for(len(fitted)) if epochs is None else epochs
        label = f"training {kind} on {markers} markers"
        with progress(epochs, label, show=show_progress) as advance:
            predictor = fit_network(fitted, held, seed=seed, epochs=epochs, on_epoch=advance)
    else:
        from greybed.training.forest import fit_forest

        predictor = fit_forest(fitted, held, seed=seed)
    closure = ViewFactorClosure(marker_set, predictor, Domain.of(fitted.features))
    closure.card.update(
        {
            "title": f"{marker_set.quantity}, {kind}, {markers} markers",
            "data_sha256": data.digest,
            "seed": seed,
            "greybed": __version__,
            "packings": {s: sum(p["split"] == s for p in data.packings) for s in SPLITS},
            "solid_fractions": sorted({float(p["fraction"]) for p in data.packings}),
            "sizes": sorted({str(p.get("sizes", "mono")) for p in data.packings}),
            "kinds": sorted({str(p.get("kind", "random")) for p in data.packings}),
            "ranges": {
                name: [float(low), float(high)]
                for name, low, high in zip(
                    marker_set.feature_names,
                    np.min(fitted.features, axis=0),
                    np.max(fitted.features, axis=0),
                    strict=True,
                )
            },
            "rows": len(fitted),
            "score": score(closure, data),
            "regimes": regimes(closure, data),
            "limits": {case.name: case.error for case in check_limits(closure)},
        }
    )
    return closure
