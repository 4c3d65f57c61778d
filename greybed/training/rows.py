"""Rows of a data set as a fit needs them: features, gate, baseline, target, noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.closures.viewfactor import MarkerSet
from greybed.datasets.viewfactor import ViewFactorData

Array = NDArray[np.float64]

# Model error that the fit should not try to beat, absolute and relative to the exact factor:
# without it the best-traced, faintest pairs would take the whole fit.
MODEL_ERROR = (1e-3, 0.01)


@dataclass(frozen=True, eq=False)
class Rows:
    """Arrays of equal length; only pairs with something in between (gate above zero)."""

    features: Array
    gate: Array
    baseline: Array
    exact: Array
    factor: Array
    stderr: Array
    weight: Array

    def __len__(self) -> int:
        return len(self.gate)

    @property
    def noise(self) -> Array:
        """Error expected of a perfect fit: the trace's and the model's own [-]."""
        floor, relative = MODEL_ERROR
        return np.sqrt(self.stderr**2 + floor**2 + (relative * self.exact) ** 2)

    @classmethod
    def of(cls, data: ViewFactorData, markers: MarkerSet, split: str, most: int, seed: int) -> Rows:
        """Rows of one split, at most ``most`` of them, drawn evenly."""
        index = np.flatnonzero(data.in_split(split))
        m = {name: data.columns[name][index] for name in markers.names}
        gate = markers.gate(m)
        index = index[gate > 0.0]
        if len(index) > most:
            index = np.sort(np.random.default_rng(seed).choice(index, most, replace=False))
        m = {name: data.columns[name][index] for name in markers.names}
        c = data.columns
        return cls(
            markers.features(m),
            markers.gate(m),
            markers.baseline(m),
            c["exact"][index],
            c["factor"][index],
            c["stderr"][index],
            c["weight"][index],
        )
