"""Predictors without torch or scikit-learn: a small network, a forest in arrays.

Their last output is a spread; the ones before it are values, one or more.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from greybed.closures import _kernels
from greybed.core import InputError

Array = NDArray[np.float64]

# Rows of one matrix product: too few for BLAS to share them out over threads, whose number would
# change the last bits; and they stay in cache, which makes up for it.
BLOCK = 256


@dataclass(frozen=True, eq=False)
class Network:
    """Fully connected network with tanh between the layers; outputs are values, then a spread.

    A ``bent`` one has x / sqrt(1 + x^2) instead, which takes a quarter of the time of tanh.

    Attributes
    ----------
    mean, scale : (n_features,) float
        Features are shifted by ``mean`` and divided by ``scale`` first.
    weights : arrays of shape (n_in, n_out)
        One for each layer.
    biases : arrays of shape (n_out,)
        One for each layer.
    """

    kind: ClassVar[str] = "mlp"
    mean: Array
    scale: Array
    weights: tuple[Array, ...]
    biases: tuple[Array, ...]
    bent: bool = False

    def __call__(self, features: Array) -> Array:
        """Outputs (m, n_outputs) of features (m, n_features)."""
        out = np.empty((len(features), self.biases[-1].size))
        for first in range(0, len(features), BLOCK):
            some = slice(first, first + BLOCK)
            out[some] = self._outputs(features[some])
        return out

    def _outputs(self, features: Array) -> Array:
        x = (features - self.mean) / self.scale
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            x = x @ weight + bias
            if k + 1 < len(self.weights):
                x = self._squashed(x)[0]
        return x

    def _squashed(self, x: Array) -> tuple[Array, Array]:
        """What a layer makes of its sums, and the slope of it."""
        if self.bent:
            inverse = 1.0 / np.sqrt(1.0 + x * x)
            return x * inverse, inverse * inverse * inverse
        y = np.tanh(x)
        return y, 1.0 - y * y

    def with_slopes(self, features: Array) -> tuple[Array, Array]:
        """Outputs (m, n_outputs) and derivatives of the values (m, n_outputs - 1, n_features)."""
        values = self.biases[-1].size - 1
        out = np.empty((len(features), values + 1))
        slopes = np.empty((len(features), values, features.shape[1]))
        for first in range(0, len(features), BLOCK):
            some = slice(first, first + BLOCK)
            x = (features[some] - self.mean) / self.scale
            steep = []
            for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
                x, slope = self._squashed(x @ weight + bias)
                steep.append(slope)
            out[some] = x @ self.weights[-1] + self.biases[-1]
            for k in range(values):
                back = np.broadcast_to(self.weights[-1][:, k], x.shape)
                for slope, weight in zip(steep[::-1], self.weights[-2::-1], strict=True):
                    back = (back * slope) @ weight.T
                slopes[some, k] = back / self.scale
        return out, slopes

    def arrays(self) -> dict[str, NDArray]:
        """Arrays to store, by name."""
        layers = {f"weight_{k}": w for k, w in enumerate(self.weights)}
        return {
            "mean": self.mean,
            "scale": self.scale,
            **layers,
            **{f"bias_{k}": b for k, b in enumerate(self.biases)},
            **({"bent": np.array([1], np.int64)} if self.bent else {}),
        }

    @classmethod
    def from_arrays(cls, arrays: dict[str, NDArray]) -> Network:
        """Rebuild from :meth:`arrays`."""
        n = sum(name.startswith("weight_") for name in arrays)
        return cls(
            arrays["mean"],
            arrays["scale"],
            tuple(arrays[f"weight_{k}"] for k in range(n)),
            tuple(arrays[f"bias_{k}"] for k in range(n)),
            "bent" in arrays,
        )

    @classmethod
    def random(
        cls, n_features: int, hidden: tuple[int, ...] = (24, 24), seed: int = 0, outputs: int = 2,
        bent: bool = False,
    ) -> Network:  # fmt: skip
        """Untrained network with Glorot weights."""
        rng = np.random.default_rng(seed)
        sizes = (n_features, *hidden, outputs)
        weights, biases = [], []
        for n_in, n_out in pairwise(sizes):
            limit = np.sqrt(6.0 / (n_in + n_out))
            weights.append(rng.uniform(-limit, limit, (n_in, n_out)))
            biases.append(np.zeros(n_out))
        zero, one = np.zeros(n_features), np.ones(n_features)
        return cls(zero, one, tuple(weights), tuple(biases), bent)


@dataclass(frozen=True, eq=False)
class Forest:
    """Forest in flat arrays; features are compared in single precision, as scikit-learn does.

    Attributes
    ----------
    roots : (n_trees,) int32
        First node of each tree.
    feature : (n_nodes,) int32
        Feature to compare, -1 at a leaf.
    threshold : (n_nodes,) float32
        Left where the feature is at most this.
    left : (n_nodes,) int32
        Left child; the right one follows it.
    value : (n_nodes, n_outputs) float64
        Leaf values, the spread last.
    """

    kind: ClassVar[str] = "forest"
    roots: NDArray[np.int32]
    feature: NDArray[np.int32]
    threshold: NDArray[np.float32]
    left: NDArray[np.int32]
    value: Array

    def __post_init__(self) -> None:
        nodes = len(self.feature)
        inner = self.feature >= 0
        # A file must not be able to send the walk out of bounds or round in circles.
        sound = (
            len(self.threshold) == len(self.left) == len(self.value) == nodes
            and self.value.ndim == 2
            and self.value.shape[1] >= 2
            and len(self.roots) > 0
            and ((self.roots >= 0) & (self.roots < nodes)).all()
            and (self.left[inner] > np.flatnonzero(inner)).all()
            and (self.left[inner] + 1 < nodes).all()
        )
        if not sound:
            raise InputError("the forest's arrays do not form trees; train or copy it again.")

    def __call__(self, features: Array) -> Array:
        """Outputs (m, n_outputs) of features (m, n_features)."""
        out = np.empty((len(features), self.value.shape[1]))
        single = np.ascontiguousarray(features, dtype=np.float32)
        _kernels.walk_trees(
            single, self.roots, self.feature, self.threshold, self.left, self.value, out
        )
        return out

    def arrays(self) -> dict[str, NDArray]:
        """Arrays to store, by name."""
        return {
            "roots": self.roots,
            "feature": self.feature,
            "threshold": self.threshold,
            "left": self.left,
            "value": self.value,
        }

    @classmethod
    def from_arrays(cls, arrays: dict[str, NDArray]) -> Forest:
        """Rebuild from :meth:`arrays`."""
        kinds = {"roots": "i", "feature": "i", "threshold": "f", "left": "i", "value": "f"}
        for name, kind in kinds.items():
            array = arrays[name]
            if array.dtype.kind != kind or array.ndim != (2 if name == "value" else 1):
                raise ValueError(f"array {name} of type {array.dtype}, shape {array.shape}")
        return cls(*(arrays[name] for name in kinds))

    @classmethod
    def random(cls, n_features: int, trees: int = 8, seed: int = 0, outputs: int = 2) -> Forest:
        """Untrained forest: trees of depth three with random splits and leaves in (0, 1)."""
        rng = np.random.default_rng(seed)
        nodes = 15
        inner = np.arange(nodes) < 7
        feature = np.where(inner, rng.integers(0, n_features, (trees, nodes)), -1)
        left = np.where(inner, 2 * np.arange(nodes) + 1, 0) + nodes * np.arange(trees)[:, None]
        return cls(
            (nodes * np.arange(trees)).astype(np.int32),
            feature.ravel().astype(np.int32),
            rng.uniform(0.0, 1.0, trees * nodes).astype(np.float32),
            left.ravel().astype(np.int32),
            rng.uniform(0.01, 0.99, (trees * nodes, outputs)),
        )


Predictor = Network | Forest
PREDICTORS: dict[str, type[Network] | type[Forest]] = {"mlp": Network, "forest": Forest}
