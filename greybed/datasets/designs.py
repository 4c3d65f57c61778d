"""Designs of view-factor data sets: which packings, how they are traced, the built-in ones."""

from __future__ import annotations

from dataclasses import dataclass

from greybed.core import InputError
from greybed.core.config import tables, whole
from greybed.datasets.beds import (
    BEDS,
    Bed,
    LatticeBed,
    LayeredBed,
    RandomBed,
    ShearedBed,
    WalledBed,
    refuse_without_splits,
)
from greybed.raytrace.tally import MOST_RAYS

MOST_SEED = 2**32 - 1

PackingDesign = RandomBed


@dataclass(frozen=True, kw_only=True)
class Design:
    """A data set: packings, and how each is traced."""

    packing: tuple[Bed, ...] = tables("kind", BEDS)
    rays: int = whole(150_000, at_least=100, at_most=MOST_RAYS)  # per emitter [-]
    emitters: int = whole(40, at_least=1)  # per packing [-]
    seed: int = whole(1, at_least=0, at_most=MOST_SEED)
    exchange: bool = True  # also trace exchange factors, which takes longest

    def __post_init__(self) -> None:
        refuse_without_splits(self.packing)
        if not 0 <= self.seed <= MOST_SEED:  # also from --seed, which no case rule sees
            raise InputError(f"seed = {self.seed} [-] must lie in 0 ... {MOST_SEED}; mend it.")


def quick_design(seed: int = 1) -> Design:
    """The quickstart's: solid fractions 0.10 to 0.63, one size, log-normal and two sizes."""
    mono, wide, two = "mono:1mm", "lognormal:1mm,1.3", "discrete:0.7mm=0.5,1.4mm=0.5"
    rows: tuple[tuple[str, str, tuple[float, ...]], ...] = (
        ("train", mono, (0.10, 0.20, 0.30, 0.40, 0.50, 0.55, 0.62)),
        ("train", wide, (0.10, 0.25, 0.40, 0.50, 0.60, 0.63)),
        ("train", two, (0.15, 0.35, 0.45, 0.55, 0.60, 0.63)),
        ("calibrate", mono, (0.15, 0.58)),
        ("calibrate", wide, (0.30, 0.55)),
        ("calibrate", two, (0.25, 0.50)),
        ("test", mono, (0.12, 0.45, 0.57)),
        ("test", wide, (0.20, 0.52)),
        ("test", two, (0.40, 0.58)),
    )
    packings = [
        # Every other packing keeps its touching pairs, as a settled bed has them.
        PackingDesign(fraction=phi, sizes=sizes, split=split, shake=100 * (k % 2))
        for split, sizes, fractions in rows
        for k, phi in enumerate(fractions)
    ]
    return Design(packing=tuple(packings), seed=seed, exchange=False)


def default_design(seed: int = 1) -> Design:
    """The campaign: all kinds of packings, solid fractions 0.05 to 0.64, size ratios 0.2 to 5."""
    mono, narrow, wide = "mono:1mm", "lognormal:1mm,1.3", "lognormal:1mm,1.5"
    two, five = "discrete:0.7mm=0.5,1.4mm=0.5", "discrete:0.5mm=0.3,2.5mm=0.7"
    mixed = "discrete:0.6mm=0.6,1.5mm=0.4"
    random: tuple[tuple[str, str, tuple[float, ...]], ...] = (
        ("train", mono, (0.05, 0.15, 0.25, 0.35, 0.45, 0.50, 0.55, 0.62)),
        ("train", narrow, (0.10, 0.30, 0.45, 0.55, 0.63)),
        ("train", wide, (0.20, 0.40, 0.52, 0.64)),
        ("train", two, (0.15, 0.35, 0.50, 0.60)),
        ("train", mixed, (0.25, 0.45, 0.58)),
        ("train", five, (0.40, 0.60)),
        ("calibrate", mono, (0.10, 0.40, 0.58)),
        ("calibrate", narrow, (0.25, 0.52)),
        ("calibrate", wide, (0.35, 0.60)),
        ("calibrate", two, (0.20, 0.55)),
        ("test", mono, (0.20, 0.42, 0.55)),
        ("test", narrow, (0.22, 0.50)),
        ("test", wide, (0.30, 0.55)),
        ("test", two, (0.28, 0.48)),
        ("test", mixed, (0.38, 0.53)),
    )
    beds: list[Bed] = [
        # Every other packing keeps its touching pairs, as a settled bed has them.
        RandomBed(
            fraction=phi, sizes=sizes, split=split, shake=100 * (k % 2),
            count=700 if sizes == five else 500,
        )
        for split, sizes, fractions in random
        for k, phi in enumerate(fractions)
    ]  # fmt: skip
    beds += [
        ShearedBed(fraction=0.35, stretch=1.5),
        ShearedBed(fraction=0.55, stretch=1.3, sizes=narrow),
        ShearedBed(fraction=0.45, stretch=1.4, split="test"),
        LayeredBed(fraction=0.55, upper=0.25),
        LayeredBed(fraction=0.50, upper=0.50, upper_sizes="mono:1.6mm"),
        LayeredBed(fraction=0.50, upper=0.35, split="calibrate"),
        LayeredBed(fraction=0.45, upper=0.30, upper_sizes=narrow, split="test"),
        LatticeBed(fraction=0.52, lattice="sc", cells=6),
        LatticeBed(fraction=0.60, lattice="bcc", jitter=0.8),
        LatticeBed(fraction=0.70, lattice="fcc", jitter=0.5),
        LatticeBed(fraction=0.45, lattice="fcc", jitter=1.0),
        LatticeBed(fraction=0.50, lattice="bcc", jitter=1.0, split="test"),
        WalledBed(fraction=0.15),
        WalledBed(fraction=0.35, sizes=narrow),
        WalledBed(fraction=0.50),
        WalledBed(fraction=0.56, sizes=narrow, shake=0),
        WalledBed(fraction=0.25, container="cylinder"),
        WalledBed(fraction=0.45, container="cylinder", sizes=two),
        WalledBed(fraction=0.54, container="cylinder", shake=0),
        WalledBed(fraction=0.30, split="calibrate"),
        WalledBed(fraction=0.52, container="cylinder", split="calibrate"),
        WalledBed(fraction=0.30, container="cylinder", split="test"),
        WalledBed(fraction=0.48, split="test"),
        WalledBed(fraction=0.54, sizes=narrow, shake=0, split="test"),
    ]
    return Design(packing=tuple(beds), seed=seed)
