"""Learning curve: the score on held-out packings against the number of packings to train on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from greybed.closures.viewfactor import MARKER_SETS
from greybed.core import InputError
from greybed.datasets.viewfactor import ViewFactorData
from greybed.training.regimes import own_error
from greybed.training.viewfactor import rows_for, train

SHARES = (0.125, 0.25, 0.5, 1.0)


def part_of(data: ViewFactorData, packings: int, seed: int = 0) -> ViewFactorData:
    """The data set with so many of its training packings, drawn at random; all others stay."""
    fitted = [k for k, p in enumerate(data.packings) if p["split"] == "train"]
    # The walled ones are few and must not all be left out: each kind in its turn.
    rng = np.random.default_rng(seed)
    drawn: list[int] = rng.permutation(fitted).tolist()
    kept = set(drawn[:packings]) | (set(range(len(data.packings))) - set(fitted))

    def some(rows: ViewFactorData) -> ViewFactorData:
        chosen = np.isin(rows.packing, sorted(kept))
        columns = {name: column[chosen] for name, column in rows.columns.items()}
        walls = None if rows.walls is None else some(rows.walls)
        grey = None if rows.exchange is None else some(rows.exchange)
        return ViewFactorData(columns, rows.packing[chosen], rows.packings, walls, grey)

    return some(data)


def learning_curve(
    data: ViewFactorData,
    kind: str,
    markers: str,
    *,
    shares: Sequence[float] = SHARES,
    seed: int = 0,
    epochs: int | None = None,
) -> list[dict[str, Any]]:
    """Train on growing parts of the training packings and score on the same held-out ones.

    Parameters
    ----------
    data, kind, markers, seed, epochs
        As for :func:`greybed.training.train`.
    shares : sequence of float
        Shares of the training packings, above 0 and at most 1 [-].

    Returns
    -------
    list of dict
        ``packings``, ``rows``, ``rmse`` (the trace's noise taken out, pairs with F > 1e-4) and
        ``r2`` for each part, by growing number.
    """
    table = rows_for(data, MARKER_SETS[markers])
    fitted = np.unique(table.packing[table.in_split("train")])
    inside = [k for k, p in enumerate(data.packings) if p["split"] != "train" or k in fitted]
    packings = [p if k in inside else {**p, "split": "unused"} for k, p in enumerate(data.packings)]
    beside = [
        None if rows is None else ViewFactorData(rows.columns, rows.packing, packings)
        for rows in (data.walls, data.exchange)
    ]
    data = ViewFactorData(data.columns, data.packing, packings, *beside)
    points: list[dict[str, Any]] = []
    for number in sorted({max(1, round(share * len(fitted))) for share in shares}):
        try:
            closure = train(part_of(data, number, seed), kind, markers, seed=seed, epochs=epochs)
        except InputError:  # too few rows in so few packings
            continue
        rows = rows_for(data, MARKER_SETS[markers])
        test = rows.in_split("test") & (rows.columns["factor"] > 1e-4)
        c = {name: column[test] for name, column in rows.columns.items()}
        error = closure.evaluate(**{n: c[n] for n in closure.marker_names}) - c["factor"]
        points.append(
            {
                "packings": number,
                "rows": closure.card["rows"],
                "rmse": own_error(error, c["stderr"], c["weight"]),
                "r2": closure.card["score"]["r2"],
            }
        )
    return points
