"""Isoline bands: where each measure fits within its errors, and where all of them do.

Source paper 001, figures 1.3 and 1.5: a measure that a simulation reproduces is a line in the plane
of two parameters, its errors make a band of it, and the parameters are where the bands overlap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.calibration.metamodel import Metamodel

Array = NDArray[np.float64]

# Half a band in standard deviations.
WIDTH = 2.0
GRID = 61
_POINTS = 8192


@dataclass(frozen=True)
class Bands:
    """Bands in the plane of two parameters, the others at the best set.

    Attributes
    ----------
    axes : (int, int)
        Numbers of the parameters.
    x, y : ndarray (g,)
        Their values [SI].
    pulls : mapping of str to ndarray (g, g)
        Distance of each measure from its measured value in standard deviations, rows along y [-].
    values : mapping of str to ndarray (g, g)
        Mean of each scalar measure, in its unit.
    """

    axes: tuple[int, int]
    x: Array
    y: Array
    pulls: dict[str, Array]
    values: dict[str, Array]


def pull(model: Metamodel, index: int, u: Array) -> Array:
    """Distance of one measure from its measured value in standard deviations, (n,) [-]."""
    emulator = model.emulators[index]
    size, _ = emulator.misfit(u)
    return np.asarray(np.sqrt(size / len(emulator.surrogates)))


def bands(model: Metamodel, best: Array, axes: tuple[int, int]) -> Bands:
    """Bands of all measures over two axes.

    Parameters
    ----------
    model : Metamodel
        Surrogates.
    best : ndarray (d,)
        Where the other parameters stand, in the unit cube [-].
    axes : (int, int)
        The two.
    """
    ticks = np.linspace(0.0, 1.0, GRID)
    u = np.tile(best, (GRID * GRID, 1))
    u[:, axes[0]], u[:, axes[1]] = np.tile(ticks, GRID), np.repeat(ticks, GRID)
    space = model.space
    line = np.tile(best, (GRID, 1))
    line[:, axes[0]] = ticks
    x = space.values(line)[:, axes[0]]
    line = np.tile(best, (GRID, 1))
    line[:, axes[1]] = ticks
    y = space.values(line)[:, axes[1]]
    pulls, values = {}, {}
    for k, emulator in enumerate(model.emulators):
        label = emulator.response.label
        pulls[label] = pull(model, k, u).reshape(GRID, GRID)
        if emulator.response.shapes is None:
            values[label] = emulator.predict(u)[0][:, 0].reshape(GRID, GRID)
    return Bands(axes, x, y, pulls, values)


@dataclass(frozen=True)
class Overlap:
    """Shares of the prior where measures fit within their errors.

    Attributes
    ----------
    alone : mapping of str to float
        Each measure by itself [-].
    without : mapping of str to float
        All but one: what a measure cuts away is its difference from ``together`` [-].
    together : float
        All of them [-].
    points : int
        Points that these are counted from [-].
    """

    alone: dict[str, float]
    without: dict[str, float]
    together: float
    points: int


def overlap(model: Metamodel) -> Overlap:
    """Count points of the prior within the bands, in all dimensions."""
    u = model.space.draw(_POINTS, model.study.options.seed)
    inside = {e.response.label: pull(model, k, u) < WIDTH for k, e in enumerate(model.emulators)}
    everything = np.ones(len(u), bool)
    for mask in inside.values():
        everything &= mask
    without = {}
    for label in inside:
        rest = np.ones(len(u), bool)
        for other, mask in inside.items():
            if other != label:
                rest &= mask
        without[label] = float(rest.mean())
    return Overlap(
        {k: float(v.mean()) for k, v in inside.items()}, without, float(everything.mean()), len(u)
    )
