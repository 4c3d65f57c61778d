"""Fit of the two-headed network with torch: the value, then, on other packings, its spread."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray

from greybed.closures.predictors import Network
from greybed.closures.viewfactor.visibility import ODDS_BOUND, SPREAD_BOUND
from greybed.training.rows import Rows

Array = NDArray[np.float64]

HIDDEN = (24, 24)
BATCH = 8192
LEAST_BATCH = 256
LEARNING_RATE = 4e-3


def fit_network(
    train: Rows,
    calibrate: Rows,
    *,
    seed: int,
    epochs: int = 40,
    on_epoch: Callable[[int], object] = lambda step: None,
) -> Network:
    """Fit a network to rows.

    Parameters
    ----------
    train, calibrate : Rows
        Rows of different packings: the spread is learnt where the value was not.
    seed : int
        Seed of the initial weights and of the order of the rows.
    epochs : int
        Passes over ``train`` [-].
    on_epoch : callable
        Called with 1 after each pass.

    Returns
    -------
    Network
    """
    # One thread: the sums of a batch keep their order, so a seed gives the same bits anywhere.
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        start = Network.random(train.features.shape[1], HIDDEN, seed)
        mean, scale = train.features.mean(axis=0), train.features.std(axis=0)
        # A feature that never varies, as the solid fraction of a single packing, says nothing.
        scale = np.where(scale > 1e-12 * (1.0 + np.abs(mean)), scale, 1.0)
        # No correction to begin with: what the rows say nothing of stays at the baseline.
        start.weights[-1][:, 0] = 0.0
        weights = [torch.tensor(w, requires_grad=True) for w in start.weights]
        biases = [torch.tensor(b, requires_grad=True) for b in start.biases]
        _fit_value(train, mean, scale, weights, biases, seed, epochs, on_epoch)
        _fit_spread(calibrate, mean, scale, weights, biases)
    finally:
        torch.set_num_threads(threads)
    return Network(
        mean,
        scale,
        tuple(w.detach().numpy().copy() for w in weights),
        tuple(b.detach().numpy().copy() for b in biases),
    )


def _tensors(rows: Rows, mean: Array, scale: Array) -> dict[str, torch.Tensor]:
    return {
        "x": torch.tensor((rows.features - mean) / scale),
        "exact": torch.tensor(rows.exact),
        "gate": torch.tensor(rows.gate),
        "baseline": torch.tensor(rows.baseline),
        "factor": torch.tensor(rows.factor),
        "stderr": torch.tensor(rows.stderr),
        "weight": torch.tensor(rows.weight / rows.noise**2),
    }


def _trunk(
    x: torch.Tensor, weights: list[torch.Tensor], biases: list[torch.Tensor]
) -> torch.Tensor:
    for weight, bias in zip(weights[:-1], biases[:-1], strict=True):
        x = torch.tanh(x @ weight + bias)
    return x


def _factor(t: dict[str, torch.Tensor], raw: torch.Tensor) -> torch.Tensor:
    odds = torch.exp(ODDS_BOUND * torch.tanh(raw))
    share = t["baseline"] * odds / (1.0 - t["baseline"] + t["baseline"] * odds)
    return t["exact"] * (1.0 - t["gate"] * (1.0 - share))


def _fit_value(
    rows: Rows,
    mean: Array,
    scale: Array,
    weights: list[torch.Tensor],
    biases: list[torch.Tensor],
    seed: int,
    epochs: int,
    on_epoch: Callable[[int], object],
) -> None:
    t = _tensors(rows, mean, scale)
    generator = torch.Generator().manual_seed(seed)
    optimiser = torch.optim.Adam([*weights, *biases], lr=LEARNING_RATE)
    # Few rows in smaller batches: a fit needs steps, not only rows.
    batches = max(1, min(len(rows) // LEAST_BATCH, 8), -(-len(rows) // BATCH))
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, LEARNING_RATE, total_steps=epochs * batches
    )
    for _ in range(epochs):
        for index in torch.randperm(len(rows), generator=generator).chunk(batches):
            batch = {name: value[index] for name, value in t.items()}
            raw = _trunk(batch["x"], weights, biases) @ weights[-1] + biases[-1]
            error = _factor(batch, raw[:, 0]) - batch["factor"]
            loss = (batch["weight"] * error**2).sum() / batch["weight"].sum()
            optimiser.zero_grad()
            # Scaled to order one: Adam's floor of 1e-8 must not drown errors of 1e-4 squared.
            (1e6 * loss).backward()
            optimiser.step()
            schedule.step()
        on_epoch(1)


def _fit_spread(
    rows: Rows,
    mean: Array,
    scale: Array,
    weights: list[torch.Tensor],
    biases: list[torch.Tensor],
) -> None:
    """Fit the second output by maximum likelihood of the residuals, everything else held."""
    t = _tensors(rows, mean, scale)
    with torch.no_grad():
        trunk = _trunk(t["x"], weights, biases)
        raw = trunk @ weights[-1] + biases[-1]
        error2 = (_factor(t, raw[:, 0]) - t["factor"]) ** 2
        weights[-1][:, 1] = 0.0
        biases[-1][1] = -4.0
    column = weights[-1][:, 1].detach().clone().requires_grad_(True)
    bias = biases[-1][1].detach().clone().requires_grad_(True)
    weight = torch.tensor(rows.weight / rows.weight.sum())
    optimiser = torch.optim.LBFGS([column, bias], max_iter=200, line_search_fn="strong_wolfe")

    def closure() -> torch.Tensor:
        optimiser.zero_grad()
        own = t["exact"] * t["gate"] * SPREAD_BOUND * torch.sigmoid(trunk @ column + bias)
        variance = own**2 + t["stderr"] ** 2
        loss = (weight * (error2 / variance + torch.log(variance))).sum()
        # A slight pull to zero keeps the spread tame where few rows speak.
        loss = loss + 1e-4 * (column**2).sum()
        loss.backward()
        return loss

    optimiser.step(closure)
    with torch.no_grad():
        weights[-1][:, 1] = column
        biases[-1][1] = bias
