"""A closure of filtered drag as one C++11 header: kept fractions, force and its derivative."""

from __future__ import annotations

import os
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from greybed.closures import FilteredDragClosure, golden_rows
from greybed.closures.drag.filtered import features as shape
from greybed.closures.drag.filtered.closure import (
    LOG_BOUND,
    PARCEL_RATE,
    SHARE_BOUND,
    SPREAD_BOUND,
)
from greybed.closures.drag.filtered.force import FADE
from greybed.closures.predictors import Network
from greybed.core import InputError
from greybed.core.files import atomic_path, output_folder
from greybed.export.cpp import CMAKE, TOLERANCE, environment
from greybed.export.metadata import (
    LICENCE,
    QUANTITIES,
    allowed,
    dataset_hash,
    describe,
    export_name,
)
from greybed.export.tables import Table, checksum, doubles, finite, forest_tables, network_tables

# Numbers of the features, by the names that the template has for them.
SMALL = {
    "dilute": shape.DILUTE,
    "filter": shape.SMALL_FILTER,
    "across": shape.SMALL_ACROSS,
    "slip2": shape.SMALL_SLIP2,
    "fraction": shape.SMALL_FRACTION,
    "ratio": shape.SMALL_RATIO,
    "slip_bend": shape.SLIP_BEND,
    "gradient_bend": shape.GRADIENT_BEND,
}


def _predictor_tables(closure: FilteredDragClosure) -> tuple[list[Table], list[tuple[int, int]]]:
    predictor = closure.predictor
    if not isinstance(predictor, Network):
        return forest_tables(predictor), []
    sizes = [len(predictor.mean), *(len(bias) for bias in predictor.biases)]
    hidden = sizes[1:-1]
    if not (predictor.bent and hidden) or any(width % 4 for width in hidden):
        raise InputError(
            f"the network's layers of {hidden} neurons must be bent and multiples of 4 for a "
            "header; train it again with such layers."
        )
    last, first = predictor.weights[-1], predictor.weights[0]
    tables = [t for t in network_tables(predictor) if t.name != f"weight_{len(sizes) - 2}"]
    # Turned, so that the way back runs along memory too; of the features only those that the slip
    # moves, four numbers each.
    for k, weight in enumerate(predictor.weights[1:-1], start=1):
        tables.append(doubles(f"turned_{k}", np.ascontiguousarray(weight.T)))
    inward = np.zeros((hidden[0], 4))
    moved = (first / predictor.scale[:, None])[4:8].T
    inward[:, : moved.shape[1]] = moved
    tables += [doubles("last", np.ascontiguousarray(last.T)), doubles("inward", inward)]
    return tables, list(pairwise(sizes))


def _context(closure: FilteredDragClosure, name: str) -> dict[str, Any]:
    domain, chosen = closure.domain, closure.markers
    with np.errstate(over="ignore"):
        limit2 = float(finite(np.float64(domain.limit) ** 2))
    own, layers = _predictor_tables(closure)
    n = len(domain.low)
    tables = [
        doubles("domain_low", finite(domain.low)),
        doubles("domain_high", finite(domain.high)),
        doubles("domain_centre", domain.centre),
        doubles("domain_precision", np.pad(domain.precision, ((0, 0), (0, -n % 4)))),
        *own,
    ]
    inputs, outputs = golden_rows(closure)
    return {
        "meta": describe(closure, name),
        "name": name,
        "guard": f"GREYBED_{name.upper()}_HPP",
        "kind": closure.kind,
        "quantity": QUANTITIES[closure.quantity],
        "law": closure.card.get("law", "of none, for it is untrained"),
        "markers": chosen.markers,
        "allowed": allowed,
        "features": [(label, "") for label in chosen.feature_names],
        "gradient": chosen.marked,
        "pressure": chosen.pressure,
        "outputs": chosen.outputs,
        "gate": {k: repr(v) for k, v in vars(closure.gate).items()},
        "small": {k: repr(v) for k, v in SMALL.items()},
        "log_bound": repr(LOG_BOUND),
        "spread_bound": repr(SPREAD_BOUND),
        "share_bound": repr(SHARE_BOUND),
        "parcel_rate": repr(PARCEL_RATE),
        "fade": repr(FADE),
        "limit2": repr(limit2),
        "columns": n + -n % 4,
        "layers": layers,
        "tables": tables,
        "golden": [doubles("golden_markers", inputs), doubles("golden_answers", outputs)],
        "rows": len(inputs),
        "tolerance": repr(TOLERANCE),
        "checksum": f"0x{checksum(tables):016x}ULL",
        "dataset_hash": dataset_hash(closure),
        "licence": LICENCE,
    }


def export_drag_cpp(
    closure: FilteredDragClosure, folder: str | os.PathLike[str], name: str | None = None
) -> Path:
    """Write ``NAME.hpp``, ``NAME_test.cpp``, ``CMakeLists.txt`` and ``README.md``.

    Parameters
    ----------
    closure : FilteredDragClosure
        What to export.
    folder : path
        Made if it does not exist.
    name : str, optional
        Namespace inside ``greybed`` and stem of the files; made from the closure by default.

    Returns
    -------
    header : Path
        C++11; ``eval_grad`` gives force and derivative, ``predict`` kept fractions,
        ``self_test`` replays the golden rows to a relative 1e-12.

    Raises
    ------
    InputError
        If the name is no C++ identifier, or the closure holds numbers that are not finite.
    OutputError
        If a file cannot be written.
    """
    word = export_name(closure, name)
    context = _context(closure, word)
    target = output_folder(folder)
    templates = {
        f"{word}.hpp": "drag.hpp",
        f"{word}_test.cpp": "drag_test.cpp",
        "README.md": "DRAG.md",
    }
    files = {k: environment().get_template(v).render(context) for k, v in templates.items()}
    files["CMakeLists.txt"] = CMAKE.format(name=word)
    for file, text in files.items():
        with atomic_path(target / file) as temporary:
            temporary.write_text(text, encoding="ascii")
    return target / f"{word}.hpp"
