"""Make a data set for training: traced packings, or filtered flows of gas and particles.

Examples:
  greybed dataset viewfactor examples/viewfactor/small.toml --out runs/small.h5
  greybed dataset viewfactor --out runs/viewfactor.h5 --workers 2
  greybed dataset drag examples/filtered_drag/small.toml --out runs/drag.h5
  greybed dataset drag examples/filtered_drag/default.toml --out runs/drag.h5 --minutes 60

Without a design the default one is made: 70 packings of solid fraction 0.05 to 0.64, random,
walled, sheared, layered and on lattices, some minutes on two cores. A killed run continues where
it stopped when the same command is given again. A design lists packings and how they are traced:

  rays = 150000                 # per emitter
  emitters = 40                 # per packing
  seed = 1
  exchange = true               # also exchange factors, which take longest
  [[packing]]
  kind = "random"
  fraction = 0.5
  sizes = "lognormal:1mm,1.3"   # as for greybed pack
  count = 500
  shake = 100
  split = "train"               # train, calibrate or test; each must be there

Other kinds: "walled" (container = "box" or "cylinder"), "sheared" (stretch), "layered" (upper,
upper_sizes) and "lattice" (lattice = "sc", "bcc" or "fcc", jitter, cells).

A design of filtered drag lists flows in boxes that repeat, and the filters that go over them; see
docs/filtered_drag.md. With --minutes it stops after so long and goes on when it is given again;
with --case only the named ones run, so that several processes can share the work.
"""

from __future__ import annotations

import argparse
import time


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``greybed dataset``."""
    parser.add_argument("quantity", choices=("viewfactor", "drag"), help="what it will give")
    parser.add_argument("design", nargs="?", help="TOML file (default: the built-in design)")
    parser.add_argument("--out", required=True, metavar="FILE", help="HDF5 file to write")
    parser.add_argument(
        "--workers", type=int, default=1, metavar="N",
        help="processes; the result does not depend on it (default: 1, on all cores)",
    )  # fmt: skip
    parser.add_argument("--seed", type=int, metavar="S", help="overrides the design's seed")
    parser.add_argument("--minutes", type=float, metavar="M", help="drag: stop after so long")
    parser.add_argument(
        "--case", action="append", default=[], metavar="NAME", help="drag: only this case; repeat"
    )


def run(options: argparse.Namespace) -> int:
    """Make the data set."""
    if options.quantity == "drag":
        from greybed.cli.dataset_drag import run_drag

        return run_drag(options)
    for name, given in (("--minutes", options.minutes is not None), ("--case", options.case)):
        if given:
            from greybed.core.errors import InputError

            raise InputError(f"{name} is for greybed dataset drag; leave it out.")
    from dataclasses import replace

    from greybed.core.config import read_case
    from greybed.core.files import writable_file, write_summary
    from greybed.core.folder_lock import locked_folder
    from greybed.datasets.beds import SPLITS
    from greybed.datasets.viewfactor import Design, default_design, generate

    design = read_case(options.design, Design) if options.design else default_design()
    if options.seed is not None:
        design = replace(design, seed=options.seed)
    target = writable_file(options.out)
    with locked_folder(target.parent):
        begin = time.perf_counter()
        data = generate(design, target, workers=options.workers, show_progress=True)
        splits = {s: sum(p["split"] == s for p in data.packings) for s in SPLITS}
        inputs = [options.design] if options.design else []
        write_summary(
            target.parent,
            "dataset viewfactor",
            {
                "file": target.name,
                "rows": len(data),
                "packings": splits,
                "data_sha256": data.digest,
                "seconds": time.perf_counter() - begin,
            },
            *inputs,
            seed=design.seed,
        )
    print(f"{target}: {len(data)} pairs of {len(data.packings)} packings {splits}")
    print(f"next: greybed train viewfactor {target} --out {target.parent}")
    return 0
