"""Convert a packing: dump, CSV, HDF5 or legacy VTK in; CSV, HDF5, VTU or a mesh out.

Examples:
  greybed convert greybed/datasets/packings/settled_mono_4k.dump runs/bed.vtu
  greybed convert bed.dump bed.vtu --length-unit mm
"""

from __future__ import annotations

import argparse
from contextlib import suppress
from pathlib import Path

from greybed.cli.info import add_input_arguments, read_input


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``greybed convert``."""
    add_input_arguments(parser)
    parser.add_argument(
        "out",
        metavar="OUT",
        help="file to write, by extension: .csv, .h5, .vtu (ParaView), .glb, .ply, .stl (meshes)",
    )


def run(options: argparse.Namespace) -> int:
    """Read, write, and say what the new file does not hold."""
    from greybed.core.errors import InputError
    from greybed.core.writers import keeps_surroundings, write_packing

    out = Path(options.out)
    keeps = keeps_surroundings(out)  # an unknown extension is told before any work
    if out.exists() and Path(options.file).exists() and out.samefile(options.file):
        raise InputError(f"{out}: this is the input file itself; choose another name.")
    packing = read_input(options)
    with suppress(OSError):  # what is in the way, the writer says
        out.parent.mkdir(parents=True, exist_ok=True)
    write_packing(packing, out)
    print(f"wrote {out}: {len(packing)} spheres, in metres")
    lost = [
        what
        for what, there in (
            ("box", packing.box is not None),
            ("periodicity", any(packing.periodic)),
            ("walls", packing.n_walls > 0),
        )
        if there
    ]
    if lost and not keeps:
        print(f"left out, for {out.suffix} does not hold them: {', '.join(lost)}; .h5 keeps all")
    return 0
