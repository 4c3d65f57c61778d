"""Ray tracer: rate against Embree's sphere primitives, lattice factors, coverage of error bars.

python benchmarks/raytrace.py [--fraction 0.2]   needs g++ and libembree-dev (Embree 3)
python benchmarks/raytrace.py --lattices         first shells to 3e-5 at more than 3 errors
python benchmarks/raytrace.py --coverage         95 % intervals by expected count

The rate: the same 10,000 spheres in an open random packing, the same rays per sphere, one thread
each, in turn. Ours is the whole of view_factors: overlaps measured, cell grid built, every pair
tallied, standard errors, double precision. Embree's is the tracing alone, in single precision: its
tree is built before the clock starts and hits are only counted. Of its ways to be called (single
rays, packets of 4, 8, 16, a stream) the fastest is taken; see peers/embree_rate.cpp.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from greybed.core import Packing
from greybed.datasets.containers import Box
from greybed.datasets.generate import random_packing
from greybed.datasets.lattices import lattice
from greybed.datasets.sizes import Mono, Uniform
from greybed.raytrace import standard_error, tally, view_factors

SOURCE = Path(__file__).parent / "peers" / "embree_rate.cpp"
WIDTHS = {1: "single rays", 0: "a stream", 4: "packets of 4", 8: "packets of 8", 16: "of 16"}
BAR = 1.5
# Two independent counts of 1e7 rays each differ by 1.3e-4 at one standard deviation.
SAME_HITS = 5e-4


def embree(binary: Path, packing: Path, rays: int, width: int) -> dict[str, float]:
    """Run the peer once, on one thread."""
    result = subprocess.run(
        [binary, packing, str(rays), "1", str(width)],
        env={**os.environ, "EMBREE_CONFIG": "threads=1"},
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(result.stdout)


def rate(options: argparse.Namespace) -> int:
    """Measure both in turn; returns the exit code."""
    if shutil.which("g++") is None or not Path("/usr/include/embree3").exists():
        print("needs g++ and Embree 3 (Debian: apt-get install g++ libembree-dev)")
        return 2
    n = options.spheres
    packing = random_packing(n, options.fraction, Mono(1.0), seed=1, shake=100)
    packing = Packing(packing.centres, packing.radii, source="open random packing")
    with tempfile.TemporaryDirectory() as folder:
        binary, data = Path(folder, "embree_rate"), Path(folder, "packing.bin")
        build = ["g++", "-O3", "-march=native", SOURCE, "-o", binary, "-lembree3", "-lpthread"]
        subprocess.run(build, check=True)
        table = np.column_stack([packing.centres, packing.radii]).astype("<f4")
        data.write_bytes(np.int32(n).tobytes() + table.tobytes())
        view_factors(packing, rays=2, threads=1)  # compiles
        trials = {w: [] for w in WIDTHS}
        for _ in range(3):
            for width in WIDTHS:
                trials[width].append(embree(binary, data, options.rays // 2, width)["mrays"])
        middle = {w: statistics.median(values) for w, values in trials.items()}
        best = max(middle, key=middle.__getitem__)
        shown = ", ".join(f"{WIDTHS[w]} {value:.2f}" for w, value in middle.items())
        print(f"Embree's ways to be called [Mray/s]: {shown}")
        ours, theirs, hits = [], [], []
        for pair in range(options.pairs):
            result = view_factors(packing, rays=options.rays, seed=pair, threads=1)
            ours.append(1e-6 * n * options.rays / result.seconds)
            peer = embree(binary, data, options.rays, best)
            theirs.append(peer["mrays"])
            hits.append((1.0 - result.escaped.mean(), peer["hit_fraction"]))
            print(
                f"pair {pair + 1}: greybed {ours[-1]:.2f}, Embree {theirs[-1]:.2f} Mray/s, "
                f"hit fractions {hits[-1][0]:.5f} and {hits[-1][1]:.5f}"
            )
    ratio = statistics.median(a / b for a, b in zip(ours, theirs, strict=True))
    print(
        f"{n} spheres, solid fraction {options.fraction:g}, open, {options.rays} rays each, one "
        f"thread: greybed {statistics.median(ours):.2f} Mray/s (all of view_factors), Embree "
        f"{peer['version']} {statistics.median(theirs):.2f} Mray/s ({WIDTHS[best]})"
    )
    worst = max(abs(a - b) for a, b in hits)
    if worst > SAME_HITS:
        print(f"the hit fractions differ by {worst:.1e}, above {SAME_HITS:g}: not the same work")
        return 1
    print(f"bar {BAR:g}: {'met' if ratio >= BAR else 'NOT met'}")
    print(f"ratio {ratio:.3f}")
    return 0 if ratio >= BAR else 1


def lattices(options: argparse.Namespace) -> int:
    """First three shells of the touching lattices against the published values."""
    # kind, squared distance over r^2, neighbours, factor +-1e-5
    table = [
        ("sc", 4.0, 6, 0.0755868),
        ("sc", 8.0, 12, 0.02524),
        ("sc", 12.0, 8, 0.01728),
        ("bcc", 4.0, 8, 0.07508),
        ("bcc", 16.0 / 3.0, 6, 0.04604),
        ("bcc", 32.0 / 3.0, 12, 0.00751),
        ("fcc", 4.0, 12, 0.07190),
        ("fcc", 8.0, 6, 0.01707),
        ("fcc", 12.0, 24, 0.00134),
    ]
    rays, failed = options.lattice_rays, 0
    print(f"{rays:g} rays from one sphere, means over the neighbours of a shell")
    for kind in ("sc", "bcc", "fcc"):
        packing = lattice(kind, 3, 1.0)
        found = tally.trace(packing, rays=rays, emitters=[0], images=True, show_progress=True)
        sphere, image = tally.split_keys(found.key)
        at = packing.centres[sphere] + image * packing.edges - packing.centres[0]
        squared = (at**2).sum(axis=1)
        for _, r2, neighbours, factor in (row for row in table if row[0] == kind):
            total = found.count[np.abs(squared - r2) < 1e-6].sum() / rays
            value = total / neighbours
            error = math.sqrt(total * (1.0 - total) / rays) / neighbours
            good = abs(value - factor) < 3e-5
            failed += not good
            print(
                f"{kind:>4} distance {math.sqrt(r2):.4f} r: {value:.6f} +- {error:.6f}, published "
                f"{factor:.6f}, difference {value - factor:+.1e}{'' if good else '  ABOVE 3e-5'}"
            )
    return 1 if failed else 0


def coverage(options: argparse.Namespace) -> int:
    """How often 95 % intervals cover the truth, by the count that a pair may expect."""
    packing = random_packing(36, 0.35, Uniform(1e-3, 2e-3), container=Box(), seed=4)
    rays, replicates = 2000, options.replicates
    reference = view_factors(packing, rays=1000 * rays, seed=2**40)
    truth = np.hstack([reference.factors.toarray(), reference.wall_factors])
    names = ("stated", "of independent rays")
    inside = {name: np.zeros(truth.shape) for name in names}
    for seed in range(replicates):
        run = view_factors(packing, rays=rays, seed=seed)
        value = np.hstack([run.factors.toarray(), run.wall_factors])
        stated = np.hstack([run.stderr.toarray(), run.wall_stderr])
        stated = np.where(stated > 0.0, stated, standard_error(0, rays))
        for name, error in zip(names, (stated, standard_error(value * rays, rays)), strict=True):
            inside[name] += np.abs(value - truth) <= 1.959964 * error
    expected = truth * rays
    print(f"{replicates} replicates of {rays} rays; share of 95 % intervals that cover the truth")
    for low, high in ((0.3, 1), (1, 3), (3, 10), (10, 30), (30, 100), (100, 300), (10, 2000)):
        chosen = (expected >= low) & (expected < high)
        shares = ", ".join(
            f"{name} {100 * hits[chosen].mean() / replicates:.2f} %"
            for name, hits in inside.items()
        )
        print(f"expected count {low:>4} to {high:<4} ({chosen.sum():>4} pairs): {shares}")
    return 0


def main() -> int:
    """Read the options and run what they ask for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--fraction", type=float, default=0.5, help="solid fraction (default 0.5)")
    parser.add_argument("--spheres", type=int, default=10_000)
    parser.add_argument("--rays", type=int, default=10_000, help="per sphere (10000)")
    parser.add_argument("--pairs", type=int, default=5, help="runs of each, in turn (default 5)")
    parser.add_argument("--lattices", action="store_true")
    parser.add_argument("--lattice-rays", type=int, default=200_000_000)
    parser.add_argument("--coverage", action="store_true")
    parser.add_argument("--replicates", type=int, default=400)
    options = parser.parse_args()
    if options.lattices:
        return lattices(options)
    return coverage(options) if options.coverage else rate(options)


if __name__ == "__main__":
    sys.exit(main())
