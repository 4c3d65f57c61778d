"""Kinds of packings that a data set can hold: random, walled, sheared, layered, on a lattice."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Literal, cast

import numpy as np

from greybed.core import InputError, Packing
from greybed.core.config import choice, quantity, whole
from greybed.core.sizes import parse_sizes
from greybed.datasets.containers import Box, CylinderContainer, PeriodicBox
from greybed.datasets.generate import MOST_SPHERES, random_packing
from greybed.datasets.lattices import lattice
from greybed.datasets.sheared import sheared_packing

SPLITS = ("train", "calibrate", "test")
# Spheres of a lattice without jitter all stand alike: few of them tell everything.
LATTICE_EMITTERS = 4


@dataclass(frozen=True, kw_only=True)
class RandomBed:
    """Random packing in a periodic box."""

    kind: ClassVar[str] = "random"
    fraction: float = quantity("dimensionless", above=0.0, at_most=0.7)  # solid fraction [-]
    sizes: str = "mono:1mm"  # as for greybed pack
    count: int = whole(500, at_least=20, at_most=MOST_SPHERES)  # spheres [-]
    shake: int = whole(100, at_least=0)  # Monte-Carlo sweeps, 0 leaves spheres just touching [-]
    split: str = choice(SPLITS, "train")

    def __post_init__(self) -> None:
        parse_sizes(self.sizes)  # refused here, not after hours of other packings

    def packing(self, seed: int) -> Packing:
        """Make the packing."""
        return random_packing(
            self.count, self.fraction, parse_sizes(self.sizes), seed=seed, shake=self.shake
        )


@dataclass(frozen=True, kw_only=True)
class WalledBed:
    """Random packing between walls: a box of six planes, or a cylinder with floor and lid."""

    kind: ClassVar[str] = "walled"
    fraction: float = quantity("dimensionless", above=0.0, at_most=0.7)  # solid fraction [-]
    container: str = choice(("box", "cylinder"), "box")
    aspect: float = quantity("dimensionless", 1.0, above=0.0)  # height over width [-]
    sizes: str = "mono:1mm"  # as for greybed pack
    count: int = whole(500, at_least=20, at_most=MOST_SPHERES)  # spheres [-]
    shake: int = whole(100, at_least=0)  # Monte-Carlo sweeps [-]
    split: str = choice(SPLITS, "train")

    def __post_init__(self) -> None:
        parse_sizes(self.sizes)

    def packing(self, seed: int) -> Packing:
        """Make the packing."""
        container = (
            Box(aspect=(1.0, 1.0, self.aspect))
            if self.container == "box"
            else CylinderContainer(aspect=self.aspect)
        )
        return random_packing(
            self.count, self.fraction, parse_sizes(self.sizes), container=container, seed=seed,
            shake=self.shake,
        )  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class ShearedBed:
    """Random packing whose periodic box is stretched along x and pressed together along z."""

    kind: ClassVar[str] = "sheared"
    fraction: float = quantity("dimensionless", above=0.0, at_most=0.7)  # solid fraction [-]
    stretch: float = quantity("dimensionless", 1.3, above=1.0, at_most=2.0)  # along x [-]
    sizes: str = "mono:1mm"  # as for greybed pack
    count: int = whole(500, at_least=20, at_most=MOST_SPHERES)  # spheres [-]
    split: str = choice(SPLITS, "train")

    def __post_init__(self) -> None:
        parse_sizes(self.sizes)

    def packing(self, seed: int) -> Packing:
        """Make the packing."""
        return sheared_packing(
            self.count, self.fraction, parse_sizes(self.sizes), self.stretch, seed=seed
        )


@dataclass(frozen=True, kw_only=True)
class LayeredBed:
    """Two flat layers on top of each other, periodic: each with its own fraction and sizes."""

    kind: ClassVar[str] = "layered"
    fraction: float = quantity("dimensionless", above=0.0, at_most=0.7)  # of the lower layer [-]
    upper: float = quantity("dimensionless", above=0.0, at_most=0.7)  # of the upper layer [-]
    sizes: str = "mono:1mm"  # of the lower layer, as for greybed pack
    upper_sizes: str = "mono:1mm"  # of the upper layer
    count: int = whole(500, at_least=40, at_most=MOST_SPHERES)  # spheres of both [-]
    shake: int = whole(100, at_least=0)  # Monte-Carlo sweeps [-]
    split: str = choice(SPLITS, "train")

    def __post_init__(self) -> None:
        parse_sizes(self.sizes)
        parse_sizes(self.upper_sizes)

    def packing(self, seed: int) -> Packing:
        """Make the packing."""
        wide, other = parse_sizes(self.sizes), parse_sizes(self.upper_sizes)
        n = self.count // 2
        volume = [
            4.0 / 3.0 * math.pi * float((sizes.radii(n) ** 3).sum()) / fraction
            for sizes, fraction in ((wide, self.fraction), (other, self.upper))
        ]
        # Both layers stand on the base of the cube that the mean layer fills.
        base = math.cbrt(0.5 * sum(volume))
        layers = [
            random_packing(
                n, fraction, sizes, seed=seed + k, shake=self.shake,
                container=PeriodicBox(aspect=(1.0, 1.0, v / base**3), floor_and_lid=True),
            )
            for k, (sizes, fraction, v) in enumerate(
                ((wide, self.fraction, volume[0]), (other, self.upper, volume[1]))
            )
        ]  # fmt: skip
        height = [float(layer.edges[2]) for layer in layers]
        return Packing(
            np.concatenate([layers[0].centres, layers[1].centres + [0.0, 0.0, height[0]]]),
            np.concatenate([layer.radii for layer in layers]),
            [*layers[0].edges[:2], sum(height)],
            (True, True, True),
            source="layered packing",
        )


@dataclass(frozen=True, kw_only=True)
class LatticeBed:
    """Cubic lattice of equal spheres, each moved by a random share of the free gap."""

    kind: ClassVar[str] = "lattice"
    fraction: float = quantity("dimensionless", above=0.0, at_most=0.7404)  # solid fraction [-]
    lattice: str = choice(("sc", "bcc", "fcc"), "fcc")
    jitter: float = quantity("dimensionless", 0.0, at_least=0.0, at_most=1.0)  # of the gap [-]
    cells: int = whole(4, at_least=2, at_most=100)  # along each edge [-]
    split: str = choice(SPLITS, "train")

    def packing(self, seed: int) -> Packing:
        """Make the packing."""
        radius = 1e-3
        still = lattice(
            cast(Literal["sc", "bcc", "fcc"], self.lattice), self.cells, radius, self.fraction
        )
        if self.jitter == 0.0:
            return still
        edge = float(still.edges[0]) / self.cells
        nearest = {"sc": 1.0, "bcc": math.sqrt(0.75), "fcc": math.sqrt(0.5)}[self.lattice] * edge
        # Half the gap each: two neighbours that approach stay apart.
        room = 0.5 * (nearest - 2.0 * radius) * self.jitter
        rng = np.random.default_rng(seed)
        way = rng.standard_normal((len(still), 3))
        way *= (
            room * np.cbrt(rng.random(len(still)))[:, None] / np.linalg.norm(way, axis=1)[:, None]
        )
        return Packing(
            still.centres + way, still.radii, still.box, still.periodic,
            source=f"jittered {self.lattice} lattice",
        )  # fmt: skip


Bed = RandomBed | WalledBed | ShearedBed | LayeredBed | LatticeBed
BEDS: Mapping[str, type] = {
    kind.kind: kind for kind in (RandomBed, WalledBed, ShearedBed, LayeredBed, LatticeBed)
}


def emitters_of(bed: Bed, emitters: int) -> int:
    """Emitters worth tracing in a bed, of so many asked for [-]."""
    if isinstance(bed, LatticeBed) and bed.jitter == 0.0:
        return min(emitters, LATTICE_EMITTERS)
    return emitters


def as_table(bed: Bed) -> dict[str, Any]:
    """The bed as a ``[[packing]]`` table, its kind included."""
    return {"kind": bed.kind, **asdict(bed)}


def refuse_without_splits(beds: tuple[Bed, ...]) -> None:
    """Refuse a design from which no closure could be trained, calibrated and scored.

    Raises
    ------
    InputError
        If there is no packing, or none of a split.
    """
    if not beds:
        raise InputError("packing is empty; give at least one [[packing]] table for each split.")
    for split in SPLITS:
        if all(bed.split != split for bed in beds):
            use = {
                "train": "nothing could be fitted",
                "calibrate": "a closure's own error could not be calibrated",
                "test": "a closure could not be scored",
            }[split]
            raise InputError(
                f"no [[packing]] table has split = {split!r}, so {use}; add at least one."
            )
