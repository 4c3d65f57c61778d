"""Constant arrays of exported headers: their text, their checksum, those of each predictor."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.closures.predictors import Forest, Network
from greybed.closures.viewfactor.closure import Domain
from greybed.core import InputError

LARGEST = float(np.finfo(np.float64).max)
# Numbers before a tanh that need no care: 2^k of e^(2 x) is far from the ends of what doubles hold.
REACH = 300.0


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
    def room(self) -> int:
        """Entries of the array: bytes end with a zero, as strings do."""
        return self.size + (self.ctype == "std::int8_t")

    @property
    def text(self) -> str:
        """The entries, several a line; bytes as strings, which compilers read much faster."""
        if self.ctype == "std::int8_t":
            octal = [f"\\{value & 255:03o}" for value in self.values.ravel().tolist()]
            pieces = ("".join(octal[k : k + 24]) for k in range(0, len(octal), 24))
            return "\n      ".join(f'"{piece}"' for piece in pieces)
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


def _padded(array: NDArray, axis: int) -> NDArray:
    """Zeros after the end of an axis, to a multiple of four: neurons that give 0 and count 0."""
    widths = [(0, 0)] * array.ndim
    widths[axis] = (0, -array.shape[axis] % 4)
    return np.pad(array, widths)


def _layers(network: Network) -> tuple[list[NDArray], list[NDArray]]:
    """Weights and biases whose layers between are multiples of four wide."""
    weights, biases = list(network.weights), list(network.biases)
    for k in range(len(weights) - 1):
        weights[k], biases[k] = _padded(weights[k], 1), _padded(biases[k], 0)
        weights[k + 1] = _padded(weights[k + 1], 0)
    return weights, biases


def network_tables(network: Network) -> list[Table]:
    """Tables of a network: its layers, and those of the way back that derivatives take.

    Raises
    ------
    InputError
        If there is no layer between features and answers.
    """
    if len(network.weights) < 2:
        raise InputError(
            "a network without a layer between features and answers has no exported form; train "
            "it again with one."
        )
    weights, biases = _layers(network)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / np.asarray(network.scale, dtype=np.float64)
    tables = [doubles("mean", network.mean), doubles("inverse_scale", inverse)]
    for k, bias in enumerate(biases):
        if k + 1 < len(biases):
            tables.append(doubles(f"weight_{k}", weights[k]))
        tables.append(doubles(f"bias_{k}", bias))
    # Turned, so that the way back runs along memory too.
    for k, weight in enumerate(weights[1:-1], start=1):
        tables.append(doubles(f"turned_{k}", np.ascontiguousarray(weight.T)))
    inward = _padded((weights[0] * inverse[:, None]).T, 1)
    last = np.ascontiguousarray(weights[-1].T)
    return [*tables, doubles("last", last), doubles("inward", np.ascontiguousarray(inward))]


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
        # As bytes, lowest first: compilers read strings several times faster than numbers.
        Table("following", "std::int8_t", following.astype("<i4").view(np.int8)),
        doubles("leaf_values", forest.value[leaf]),
    ]


def learnt_tables(predictor: Network | Forest, domain: Domain) -> list[Table]:
    """Tables of the learnt part and of where its training data lie."""
    low, high = finite(domain.low), finite(domain.high)
    return [
        doubles("domain_low", low),
        doubles("domain_high", high),
        doubles("domain_centre", domain.centre),
        doubles("domain_precision", _padded(domain.precision, 1)),
        *(
            network_tables(predictor)
            if isinstance(predictor, Network)
            else forest_tables(predictor)
        ),
    ]


def learnt_context(predictor: Network | Forest, domain: Domain) -> dict[str, Any]:
    """What the templates of the learnt part need besides its tables."""
    with np.errstate(over="ignore"):
        limit2 = float(finite(np.float64(domain.limit) ** 2))
    n = len(domain.low)
    context: dict[str, Any] = {
        "n_features": n,
        "columns": n + -n % 4,
        "limit2": repr(limit2),
    }
    if isinstance(predictor, Network):
        widths = [len(bias) for bias in predictor.biases]
        sizes = [n, *(w + -w % 4 for w in widths[:-1]), widths[-1]]
        context |= {
            "layers": list(pairwise(sizes)),
            "bend": "Bent" if predictor.bent else "Tanh",
            "far": repr(REACH),
            **_reaches(predictor),
        }
    else:
        context |= {"n_raw": predictor.value.shape[1], "n_trees": len(predictor.roots)}
    return context


def _reaches(network: Network) -> dict[str, Any]:
    """Where numbers before a tanh may pass ``REACH``, and the exported network has to hold them.

    ``reaches`` bounds those of the first layer: a constant, and a factor for the size of each
    scaled feature. ``held`` are the further layers that are held in any case.
    """
    if network.bent:
        return {"reaches": [], "held": []}
    weights, biases = network.weights, network.biases
    most = [np.abs(biases[0]).max(), *np.abs(weights[0]).max(axis=1)]
    further = [
        (np.abs(b) + np.abs(w).sum(axis=0)).max()
        for w, b in zip(weights[1:-1], biases[1:-1], strict=True)
    ]
    return {
        "reaches": [repr(float(x)) for x in finite(most)],
        "held": [k for k, bound in enumerate(further, start=2) if not bound < REACH],
    }


def finite(values: Any) -> NDArray:
    """Infinite bounds as the largest numbers: -ffast-math knows no infinity."""
    return np.clip(np.asarray(values, dtype=np.float64), -LARGEST, LARGEST)
