"""Fit of the network of filtered drag with torch: kept fractions first, then their spread."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
import torch
from numpy.typing import NDArray

from greybed.closures.drag.filtered import Gate
from greybed.closures.drag.filtered.closure import (
    HIDDEN,
    LOG_BOUND,
    SHARE_BOUND,
    SPREAD_BOUND,
)
from greybed.closures.drag.filtered.features import DragMarkerSet
from greybed.closures.drag.filtered.force import FADE
from greybed.closures.predictors import Network
from greybed.training.drag_rows import DragRows, heard

Array = NDArray[np.float64]

BATCH = 512
LEARNING_RATE = 2e-2
# How much H itself and the drift flux across count beside that along gravity, each over its
# variance.
OF_KEPT = 0.5
OF_ACROSS = 0.3
DECAY = 1e-5
SPREAD_ROWS = 20_000


@contextmanager
def one_thread() -> Iterator[None]:
    """Torch on one thread: sums of a batch keep their order, so a seed gives the same bits."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)


def _scale(features: Array) -> tuple[Array, Array]:
    mean, scale = features.mean(axis=0), features.std(axis=0)
    # A feature that never varies, as Re of a single material, says nothing.
    return mean, np.where(scale > 1e-9 * (1.0 + np.abs(mean)), scale, 1.0)


def _bend(x: torch.Tensor, bound: float) -> torch.Tensor:
    y = x / bound
    return x / torch.sqrt(1.0 + y * y)


def _trunk(
    x: torch.Tensor, weights: list[torch.Tensor], biases: list[torch.Tensor]
) -> torch.Tensor:
    for weight, bias in zip(weights[:-1], biases[:-1], strict=True):
        x = _bend(x @ weight + bias, 1.0)
    return x


def _drift(t: dict[str, torch.Tensor], raw: torch.Tensor, linear: bool) -> torch.Tensor:
    """Drift flux (n, 3) that the outputs of a network stand for."""
    gate = t["gate"][:, None]
    kept = torch.exp(gate * _bend(raw[:, :2], LOG_BOUND))
    slip = torch.stack(
        [kept[:, 0] * t["slip"][:, 0], kept[:, 1] * t["slip"][:, 1], kept[:, 1] * t["slip"][:, 2]],
        dim=1,
    )  # of the force over beta
    if linear:
        whole = t["gate"] * SHARE_BOUND * torch.sigmoid(raw[:, 2])
        pull = t["pull"]
        work = (slip * t["slip"]).sum(dim=1)
        against = (pull * t["slip"]).sum(dim=1)
        root = torch.sqrt(against**2 + FADE**2 * (pull**2).sum(dim=1) + 1e-30)
        opposing = 0.5 * (root - against)
        share = (whole * work / (work + whole * opposing + 1e-30))[:, None]
        slip = (1.0 - share) * slip + share * pull
    return t["phi"][:, None] * (slip - t["slip"])


def _tensors(rows: DragRows, features: Array, gate: Array) -> dict[str, torch.Tensor]:
    clean = rows.clean
    kept = np.where(clean, rows.kept, 1.0)
    named = {
        "x": features,
        "gate": gate,
        "phi": rows.markers["solid_fraction"],
        "slip": rows.slip,
        "pull": rows.pull / rows.lead[:, None],
        "drift": rows.drift(rows.force),
        "kept": kept,
        "clean": clean.astype(np.float64),
    }
    return {name: torch.tensor(value) for name, value in named.items()}


def fit_drag_network(
    rows: DragRows,
    chosen: DragMarkerSet,
    gate: Gate,
    *,
    seed: int,
    epochs: int,
    hidden: tuple[int, ...] = HIDDEN,
    on_epoch: Callable[[int], object] = lambda step: None,
) -> Network:
    """Fit the kept fractions; the spread stays at its start, see :func:`with_spread`.

    Parameters
    ----------
    rows : DragRows
        To fit.
    chosen : DragMarkerSet
        Markers.
    gate : Gate
        Of the closure.
    seed : int
        Of weights and order of rows.
    epochs : int
        Passes over the rows [-].
    hidden : tuple of int
        Neurons of each layer.
    on_epoch : callable
        Called with 1 after each pass.
    """
    features = chosen.features(rows.of(chosen))
    mean, scale = _scale(features)
    start = Network.random(features.shape[1], hidden, seed, chosen.outputs, bent=True)
    # No correction to begin with.
    start.weights[-1][:, :] *= 0.1
    used = heard(features)
    start.weights[0][~used] = 0.0  # and stays: the feature is 0 in all rows that follow
    opening = gate(rows.markers["solid_fraction"], rows.markers["filter_size"])
    linear = chosen.linear
    with one_thread():
        t = _tensors(rows, (features - mean) / scale * used, opening)
        # What each part of the loss is measured in: its variance.
        of_drift = float(t["drift"][:, 0].var()) + 1e-12
        of_across = float(t["drift"][:, 1:].var(dim=0).sum()) + 0.01 * of_drift
        clean = t["clean"] > 0.0
        of_kept = float(t["kept"][clean].var()) + 1e-12
        weights = [torch.tensor(w, requires_grad=True) for w in start.weights]
        biases = [torch.tensor(b, requires_grad=True) for b in start.biases]
        generator = torch.Generator().manual_seed(seed)
        optimiser = torch.optim.Adam([*weights, *biases], lr=LEARNING_RATE)
        batches = max(1, -(-len(rows) // BATCH))
        schedule = torch.optim.lr_scheduler.OneCycleLR(
            optimiser, LEARNING_RATE, total_steps=epochs * batches
        )
        for _ in range(epochs):
            for index in torch.randperm(len(rows), generator=generator).chunk(batches):
                b = {name: value[index] for name, value in t.items()}
                raw = _trunk(b["x"], weights, biases) @ weights[-1] + biases[-1]
                drift = _drift(b, raw, linear)
                square = ((drift - b["drift"]) ** 2).mean(dim=0)
                loss = square[0] / of_drift + OF_ACROSS * square[1:].sum() / of_across
                fast = torch.where(b["clean"] > 0.0, b["slip"][:, 0] * b["phi"], 1.0)
                kept = 1.0 + drift[:, 0] / fast
                off = b["clean"] * (kept - b["kept"]) ** 2
                loss = loss + OF_KEPT * off.mean() / of_kept
                loss = loss + DECAY * sum((w**2).sum() for w in weights)
                optimiser.zero_grad()
                loss.backward()
                optimiser.step()
                schedule.step()
            on_epoch(1)
    return Network(
        mean,
        scale,
        tuple(w.detach().numpy().copy() for w in weights),
        tuple(b.detach().numpy().copy() for b in biases),
        bent=True,
    )


def with_spread(
    network: Network, rows: DragRows, kept: Array, chosen: DragMarkerSet, gate: Gate, seed: int
) -> Network:
    """Fit the spread, by likelihood, to errors on cases that were held out.

    Parameters
    ----------
    network : Network
        Whose other outputs stay as they are.
    rows : DragRows
        Rows of all cases.
    kept : (n,) array
        H along gravity that fits without the row's case gave [-].
    """
    opening = gate(rows.markers["solid_fraction"], rows.markers["filter_size"])
    index = np.flatnonzero(rows.clean & (opening > 0.01))
    if len(index) > SPREAD_ROWS:
        index = np.sort(np.random.default_rng(seed).choice(index, SPREAD_ROWS, replace=False))
    some = rows.take(index)
    mine = np.maximum(kept[index], np.exp(-LOG_BOUND))
    error2 = np.square((some.kept - mine) / (mine * opening[index]))
    features = chosen.features(some.of(chosen))
    with one_thread():
        x = torch.tensor((features - network.mean) / network.scale)
        weights = [torch.tensor(w) for w in network.weights]
        biases = [torch.tensor(b) for b in network.biases]
        trunk = _trunk(x, weights, biases)
        column = torch.zeros(trunk.shape[1], dtype=torch.float64, requires_grad=True)
        bias = torch.full((), -1.0, dtype=torch.float64, requires_grad=True)
        # One error in a hundred must not set the width of all.
        square = torch.tensor(np.minimum(error2, np.quantile(error2, 0.99)))
        optimiser = torch.optim.LBFGS([column, bias], max_iter=200, line_search_fn="strong_wolfe")

        def closure() -> torch.Tensor:
            optimiser.zero_grad()
            own = SPREAD_BOUND * torch.sigmoid(trunk @ column + bias)
            variance = own**2 + 1e-8
            loss = (square / variance + torch.log(variance)).mean() + 1e-4 * (column**2).sum()
            loss.backward()
            return loss

        optimiser.step(closure)
        last, shift = network.weights[-1].copy(), network.biases[-1].copy()
        last[:, -1], shift[-1] = column.detach().numpy(), float(bias.detach())
    return Network(
        network.mean, network.scale, (*network.weights[:-1], last), (*network.biases[:-1], shift),
        bent=True,
    )  # fmt: skip
