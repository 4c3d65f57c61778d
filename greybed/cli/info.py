"""Describe a packing (spheres, radii, box, walls, overlaps, coordination) or a closure (its card).

Examples:
  greybed info greybed/datasets/packings/settled_mono_4k.dump
  greybed info bed.csv --out runs/bed
  greybed info shipped:viewfactor_mlp_pencil
"""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from greybed.core.packing import Packing

# Surfaces closer than this share of the smaller radius count as touching.
TOUCHING = 1e-3


def add_input_arguments(
    parser: argparse.ArgumentParser, files: str = "dump, CSV, HDF5 or legacy VTK"
) -> None:
    """Add the packing file and what has to be said about files that do not say it themselves."""
    parser.add_argument("file", metavar="FILE", help=files)
    parser.add_argument(
        "--length-unit",
        metavar="U",
        help="length unit of a dump or VTK file, such as mm (default: m; CSV and HDF5 say theirs)",
    )
    parser.add_argument(
        "--frame",
        type=int,
        metavar="K",
        help="frame of a dump, from 0, or from the end where negative (default: the last)",
    )


def read_input(options: argparse.Namespace) -> Packing:
    """Read the packing that the arguments of :func:`add_input_arguments` name."""
    from greybed.core.readers import read_packing

    return read_packing(options.file, frame=options.frame, unit=options.length_unit)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``greybed info``."""
    add_input_arguments(parser, "dump, CSV, HDF5 or legacy VTK; a .closure file or shipped:NAME")
    parser.add_argument("--out", metavar="DIR", help="also write DIR/summary.json")


def describe(packing: Packing) -> dict[str, Any]:
    """Measure a packing.

    Parameters
    ----------
    packing : Packing
        The bed.

    Returns
    -------
    results : dict
        Plain numbers under names that end in their unit; lengths in metres.
    """
    import numpy as np

    r = packing.radii
    low, high = packing.bounds
    around = packing.centres - r[:, None], packing.centres + r[:, None]
    hull = np.prod(around[1].max(axis=0) - around[0].min(axis=0))
    pairs, distance = packing.neighbours(TOUCHING * float(r.max()))
    smaller = r[pairs].min(axis=1)
    gap = distance - r[pairs].sum(axis=1)
    touching = pairs[gap < TOUCHING * smaller]
    contacts = np.bincount(touching.ravel(), minlength=len(packing))
    overlapping = gap < 0.0
    deepest = float((-gap[overlapping] / smaller[overlapping]).max(initial=0.0))
    return {
        "spheres": len(packing),
        "radius_min_m": float(r.min()),
        "radius_median_m": float(np.median(r)),
        "radius_max_m": float(r.max()),
        "monodisperse": packing.is_monodisperse,
        "box_given": packing.box is not None,
        "box_low_m": low.tolist(),
        "box_high_m": high.tolist(),
        "periodic": list(packing.periodic),
        "walls": [wall.name for wall in packing.walls],
        "solid_fraction_of_box": packing.solid_fraction,
        "solid_fraction_of_bounding_box": packing.sphere_volume / float(hull),
        "overlapping_pairs": int(overlapping.sum()),
        "largest_overlap_relative": deepest,
        "touching_gap_relative": TOUCHING,
        "coordination_mean": float(contacts.mean()),
        "coordination_min": int(contacts.min()),
        "coordination_max": int(contacts.max()),
    }


def report(results: dict[str, Any], title: str) -> str:
    """Lay the results of :func:`describe` out for reading."""
    axes = [
        f"  {'box ' + axis if results['box_given'] else 'extent ' + axis:<18}"
        f"{low:g} to {high:g} m{', periodic' if wraps else ''}"
        for axis, low, high, wraps in zip(
            "xyz",
            results["box_low_m"],
            results["box_high_m"],
            results["periodic"],
            strict=True,
        )
    ]
    if results["monodisperse"]:
        radii = f"{results['radius_min_m']:g} m, all equal"
    else:
        radii = "{radius_min_m:g} / {radius_median_m:g} / {radius_max_m:g} m (min/median/max)"
        radii = radii.format(**results)
    of_box = f"{results['solid_fraction_of_box']:.4f} of the box, " if results["box_given"] else ""
    lines = [
        title,
        f"  {'spheres':<18}{results['spheres']}",
        f"  {'radius':<18}{radii}",
        *axes,
        f"  {'walls':<18}{', '.join(results['walls']) or 'none'}",
        f"  {'solid fraction':<18}{of_box}"
        f"{results['solid_fraction_of_bounding_box']:.4f} of the bounding box of the spheres",
        f"  {'overlaps':<18}{results['overlapping_pairs']} pairs, deepest "
        f"{results['largest_overlap_relative']:.2e} of the smaller radius",
        f"  {'coordination':<18}{results['coordination_mean']:.2f} mean, "
        f"{results['coordination_min']} to {results['coordination_max']} (spheres with gap below "
        f"{TOUCHING:g} of the smaller radius; walls not counted)",
    ]
    return "\n".join(lines)


def run(options: argparse.Namespace) -> int:
    """Print the description and, with ``--out``, write it."""
    from greybed.closures.artifact import SUFFIX
    from greybed.closures.shipping import PREFIX, model_path

    file = options.file
    if str(file).startswith(PREFIX) or str(file).endswith(SUFFIX):
        from greybed.closures import load_any
        from greybed.closures.card import describe_closure, report_closure

        file = model_path(file)
        results = describe_closure(load_any(file))
        print(report_closure(results, str(options.file)))
    else:
        results = describe(read_input(options))
        print(report(results, str(file)))
    if options.out:
        from greybed.core.files import write_summary
        from greybed.core.folder_lock import locked_folder

        with locked_folder(options.out) as folder:
            summary = write_summary(folder, "info", results, file)
        print(f"wrote {summary}")
    return 0
