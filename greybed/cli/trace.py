"""Ray trace a packing: view factors of every sphere to spheres and walls, each with its error.

Examples:
  greybed trace greybed/datasets/packings/settled_mono_4k.dump --rays 10000 --out runs/trace
  greybed trace bed.csv --wall plane:0,0,0:0,0,1 --wall cylinder:0,0,0:0,0,1:30mm --out runs/trace
  greybed trace bed.csv --wall mesh:oven.stl:mm --wall disc:0,0,0:0,0,1:30mm --out runs/trace

Writes view_factors.h5 and summary.json. A run that was stopped, however abruptly, goes on where
it stopped when the same command is given again, and ends with the same bits. So do runs on
different numbers of threads.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, Any

from greybed.cli.info import add_input_arguments
from greybed.cli.walls import parse_walls

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from greybed.core.packing import Packing
    from greybed.raytrace import ViewFactors

FILE = "view_factors.h5"
STATE = ".trace"
# Work between two saves: some tenths of a second, and long against what a chunk's arrays cost.
RAYS_PER_CHUNK = 4_000_000
RAYS_PER_CHUNK_AND_SPHERE = 400


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``greybed trace``."""
    add_input_arguments(parser)
    parser.add_argument(
        "--rays", type=int, default=10_000, metavar="N", help="rays per sphere (default: 10000)"
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="S", help="same seed, same bits (default: 0)"
    )
    parser.add_argument("--out", required=True, metavar="DIR", help="folder for the results")
    parser.add_argument(
        "--threads", type=int, metavar="T", help="threads (default: all); changes no bit"
    )
    parser.add_argument(
        "--wall",
        action="append",
        default=[],
        metavar="W",
        help="plane:X,Y,Z:NX,NY,NZ (point, normal into the bed), "
        "cylinder:X,Y,Z:AX,AY,AZ:R[:LENGTH] (point of the axis, axis, inner radius), "
        "cone:X,Y,Z:AX,AY,AZ:R:END_R:LENGTH, "
        "disc:X,Y,Z:NX,NY,NZ:R, box:X,Y,Z:X,Y,Z (lower, upper corner; six walls), "
        "polygon:X,Y,Z:X,Y,Z:X,Y,Z... or mesh:FILE[:UNIT] (STL, OBJ, PLY; a wall for each group); "
        "lengths in metres or with a unit (30mm); may be repeated; replaces the walls of an HDF5 "
        "packing",
    )
    parser.add_argument(
        "--max-distance",
        metavar="L",
        help="rays that meet nothing within it escape, such as 20mm (default: no limit)",
    )
    parser.add_argument(
        "--rel-error",
        type=float,
        metavar="E",
        help="trace until every factor of at least --least has this relative standard error, such "
        "as 0.01; in one go, not resumed",
    )
    parser.add_argument(
        "--least", type=float, default=1e-2, metavar="F", help="see --rel-error (default: 0.01)"
    )
    parser.add_argument(
        "--smooth",
        action="store_true",
        help="make factors reciprocal and rows add up to one, with the errors that remain",
    )
    parser.add_argument("--quiet", action="store_true", help="no progress bar")


class State:
    """What a stopped run has finished: one file per chunk of emitters, under a key of the run."""

    def __init__(self, folder: Path, key: str) -> None:
        from greybed.core.files import output_folder

        self.root = folder / STATE
        for other in self.root.glob("*"):
            if other.name != key:  # of other settings: of no use to this run
                shutil.rmtree(other) if other.is_dir() else other.unlink()
        self.folder = output_folder(self.root / key)

    def load(self, first: int, last: int) -> dict[str, NDArray[Any]] | None:
        """Arrays of the emitters first ... last - 1, or None where they are to be traced."""
        import numpy as np

        try:
            # Opened here, for numpy would leave a damaged file open.
            with (
                open(self.folder / f"{first}-{last}.npz", "rb") as stream,
                np.load(stream, allow_pickle=False) as stored,
            ):
                return dict(stored)
        except Exception:  # absent or cut: this chunk is traced again, with the same bits
            return None

    def save(self, first: int, last: int, arrays: dict[str, NDArray[Any]]) -> None:
        """Keep the arrays of a chunk, whole or not at all."""
        import numpy as np

        from greybed.core.files import atomic_path

        with atomic_path(self.folder / f"{first}-{last}.npz") as part, open(part, "wb") as stream:
            np.savez(stream, allow_pickle=False, **arrays)

    def remove(self) -> None:
        """Forget all, once the results are written."""
        shutil.rmtree(self.root, ignore_errors=True)


def _rows(result: ViewFactors, first: int, last: int) -> dict[str, NDArray[Any]]:
    import numpy as np

    rows = slice(first, last)
    return {
        "data": result.factors.data,
        "stderr": result.stderr.data,
        "indices": result.factors.indices,
        "lengths": np.diff(result.factors.indptr)[rows],
        "walls": result.wall_factors[rows],
        "wall_stderr": result.wall_stderr[rows],
        "escaped": result.escaped[rows],
        "escaped_stderr": result.escaped_stderr[rows],
        "buried": result.buried[rows],
        "areas": result.areas[rows],
        "seconds": np.array([result.seconds]),
    }


def _joined(parts: list[dict[str, NDArray[Any]]], rays: int, seed: int) -> ViewFactors:
    import numpy as np
    from scipy import sparse

    from greybed.raytrace import ViewFactors

    whole = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    start = np.concatenate([[0], np.cumsum(whole["lengths"])])
    n = len(whole["escaped"])
    return ViewFactors(
        factors=sparse.csr_array((whole["data"], whole["indices"], start), shape=(n, n)),
        stderr=sparse.csr_array((whole["stderr"], whole["indices"], start), shape=(n, n)),
        wall_factors=whole["walls"],
        wall_stderr=whole["wall_stderr"],
        escaped=whole["escaped"],
        escaped_stderr=whole["escaped_stderr"],
        buried=whole["buried"],
        areas=whole["areas"],
        rays=rays,
        seed=seed,
        seconds=float(whole["seconds"].sum()),
        cost=np.full(n, rays),
    )


def trace_resumably(
    packing: Packing,
    folder: Path,
    *,
    rays: int,
    seed: int,
    threads: int | None,
    max_distance: float,
    show: bool,
) -> tuple[ViewFactors, State, int]:
    """Trace in chunks of emitters that are kept under ``folder`` until the caller removes them.

    Returns
    -------
    result : ViewFactors
        The same bits as one call of :func:`greybed.raytrace.view_factors`.
    state : State
        To be removed once the results are written.
    found : int
        Emitters whose rows an earlier run had left.
    """
    import numpy as np

    from greybed._version import __version__
    from greybed.core.progress import progress
    from greybed.datasets.factors_file import packing_hash
    from greybed.raytrace import view_factors
    from greybed.raytrace.scene import Scene

    n = len(packing)
    work = max(RAYS_PER_CHUNK, RAYS_PER_CHUNK_AND_SPHERE * n)
    size = min(max(work // max(rays, 1), 1), n)
    settings = [__version__, packing_hash(packing), rays, seed, max_distance, size]
    state = State(folder, hashlib.sha256(json.dumps(settings).encode()).hexdigest()[:32])
    parts, found, scene = [], 0, None
    with progress(n * max(rays, 0), "tracing rays", show=show) as advance:
        for first in range(0, n, size):
            last = min(first + size, n)
            part = state.load(first, last)
            if part is not None:
                found += last - first
            else:
                scene = scene or Scene.of(packing)
                result = view_factors(
                    packing,
                    rays=rays,
                    seed=seed,
                    threads=threads,
                    emitters=np.arange(first, last),
                    max_distance=max_distance,
                    scene=scene,
                )
                part = _rows(result, first, last)
                state.save(first, last, part)
            parts.append(part)
            advance((last - first) * rays)
    return _joined(parts, rays, seed), state, found


def summarise(packing: Packing, result: ViewFactors) -> dict[str, Any]:
    """Means of the factors, and what the policy on overlaps did."""
    overlaps = packing.overlaps()
    to_spheres = result.factors.sum(axis=1)
    return {
        "spheres": len(packing),
        "rays_per_sphere": result.rays,
        "seed": result.seed,
        "factors_stored": int(result.factors.nnz),
        "mean_row_sum_to_spheres": float(to_spheres.mean()),
        "mean_to_walls": {
            wall.name: float(mean)
            for wall, mean in zip(packing.walls, result.wall_factors.mean(axis=0), strict=True)
        },
        "mean_escaped": float(result.escaped.mean()),
        "median_stderr": float(_median(result.stderr.data)),
        "overlapping_pairs": overlaps.count,
        "largest_overlap_relative": overlaps.largest,
        "overlap_policy": "buried surface neither emits nor receives; areas are exposed areas",
        "buried_fraction_mean": float(result.buried.mean()),
        "buried_fraction_max": float(result.buried.max()),
        "spheres_partly_buried": int((result.buried > 0.0).sum()),
    }


def _median(values: np.ndarray) -> float:
    import numpy as np

    return float(np.median(values)) if values.size else 0.0


def run(options: argparse.Namespace) -> int:
    """Trace the packing and write its view factors and their summary."""
    from greybed.core.files import output_folder, sole_writer, write_summary
    from greybed.core.readers import read_packing
    from greybed.core.units import parse_quantity
    from greybed.datasets.factors_file import write_factors
    from greybed.raytrace import smoothed, view_factors
    from greybed.raytrace.tally import available_threads

    names = [f"{text.partition(':')[0]}_{k + 1}" for k, text in enumerate(options.wall)]
    walls = [
        wall
        for text, name in zip(options.wall, names, strict=True)
        for wall in parse_walls(text, name)
    ]
    limit = math.inf
    if options.max_distance is not None:
        limit = parse_quantity(options.max_distance, "length", "--max-distance")
    packing = read_packing(options.file, walls, frame=options.frame, unit=options.length_unit)
    folder = output_folder(options.out)
    with sole_writer(folder / f"{STATE}.lock"):
        state, found = None, 0
        if options.rel_error is not None:
            result = view_factors(
                packing,
                rays=options.rays,
                rel_error=options.rel_error,
                least=options.least,
                seed=options.seed,
                threads=options.threads,
                max_distance=limit,
                show_progress=not options.quiet,
            )
        else:
            result, state, found = trace_resumably(
                packing,
                folder,
                rays=options.rays,
                seed=options.seed,
                threads=options.threads,
                max_distance=limit,
                show=not options.quiet,
            )
        cost = int(result.cost.sum())
        if options.smooth:
            result = smoothed(result)
        results = {
            **summarise(packing, result),
            "max_distance_m": limit if math.isfinite(limit) else None,
            "threads": options.threads or available_threads(),
            "seconds_tracing": result.seconds,
            "mrays_per_second": 1e-6 * cost / max(result.seconds, 1e-9),
            "rays_and_lines": cost,
            "rel_error": options.rel_error,
            "least_factor": options.least if options.rel_error is not None else None,
            "smooth": options.smooth,
            "spheres_found_from_stopped_run": found,
        }
        path = write_factors(folder / FILE, packing, result, max_distance=limit)
        summary = write_summary(folder, "trace", results, options.file, seed=options.seed)
        if state is not None:
            state.remove()
    if found:
        print(f"went on from a stopped run: {found} of {len(packing)} spheres were done")
    print(
        f"{len(packing)} spheres, {cost / len(packing):.0f} rays each, {result.seconds:.1f} s, "
        f"{results['mrays_per_second']:.2f} Mray/s on {results['threads']} threads"
    )
    shares = {"spheres": results["mean_row_sum_to_spheres"], **results["mean_to_walls"]}
    print(
        "mean row: "
        + ", ".join(f"{share:.4f} to {name}" for name, share in shares.items())
        + f", {results['mean_escaped']:.4f} escaped"
    )
    print(
        f"{results['overlapping_pairs']} overlapping pairs; buried surface "
        f"{results['buried_fraction_mean']:.2e} mean, {results['buried_fraction_max']:.2e} max"
    )
    print(f"wrote {path}\nwrote {summary}")
    return 0
