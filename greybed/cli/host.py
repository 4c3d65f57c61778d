"""Put a closure into another engine: generate an adapter, build it there, run it.

Examples:
  greybed host lammps shipped:filtered_drag_mlp_plain --out runs/lammps
  greybed host lammps shipped:filtered_drag_mlp_plain --out runs/lammps --build --run --ranks 2
  greybed host liggghts shipped:viewfactor_mlp_pencil --out runs/liggghts --build
  greybed host openfoam law:wen-yu --out runs/openfoam --build --run

ENGINE is lammps, liggghts, openfoam, cfdem or mfix; of the last two only text is written, neither
built nor run. MODEL is a .closure file, shipped:NAME, law:NAME for a drag law alone, or law:exact
for the exchange of spheres with nothing between them. --run runs the example beside the adapter.
At the end of a run the host says how often the closure was outside its training data: there it
gives its baseline law, exactly.
"""

from __future__ import annotations

import argparse

ENGINES = ("lammps", "liggghts", "openfoam", "cfdem", "mfix")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments of ``greybed host``."""
    parser.add_argument("engine", metavar="ENGINE", choices=ENGINES, help=", ".join(ENGINES))
    parser.add_argument(
        "model", metavar="MODEL", help="a .closure file, shipped:NAME, law:NAME or law:exact"
    )
    parser.add_argument("--out", required=True, metavar="DIR", help="folder for the adapter")
    parser.add_argument("--build", action="store_true", help="build it against the engine")
    parser.add_argument("--run", action="store_true", help="run the example beside it")
    parser.add_argument("--ranks", type=int, metavar="N", help="MPI ranks of the run (default: 1)")
    parser.add_argument(
        "--law", metavar="LAW", help="drag law that the closure corrects (default: its own)"
    )
    parser.add_argument("--name", metavar="NAME", help="name of the header and its namespace")


def run(options: argparse.Namespace) -> int:
    """Generate, build, run; returns 0."""
    from importlib import import_module

    from greybed.core.errors import InputError
    from greybed.core.files import write_summary
    from greybed.core.folder_lock import locked_folder
    from greybed.hosts import host_model

    if options.ranks is not None and not options.run:
        raise InputError("--ranks is for --run only; leave it out, or add --run.")
    host = import_module(f"greybed.hosts.{options.engine}")
    text_only = not hasattr(host, "build")
    if text_only and (options.build or options.run):
        raise InputError(
            f"{options.engine} is a host of text only: nothing is built or run here; leave out "
            "--build and --run."
        )
    model = host_model(options.model, options.law, options.name)
    with locked_folder(options.out) as folder:
        files = host.generate(model, folder)
        for file in files:
            print(f"wrote {folder / file}")
        results = {
            "engine": options.engine, "model": model.text, "hash": model.hash, "law": model.law,
            "files": files,
        }  # fmt: skip
        print(f"model: {model.text}, hash {model.hash}")
        if options.build:
            results["seconds_build"] = host.build(folder)
            print(f"built in {results['seconds_build']:.1f} s")
        if options.run:
            ranks = 1 if options.ranks is None else options.ranks
            results |= {"ranks": ranks, "seconds_run": host.run(folder, ranks)}
            print(f"ran on {ranks} ranks in {results['seconds_run']:.1f} s")
            results["said"] = host.said(folder)
            for line in results["said"]:
                print(line)
        print(f"wrote {write_summary(folder, 'host', results)}")
        return 0
