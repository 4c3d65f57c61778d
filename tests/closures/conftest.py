"""Closures for the tests: untrained ones, and ones fitted to a small synthetic truth."""

import numpy as np
import pytest

from greybed.closures import ViewFactorClosure
from greybed.closures.viewfactor import MARKER_SETS
from greybed.closures.viewfactor.closure import Domain
from greybed.closures.viewfactor.limits import random_markers
from greybed.core.exact import pair_factor
from greybed.training.forest import fit_forest
from greybed.training.network import fit_network
from greybed.training.rows import Rows

FORMS = [(kind, markers) for kind in ("mlp", "forest") for markers in ("pencil", "published")]


def synthetic_rows(markers: str, n: int, seed: int) -> Rows:
    """Rows whose visibility follows a known law with noise: quick, and nothing like the prior."""
    closure = ViewFactorClosure.untrained("mlp", markers)
    m = random_markers(closure, n, seed)
    marker_set = MARKER_SETS[markers]
    exact = pair_factor(m["radius_over_distance"], m["radius_ratio"])
    gate = marker_set.gate(m)
    odds = np.exp(1.5 + 1.5 * np.sin(6.0 * marker_set.features(m)[:, 0]))
    prior = marker_set.baseline(m)
    visible = 1.0 - gate * (1.0 - prior * odds / (1.0 - prior + prior * odds))
    noise = 0.02 * exact
    rng = np.random.default_rng(seed + 1)
    factor = exact * visible + noise * rng.standard_normal(n)
    keep = gate > 0.0
    return Rows(
        marker_set.features(m)[keep],
        gate[keep],
        marker_set.baseline(m)[keep],
        exact[keep],
        factor[keep],
        noise[keep],
        np.ones(keep.sum()),
    )


@pytest.fixture(scope="session", params=FORMS, ids=[f"{k}-{m}" for k, m in FORMS])
def form(request):
    """(kind, markers) of a closure."""
    return request.param


@pytest.fixture(scope="session")
def fitted(form):
    """A closure trained on synthetic rows."""
    kind, markers = form
    train, held = synthetic_rows(markers, 4000, 1), synthetic_rows(markers, 2000, 2)
    if kind == "mlp":
        predictor = fit_network(train, held, seed=3, epochs=60)
    else:
        predictor = fit_forest(train, held, seed=3)
    return ViewFactorClosure(MARKER_SETS[markers], predictor, Domain.of(train.features))
