"""Ray tracer: rate against Embree's sphere primitives, time to an accuracy, lattices, coverage.

python benchmarks/raytrace.py                    needs g++ and libembree-dev (Embree 3)
python benchmarks/raytrace.py --accuracy         time to 1 % on the contact pairs of a bed at 0.55
python benchmarks/raytrace.py --lattices         first shells to 3e-5 at more than 3 errors
python benchmarks/raytrace.py --coverage         95 % intervals by expected count

The rate: the same 10,000 spheres in an open random packing, at solid fractions 0.2 and 0.5, equally
many rays from each sphere by the same law, one thread each, in turn. Ours is the whole of
view_factors: overlaps measured, grids built, every pair tallied, standard errors, double precision.
Embree's is the tracing alone, in single precision: its tree is built before the clock starts and
hits are only counted. Of its ways to be called (single rays, packets of 4, 8, 16, a stream) the
fastest is taken; see peers/embree_rate.cpp. Both are also given the same rays and must meet the
same spheres, but for rays that graze. The last line is the lower of the two ratios.
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
import time
from pathlib import Path

import numpy as np

from greybed.core import Packing
from greybed.core.sizes import Mono, Uniform
from greybed.datasets.containers import Box
from greybed.datasets.generate import random_packing
from greybed.datasets.lattices import lattice
from greybed.raytrace import first_hits, pair_factors, standard_error, tally, view_factors

SOURCE = Path(__file__).parent / "peers" / "embree_rate.cpp"
WIDTHS = {1: "single rays", 0: "a stream", 4: "packets of 4", 8: "packets of 8", 16: "of 16"}
ENVIRONMENT = {**os.environ, "EMBREE_CONFIG": "threads=1"}
FRACTIONS = (0.2, 0.5)
BAR = 3.0
# Two independent counts of 1e7 rays each differ by 1.3e-4 at one standard deviation.
SAME_SHARE = 5e-4
# Rays out of a million whose hits may differ: those that graze, by the digits of a float.
GRAZING = 100
ACCURACY_FRACTION = 0.55
ACCURACY_BARS = {"naive rays of the same tracer": 10.0, "naive rays of Embree": 25.0}


def embree(binary: Path, packing: Path, rays: int, width: int) -> dict[str, float]:
    """Run the peer once, on one thread."""
    result = subprocess.run(
        [binary, packing, str(rays), "1", str(width)],
        env=ENVIRONMENT,
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(result.stdout)


def build(folder: Path) -> Path | None:
    """Compile the peer; None where it cannot be."""
    if shutil.which("g++") is None or not Path("/usr/include/embree3").exists():
        print("needs g++ and Embree 3 (Debian: apt-get install g++ libembree-dev)")
        return None
    binary = folder / "embree_rate"
    subprocess.run(
        ["g++", "-O3", "-march=native", SOURCE, "-o", binary, "-lembree3", "-lpthread"], check=True
    )
    return binary


def open_packing(n: int, fraction: float) -> Packing:
    """An open random packing of unit spheres, with single-precision centres for both."""
    packing = random_packing(n, fraction, Mono(1.0), seed=1, shake=100)
    centres = packing.centres.astype(np.float32).astype(np.float64)
    # Rounded centres may overlap by a few 1e-7: a hair smaller, and all surface is free again.
    return Packing(centres, np.float64(np.float32(1.0 - 4e-6)), source="open random packing")


def write_packing(packing: Packing, path: Path) -> Path:
    """The packing as the peer reads it."""
    table = np.column_stack([packing.centres, packing.radii]).astype("<f4")
    path.write_bytes(np.int32(len(packing)).tobytes() + table.tobytes())
    return path


def different_hits(binary: Path, packing: Packing, data: Path, rays: int) -> int:
    """Rays of ``rays`` that meet another sphere in Embree than here."""
    rng = np.random.default_rng(5)
    who = rng.integers(0, len(packing), rays)
    normal, spread = rng.normal(size=(2, rays, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    spread /= np.linalg.norm(spread, axis=1, keepdims=True)
    direction = normal + spread  # a cosine law about the normal
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    origin = packing.centres[who] + (1.0 + 1e-5) * packing.radii[who, None] * normal
    origin, direction = origin.astype("<f4"), direction.astype("<f4")
    table = np.empty(rays, dtype=[("i", "<i4"), ("o", "<f4", 3), ("d", "<f4", 3)])
    table["i"], table["o"], table["d"] = who, origin, direction
    given, hits = data.with_suffix(".rays"), data.with_suffix(".hits")
    table.tofile(given)
    subprocess.run([binary, data, given, hits], env=ENVIRONMENT, check=True)
    theirs = np.fromfile(hits, "<i4")
    _, ours = first_hits(packing, origin.astype(np.float64), direction.astype(np.float64))
    return int((np.where(ours < 0, -1, ours) != theirs).sum())


def rate(options: argparse.Namespace) -> int:
    """Measure both in turn, at both solid fractions; returns the exit code."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        binary = build(folder)
        if binary is None:
            return 2
        ratios = [rate_at(phi, binary, folder, options) for phi in options.fraction or FRACTIONS]
    if None in ratios:
        return 1
    ratio = min(r for r in ratios if r is not None)
    print(f"bar {BAR:g}: {'met' if ratio >= BAR else 'NOT met'}")
    print(f"ratio {ratio:.3f}")
    return 0 if ratio >= BAR else 1


def rate_at(
    fraction: float, binary: Path, folder: Path, options: argparse.Namespace
) -> float | None:
    """The ratio of the rates at one solid fraction; None where the work is not the same."""
    n = options.spheres
    packing = open_packing(n, fraction)
    data = write_packing(packing, folder / "packing.bin")
    view_factors(packing, rays=64, threads=1)  # compiles
    trials: dict[int, list[float]] = {w: [] for w in WIDTHS}
    for _ in range(3):
        for width in WIDTHS:
            trials[width].append(embree(binary, data, options.rays // 4, width)["mrays"])
    middle = {w: statistics.median(values) for w, values in trials.items()}
    best = max(middle, key=middle.__getitem__)
    shown = ", ".join(f"{WIDTHS[w]} {value:.2f}" for w, value in middle.items())
    print(f"solid fraction {fraction:g}; Embree's ways to be called [Mray/s]: {shown}")
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
        f"{n} spheres, solid fraction {fraction:g}, open, {options.rays} rays each, one "
        f"thread: greybed {statistics.median(ours):.2f} Mray/s (all of view_factors), Embree "
        f"{peer['version']} {statistics.median(theirs):.2f} Mray/s ({WIDTHS[best]}), ratio "
        f"{ratio:.2f}; to single rays {statistics.median(ours) / middle[1]:.2f}"
    )
    differing = different_hits(binary, packing, data, 1_000_000)
    print(f"of the same 1,000,000 rays {differing} meet another sphere, of at most {GRAZING}")
    worst = max(abs(a - b) for a, b in hits)
    if worst > SAME_SHARE or differing > GRAZING:
        print(f"hit fractions differ by up to {worst:.1e}, or single hits do: not the same work")
        return None
    return ratio


def accuracy(options: argparse.Namespace) -> int:
    """Time to 1 % standard error on the contact pairs of a bed: lines against naive rays."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        binary = build(folder)
        if binary is None:
            return 2
        packing = random_packing(2000, ACCURACY_FRACTION, Mono(1.0), seed=1, shake=0)
        packing = Packing(packing.centres, packing.radii, source="open random packing")
        pairs, distance = packing.neighbours(0.01)
        pairs = pairs[distance >= 2.0 * (1.0 - 1e-9)]
        pair_factors(packing, pairs[:2], rel_error=0.1)  # compiles
        view_factors(packing, rays=64, sampling="random", threads=1)
        reference = pair_factors(packing, pairs, rel_error=1e-3, seed=99)
        # The error of naive rays is binomial: so many for the median contact pair.
        share = float(np.median(reference.factor))
        rays = int((1.0 - share) / share / 0.01**2)
        data = write_packing(packing, folder / "packing.bin")
        print(
            f"{len(packing)} spheres at {ACCURACY_FRACTION:g}, {len(pairs)} contact pairs, median "
            f"factor {share:.5f}: naive rays need {rays} of each sphere for 1 %"
        )
        ratios: dict[str, list[float]] = {name: [] for name in ACCURACY_BARS}
        for pair in range(options.pairs):
            begin = time.perf_counter()
            lines = pair_factors(packing, pairs, rel_error=0.01, seed=pair, threads=1)
            ours = time.perf_counter() - begin
            naive = view_factors(
                packing, rays=rays, seed=pair, threads=1, sampling="random"
            ).seconds
            peer = embree(binary, data, rays, 0)
            embree_time = 1e-6 * len(packing) * rays / peer["mrays"]
            off = lines.factor / reference.factor - 1.0
            print(
                f"pair {pair + 1}: lines {ours:.3f} s (stated errors up to "
                f"{100 * (lines.stderr / lines.factor).max():.2f} %, true rms "
                f"{100 * np.sqrt((off**2).mean()):.2f} %), naive rays {naive:.1f} s, Embree "
                f"{embree_time:.1f} s"
            )
            for key, seconds in zip(ratios, (naive, embree_time), strict=True):
                ratios[key].append(seconds / ours)
    met = True
    for key, values in ratios.items():
        ratio = statistics.median(values)
        met &= ratio >= ACCURACY_BARS[key]
        print(f"against {key}: {ratio:.0f} times faster, bar {ACCURACY_BARS[key]:g}")
    print(f"ratio {min(statistics.median(v) for v in ratios.values()):.3f}")
    return 0 if met else 1


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
    parser.add_argument("--fraction", type=float, action="append", help="solid fraction (0.2, 0.5)")
    parser.add_argument("--accuracy", action="store_true")
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
    if options.accuracy:
        return accuracy(options)
    return coverage(options) if options.coverage else rate(options)


if __name__ == "__main__":
    sys.exit(main())
