"""Constant arrays of exported headers: their text, their checksum, those of each predictor."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.closures.predictors import Forest, Network
from greybed.core import InputError

LARGEST = float(np.finfo(np.float64).max)


@dataclass(frozen=True)
class Table:
    """A constant array of the header."""

    name: str
    ctype: str
    values: NDArray

    @property
    def size(self) -> int:
        """Number of entries."""
        return self.values.size

    @property
    def text(self) -> str:
        """The entries, several a line."""
        # tolist() and repr give the fewest digits that read back as the same bits.
        if self.ctype == "float":
            words = [f"{word}f" for word in map(str, self.values.ravel())]
        else:
            words = [repr(value) for value in self.values.ravel().tolist()]
        step = 16 if self.ctype.startswith("std::int") else 4
        rows = (", ".join(words[k : k + step]) for k in range(0, len(words), step))
        return ",\n      ".join(rows)

    @property
    def bits(self) -> list[int]:
        """Each entry as an unsigned 64-bit number, for the checksum."""
        flat = np.ascontiguousarray(self.values).ravel()
        if self.ctype == "double":
            return flat.view(np.uint64).tolist()
        if self.ctype == "float":
            return flat.view(np.uint32).tolist()
        return flat.astype(np.int64).view(np.uint64).tolist()


def checksum(tables: Iterable[Table]) -> int:
    """FNV-1a over 64-bit words; every step is invertible, so no single change goes unseen."""
    value = 0xCBF29CE484222325
    for table in tables:
        for word in table.bits:
            value = ((value ^ word) * 0x100000001B3) & 0xFFFFFFFFFFFFFFFF
    return value


def doubles(name: str, values: Any) -> Table:
    """A table of doubles.

    Raises
    ------
    InputError
        If one is not finite.
    """
    # Adding zero turns -0.0 into 0.0, whose literal survives every compiler flag.
    array = np.asarray(values, dtype=np.float64) + 0.0
    if not np.isfinite(array).all():
        raise InputError(f"{name} of the closure is not finite; train it again.")
    return Table(name, "double", array)


def network_tables(network: Network) -> list[Table]:
    """Tables of a network."""
    tables = [doubles("mean", network.mean), doubles("scale", network.scale)]
    for k, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        tables += [doubles(f"weight_{k}", weight), doubles(f"bias_{k}", bias)]
    return tables


def forest_tables(forest: Forest) -> list[Table]:
    """Tables of a forest; leaves hold the row of their values in place of a child."""
    leaf = forest.feature < 0
    # A leaf needs no child, so its place holds the row of its values: half as many of them.
    following = np.where(leaf, np.cumsum(leaf) - 1, forest.left)
    threshold = np.where(leaf, np.float32(0), forest.threshold + np.float32(0))
    if not np.isfinite(threshold).all():
        raise InputError("a threshold of the closure is not finite; train it again.")
    if forest.feature.max(initial=0) > 127:
        raise InputError("the closure has more than 128 features; the header holds no more.")
    return [
        Table("roots", "std::int32_t", forest.roots),
        Table("feature", "std::int8_t", forest.feature),
        Table("threshold", "float", threshold.astype(np.float32)),
        Table("following", "std::int32_t", following.astype(np.int32)),
        doubles("leaf_values", forest.value[leaf]),
    ]


def finite(values: Any) -> NDArray:
    """Infinite bounds as the largest numbers: -ffast-math knows no infinity."""
    return np.clip(np.asarray(values, dtype=np.float64), -LARGEST, LARGEST)
