"""Ray trace a packing: view factors of every sphere to spheres and walls, each with its error.

Examples:
  greybed trace greybed/datasets/packings/settled_mono_4k.dump --rays 2000 --out runs/traced
  greybed trace bed.csv --wall plane:0,0,0:0,0,1 --wall cylinder:0,0,0:0,0,1:30mm --out runs/trace
  greybed trace bed.csv --wall mesh:oven.stl:mm --wall disc:0,0,0:0,0,1:30mm --out runs/trace
  greybed trace bed.csv --emissivity 0.3,0.8 --out runs/exchange

Writes view_factors.h5, with --emissivity exchange_factors.h5 instead, and summary.json. A run
that was stopped, however abruptly, goes on where it stopped when the same command is given again,
and ends with the same bits. So do runs on different numbers of threads, on several processes
(--workers) and on the workers of a dask.distributed scheduler (--scheduler). Memory does not grow
with the number of factors, but for --smooth, --rel-error and --emissivity.
"""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING, Any

from greybed.cli.info import add_input_arguments
from greybed.cli.trace_exchange import add_exchange_arguments, refuse_mixtures, run_exchange
from greybed.cli.walls import parse_walls

if TYPE_CHECKING:
    from collections.abc import Sequence

    from greybed.core.packing import Packing
    from greybed.datasets.factors_file import Block
    from greybed.raytrace import ViewFactors

FILE = "view_factors.h5"


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
    parser.add_argument("--workers", type=int, metavar="N", help="processes that share the threads")
    parser.add_argument(
        "--scheduler",
        metavar="WHERE",
        help="who traces: local, the address of a dask.distributed scheduler such as "
        "tcp://host:8786, or a TOML file of Slurm jobs",
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
        help="rays end there, such as 20mm; inside the bed what is left of a row belongs to the "
        "local surroundings (default: no limit)",
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
    parser.add_argument(
        "--device",
        choices=("cpu", "cuda"),
        default="cpu",
        help="cuda traces on an NVIDIA GPU (needs greybed[gpu])",
    )
    add_exchange_arguments(parser)
    parser.add_argument("--quiet", action="store_true", help="no progress bar")


def summarise(packing: Packing, blocks: Sequence[Block], rays: int, seed: int) -> dict[str, Any]:
    """Means of the factors, and what the policy on overlaps did."""
    import numpy as np

    def rows(name: str) -> Any:
        return np.concatenate([block[name] for block in blocks])

    overlaps = packing.overlaps()
    buried, stored = rows("buried"), int(rows("lengths").sum())
    return {
        "spheres": len(packing),
        "rays_per_sphere": rays,
        "seed": seed,
        "factors_stored": stored,
        "mean_row_sum_to_spheres": float(rows("sums").mean()),
        "mean_to_walls": {
            wall.name: float(mean)
            for wall, mean in zip(packing.walls, rows("wall_factors").mean(axis=0), strict=True)
        },
        "mean_escaped": float(rows("escaped").mean()),
        "mean_environment": float(rows("environment").mean()),
        "mean_stderr": float(sum(block["stderr"].sum() for block in blocks)) / max(stored, 1),
        "overlapping_pairs": overlaps.count,
        "largest_overlap_relative": overlaps.largest,
        "overlap_policy": "buried surface neither emits nor receives; areas are exposed areas",
        "buried_fraction_mean": float(buried.mean()),
        "buried_fraction_max": float(buried.max()),
        "spheres_partly_buried": int((buried > 0.0).sum()),
    }


def run(options: argparse.Namespace) -> int:
    """Trace the packing and write its view factors and their summary."""
    from greybed.core.errors import InputError
    from greybed.core.files import write_summary
    from greybed.core.folder_lock import locked_folder
    from greybed.core.processors import available_threads
    from greybed.core.readers import read_packing
    from greybed.core.units import parse_quantity
    from greybed.datasets.exchanging import forget_blocks
    from greybed.datasets.factors_file import block_of, write_factors
    from greybed.datasets.tracing import Settings, trace_in_blocks
    from greybed.raytrace import smoothed, view_factors

    if options.rel_error is not None and (options.workers or options.scheduler):
        raise InputError("--rel-error traces in one go: leave out --workers and --scheduler.")
    refuse_mixtures(options)
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
    n = len(packing)
    with locked_folder(options.out) as folder:
        path = folder / FILE
        if options.emissivity is not None:
            results, found, path = run_exchange(options, packing, folder, limit)
            summary = write_summary(folder, "trace", results, options.file, seed=options.seed)
            forget_blocks(folder)
            if found:
                print(f"went on from a stopped run: {found} of {n} spheres were done")
            print(f"wrote {path}\nwrote {summary}")
            return 0
        traced, found = None, 0
        result: ViewFactors | None = None
        if options.rel_error is not None:
            result = view_factors(
                packing,
                rays=options.rays,
                rel_error=options.rel_error,
                least=options.least,
                seed=options.seed,
                threads=options.threads,
                max_distance=limit,
                smooth=options.smooth,
                device=options.device,
                show_progress=not options.quiet,
            )
            seconds = result.seconds
        else:
            traced = trace_in_blocks(
                packing,
                folder,
                Settings(options.rays, options.seed, limit, options.device),
                threads=options.threads,
                workers=options.workers,
                scheduler=options.scheduler,
                show_progress=not options.quiet,
            )
            found, seconds = traced.found, traced.seconds
            if options.smooth:
                result = smoothed(traced.joined())
        blocks: Sequence[Block]
        if result is not None:
            blocks = [block_of(result, 0, n)]
            write_factors(path, packing, result, max_distance=limit)
        else:
            assert traced is not None
            blocks = traced.blocks
            traced.write(path)
        cost = int(sum(block["cost"].sum() for block in blocks))
        threads = options.threads or available_threads()
        results = {
            **summarise(packing, blocks, options.rays, options.seed),
            "max_distance_m": limit if math.isfinite(limit) else None,
            "threads": None if options.scheduler else threads,
            "workers": options.workers,
            "seconds_tracing": seconds,
            "mrays_per_second": 1e-6 * cost * (1.0 - found / n) / max(seconds, 1e-9),
            "rays_and_lines": cost,
            "rel_error": options.rel_error,
            "least_factor": options.least if options.rel_error is not None else None,
            "smooth": options.smooth,
            "spheres_found_from_stopped_run": found,
        }
        summary = write_summary(folder, "trace", results, options.file, seed=options.seed)
        if traced is not None:
            traced.remove()
    if found:
        print(f"went on from a stopped run: {found} of {n} spheres were done")
    where = f"at {options.scheduler}" if options.scheduler else f"on {threads} threads"
    print(
        f"{n} spheres, {cost / n:.0f} rays each, {seconds:.1f} s, "
        f"{results['mrays_per_second']:.2f} Mray/s {where}"
    )
    shares = {"spheres": results["mean_row_sum_to_spheres"], **results["mean_to_walls"]}
    beyond = f", {results['mean_environment']:.4f} beyond" if math.isfinite(limit) else ""
    print(
        "mean row: "
        + ", ".join(f"{share:.4f} to {name}" for name, share in shares.items())
        + f", {results['mean_escaped']:.4f} escaped{beyond}"
    )
    print(
        f"{results['overlapping_pairs']} overlapping pairs; buried surface "
        f"{results['buried_fraction_mean']:.2e} mean, {results['buried_fraction_max']:.2e} max"
    )
    print(f"wrote {path}\nwrote {summary}")
    return 0
