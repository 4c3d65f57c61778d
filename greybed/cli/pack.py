"""Generate a random packing of spheres at an exact solid fraction, without overlaps.

Examples:
  greybed pack --count 500 --fraction 0.5 --sizes mono:1.5mm --seed 1 --out runs/bed.h5
  greybed pack --count 4000 --fraction 0.58 --sizes discrete:1mm=0.3,1.5mm=0.35,2mm=0.35 \\
      --container cylinder --container-radius 30mm --seed 7 --out runs/column

The container grows or shrinks to hold exactly that fraction; a fraction out of reach is refused
with the one that was reached. --shake parts the spheres that just touch. summary.json stands
beside the packing; only .h5 keeps the box, what repeats, and the walls.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from greybed.datasets.containers import Container


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``greybed pack``."""
    parser.add_argument("--count", type=int, required=True, metavar="N", help="number of spheres")
    parser.add_argument(
        "--fraction",
        type=float,
        required=True,
        metavar="PHI",
        help="solid fraction: sphere volume over container volume",
    )
    parser.add_argument(
        "--sizes",
        required=True,
        metavar="TEXT",
        help="radii: mono:R, lognormal:MEDIAN,SD, uniform:MIN,MAX or discrete:R=MASS_FRACTION,...",
    )
    parser.add_argument(
        "--container",
        choices=("periodic", "slab", "box", "cylinder"),
        default="periodic",
        help="periodic box; slab: periodic with floor and lid; walled box; cylinder with flat "
        "ends (default: periodic)",
    )
    parser.add_argument(
        "--container-radius",
        metavar="R",
        help="inner radius of the cylinder, such as 30mm (default: as wide as it is high)",
    )
    parser.add_argument(
        "--shake",
        type=int,
        default=0,
        metavar="SWEEPS",
        help="hard-sphere Monte-Carlo sweeps afterwards (default: 0)",
    )
    parser.add_argument(
        "--seed", type=int, default=0, metavar="S", help="same seed, same bits (default: 0)"
    )
    parser.add_argument(
        "--out",
        required=True,
        metavar="FILE_OR_DIR",
        help="a .h5, .csv or .vtu file, or a folder for packing.h5",
    )


def _container(kind: str, radius: str | None) -> Container:
    from greybed.core.errors import InputError
    from greybed.core.units import parse_quantity
    from greybed.datasets.containers import Box, CylinderContainer, PeriodicBox

    if kind == "cylinder":
        if radius is None:
            return CylinderContainer()
        return CylinderContainer(radius=parse_quantity(radius, "length", "--container-radius"))
    if radius is not None:
        raise InputError(
            f"--container-radius {radius} has no meaning for --container {kind}; "
            "leave it out or choose --container cylinder."
        )
    return Box() if kind == "box" else PeriodicBox(floor_and_lid=kind == "slab")


def _target(out: str) -> Path:
    """File to write: ``out`` itself, or packing.h5 in the folder ``out``."""
    from greybed.core.writers import keeps_surroundings

    path = Path(out)
    if path.is_dir() or not path.suffix or out.endswith("/"):
        return path / "packing.h5"
    keeps_surroundings(path)  # refuses an unknown extension before the work, not after it
    return path


def run(options: argparse.Namespace) -> int:
    """Generate the packing, write it and its summary."""
    from time import perf_counter

    from greybed.cli.info import describe
    from greybed.core.files import write_summary
    from greybed.core.folder_lock import locked_folder
    from greybed.core.sizes import parse_sizes
    from greybed.core.writers import keeps_surroundings, write_packing
    from greybed.datasets.containers import solid_fraction_between_walls, wall_overlap
    from greybed.datasets.generate import random_packing

    sizes = parse_sizes(options.sizes)
    container = _container(options.container, options.container_radius)
    target = _target(options.out)
    with locked_folder(target.parent) as folder:
        begin = perf_counter()
        packing = random_packing(
            options.count,
            options.fraction,
            sizes,
            container=container,
            seed=options.seed,
            shake=options.shake,
            show_progress=True,
        )
        seconds = perf_counter() - begin
        measured = describe(packing)
        results = {
            "file": target.name,
            "sizes": options.sizes,
            "container": options.container,
            "shake_sweeps": options.shake,
            "solid_fraction_requested": options.fraction,
            "solid_fraction_reached": solid_fraction_between_walls(packing),
            "largest_wall_overlap_relative": wall_overlap(packing),
            "contacts": round(0.5 * measured["coordination_mean"] * len(packing)),
            "seconds": seconds,
            **measured,
        }
        write_packing(packing, target)
        summary = write_summary(folder, "pack", results, seed=options.seed)
    print(
        f"{len(packing)} spheres, solid fraction {results['solid_fraction_reached']:.6f}, "
        f"{measured['overlapping_pairs']} overlaps, coordination "
        f"{measured['coordination_mean']:.2f}, {seconds:.1f} s"
    )
    if not keeps_surroundings(target):
        print(f"note: {target.suffix} keeps no box and no walls; summary.json states the box.")
    print(f"wrote {target}\nwrote {summary}")
    return 0
