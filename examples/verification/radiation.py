"""View and exchange factors against closed forms and published values; two minutes on one core.

python examples/verification/radiation.py [FIGURE]; a part of run.py.

Sphere pairs of several sizes against the exact factor, the first three shells of touching lattices
against values published to 1e-5, exchange in the face-centred lattice, and the limiting cases of
all view-factor closures that come with greybed.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from greybed.closures import exact_view_factor, shipped
from greybed.closures.viewfactor.limits import check_limits
from greybed.core import Packing
from greybed.datasets.lattices import lattice
from greybed.raytrace import exchange_factors, radiative_exchange_factor, view_factors

# Kind, squared distance over r^2, factor: the published values that benchmarks/raytrace.py has.
SHELLS = (
    ("sc", 4.0, 0.0755868), ("sc", 8.0, 0.02524), ("sc", 12.0, 0.01728),
    ("bcc", 4.0, 0.07508), ("bcc", 16.0 / 3.0, 0.04604), ("bcc", 32.0 / 3.0, 0.00751),
    ("fcc", 4.0, 0.07190), ("fcc", 8.0, 0.01707), ("fcc", 12.0, 0.00134),
)  # fmt: skip
# Share of the light of a sphere that each nearest neighbour absorbs, face-centred lattice, by a
# reflecting Monte Carlo of other hands, rounded to four digits.
NEAREST = {0.3: 0.0169, 0.65: 0.0409, 0.8: 0.0531, 0.9: 0.0621}
RAYS = 5_000_000


def pairs(axis) -> float:
    """Two free spheres: largest error of a traced factor in its own standard errors."""
    worst = 0.0
    for ratio, colour in ((1.0, "C0"), (3.0, "C1")):
        gaps = np.geomspace(1e-3, 8.0, 8)
        exact = exact_view_factor(1.0, ratio, 1.0 + ratio + gaps)
        line = np.geomspace(1e-3, 8.0, 100)
        axis.loglog(
            line, exact_view_factor(1.0, ratio, 1.0 + ratio + line), "-", color=colour,
            label=f"exact, radii 1 : {ratio:g}",
        )  # fmt: skip
        for gap, factor in zip(gaps, exact, strict=True):
            two = Packing([[0, 0, 0], [1.0 + ratio + gap, 0, 0]], [1.0, ratio])
            traced = view_factors(two, rays=100_000, seed=1)
            axis.plot(gap, traced.factors[0, 1], "o", mfc="none", color=colour)
            worst = max(worst, abs(traced.factors[0, 1] - factor) / traced.stderr[0, 1])
    axis.set(xlabel="gap over the radius [-]", ylabel="view factor [-]", title="Two spheres")
    axis.legend()
    return float(worst)


def shells(axis) -> float:
    """Largest difference to the published values."""
    off = []
    for kind in ("sc", "bcc", "fcc"):
        bed = lattice(kind, 3, 1.0)
        (found,) = exchange_factors(bed, 1.0, rays=RAYS, emitters=[0], images=True)
        at = found.pairs
        apart = bed.centres[at.target] + at.image * bed.edges - bed.centres[0]
        square = (apart**2).sum(axis=1)
        for name, distance, factor in SHELLS:
            if name == kind:
                value = at.factor[abs(square - distance) < 1e-6].mean()
                off.append((f"{kind} {distance:.1f}", value - factor))
    axis.bar([name for name, _ in off], [1e5 * d for _, d in off])
    axis.tick_params(axis="x", rotation=60)
    axis.set(ylabel="less the published factor [1e-5]", title="Shells of touching lattices")
    return float(max(abs(d) for _, d in off))


def exchange(axis) -> dict[str, float]:
    """Nearest pair of the face-centred lattice and its macroscopic factor."""
    bed = lattice("fcc", 1, 1.0)
    emissivity = [*NEAREST, 1.0]
    results = exchange_factors(bed, emissivity, rays=RAYS // 4, emitters=[0], images=True)
    shares = []
    for result in results[:-1]:
        at = result.pairs
        apart = bed.centres[at.target] + at.image * bed.edges - bed.centres[0]
        near = abs((apart**2).sum(axis=1) - 4.0) < 1e-6
        shares.append(result.emissivity[0] * at.factor[near].mean())
    known = np.array(list(NEAREST.values()))
    axis.plot(emissivity[:-1], known, "k_", ms=14, label="other hands")
    axis.plot(emissivity[:-1], shares, "o", mfc="none", label="greybed")
    axis.set(xlabel="emissivity [-]", ylabel="absorbed share of a neighbour [-]",
             title="Exchange, face-centred lattice")  # fmt: skip
    axis.legend()
    value, _ = radiative_exchange_factor(bed, results[-1]).conductivity(1000.0)
    whole = value / (4.0 * 5.670374419e-8 * 1e9 * 2.0)
    return {
        "radiation.exchange": float(abs(np.array(shares) / known - 1.0).max()),
        "radiation.conductivity": float(whole),
    }


def limits() -> float:
    """How many limiting cases the shipped view-factor closures fail."""
    names = ("viewfactor_mlp_pencil", "viewfactor_mlp_published")
    return float(sum(not c.passed for name in names for c in check_limits(shipped(name))))


def measure(picture: Path) -> dict[str, float]:
    """Draw, and give what is compared."""
    figure, axes = plt.subplots(1, 3, figsize=(12, 3.8), layout="constrained")
    found = {
        "radiation.contact": float(exact_view_factor(1.0, 1.0, 2.0)),
        "radiation.pairs": pairs(axes[0]),
        "radiation.shells": shells(axes[1]),
    }
    found |= exchange(axes[2])
    found["closures.limits"] = limits()
    figure.savefig(picture, dpi=110)
    plt.close(figure)
    return found


def main() -> None:
    print(measure(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images/radiation.png")))


if __name__ == "__main__":
    main()
