"""Screening: a two-level fraction, ANOVA, a central composite design of what is active."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from greybed.calibration.anova import active_factors, anova
from greybed.calibration.designs import central_composite, fractional_factorial
from greybed.calibration.metamodel import rows_of
from greybed.calibration.search import Search
from greybed.core.errors import InputError

Array = NDArray[np.float64]

CENTRES = 3


def screening(search: Search) -> None:
    """Find the active parameters, fit quadratic surfaces to them, and check the optimum.

    The ends of the two-level design are at a tenth from the ends of the ranges. Parameters that
    move no measure stay at the middle of their ranges in what follows.

    Raises
    ------
    InputError
        If there are too few runs for the designs, or nothing is active.
    """
    study, space = search.study, search.study.space
    d, names = len(space), study.with_role("calibration")
    fraction, resolution = fractional_factorial(d)
    points = np.concatenate([fraction, np.full((CENTRES, d), 0.5)])
    _check_room(search, len(points), f"a two-level design of {d} parameters")
    search.everywhere(points[: len(fraction)], study.options.replicates)
    for k in range(CENTRES):
        search.make((name, points[-1], study.options.replicates + k) for name in names)
    tables = {}
    for target in study.targets:
        if study.roles[target.experiment] != "calibration" or target.at is not None:
            continue
        rows = rows_of(space, search.campaign.finished, target.experiment)
        y = np.array([float(r[target.measure]) for r in rows.results])  # type: ignore[arg-type]
        tables[target.label] = anova(rows.points, y, space.names)
    if not tables:
        raise InputError("screening needs a scalar measure; curves have no table of variances.")
    active = active_factors(list(tables.values()))
    search.extra["anova"] = tables
    search.extra["resolution"] = resolution
    search.extra["active"] = [space.names[k] for k in active]
    if not active:
        raise InputError(
            f"none of {', '.join(space.names)} moves a measure beyond its scatter over "
            f"{len(points)} runs; widen the ranges, take replicates, or measure something else."
        )
    search.axes = active
    search.notes.append(
        f"Two-level design of {len(fraction)} points (resolution {resolution}): active are "
        f"{', '.join(space.names[k] for k in active)}."
    )
    composite = central_composite(len(active), centres=CENTRES)
    second = np.full((len(composite), d), 0.5)
    second[:, active] = composite
    _check_room(search, len(second), f"a central composite design of {len(active)} parameters")
    search.everywhere(second[:-CENTRES])
    first = CENTRES + study.options.replicates
    for k in range(CENTRES):
        search.make((name, second[-1], first + k) for name in names)
    _check_optimum(search)


def _check_optimum(search: Search) -> None:
    """Runs at the best set, until it lies within the errors of the data or runs are spent."""
    from greybed.calibration.best import best_point

    replicate = 0
    while search.left >= len(search.study.with_role("calibration")):
        model = search.fit()
        best = best_point(model, search.study.options.seed)
        for k in range(len(best)):
            if search.axes is not None and k not in search.axes:
                best[k] = 0.5
        outcomes = search.make(
            (name, best, 1000 + replicate) for name in search.study.with_role("calibration")
        )
        replicate += 1
        found = {o.experiment: o.results for o in outcomes}
        off = []
        for target in search.study.targets:
            results = found.get(target.experiment)
            if results is None or target.at is not None:
                continue
            value = float(results[target.measure])  # type: ignore[arg-type]
            off.append(abs(value - float(target.value[0])) / float(target.sd[0]))
        if off and max(off) <= 1.0:
            search.notes.append(
                f"Run {search.campaign.spent} at the optimum lies within one standard deviation of "
                "every measured value, where the search ended."
            )
            return
        if replicate >= 10:
            break
    search.notes.append(
        "No run at the optimum lies within one standard deviation of every measured value."
    )


def _check_room(search: Search, points: int, what: str) -> None:
    each = len(search.study.with_role("calibration"))
    if search.left < points * each:
        raise InputError(
            f"{search.left} runs are left and {what} needs {points * each}; raise runs, or fix a "
            "parameter."
        )
