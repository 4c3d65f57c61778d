"""``greybed trace --emissivity``: exchange factors, their arguments and what is said of them."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

    from greybed.core.packing import Packing

FILE = "exchange_factors.h5"


def add_exchange_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the arguments that ask for reflections."""
    group = parser.add_argument_group("exchange factors (reflections followed)")
    group.add_argument(
        "--emissivity",
        metavar="E[,E...]",
        help="of the spheres; one set of factors for each, such as 0.3,0.65,0.8",
    )
    group.add_argument(
        "--wall-emissivity",
        metavar="E[,E...]",
        help="of all walls or of each; 0 re-radiates what it receives (default: 1)",
    )
    group.add_argument(
        "--specular", type=float, metavar="S", help="mirrored share of what spheres reflect"
    )
    group.add_argument("--wall-specular", type=float, metavar="S", help="the same of the walls")
    group.add_argument(
        "--wall-rays", type=int, metavar="N", help="rays from each wall that ends, for its own row"
    )


def refuse_mixtures(options: argparse.Namespace) -> None:
    """Refuse arguments that do not go together.

    Raises
    ------
    InputError
    """
    from greybed.core.errors import InputError

    extras = ("wall_emissivity", "specular", "wall_specular", "wall_rays")
    others = ("rel_error", "smooth", "workers", "scheduler")
    grey = options.emissivity is not None
    for name in others if grey else extras:
        if getattr(options, name) not in (None, False):
            flag = "--" + name.replace("_", "-")
            raise InputError(
                f"{flag} is for view factors only; leave it out, or leave out --emissivity."
                if grey
                else f"{flag} needs --emissivity, such as --emissivity 0.8."
            )
    if grey and options.device != "cpu":
        raise InputError("--device cuda traces view factors only; leave out --emissivity.")


def run_exchange(
    options: argparse.Namespace, packing: Packing, folder: Path, limit: float
) -> tuple[dict[str, Any], int, Path]:
    """Trace, write and say: the results for the summary, spheres found, and the file."""
    import math
    import time

    from greybed.datasets.exchange_file import write_exchange
    from greybed.datasets.exchanging import ExchangeSettings, exchange_in_blocks

    settings = ExchangeSettings(
        emissivity=_numbers(options.emissivity, "--emissivity"),
        rays=options.rays,
        seed=options.seed,
        wall_emissivity=_numbers(options.wall_emissivity or "1", "--wall-emissivity"),
        specular=options.specular or 0.0,
        wall_specular=options.wall_specular or 0.0,
        wall_rays=options.wall_rays or 0,
        max_distance=limit,
    )
    begin = time.perf_counter()
    factors, found = exchange_in_blocks(
        packing, folder, settings, threads=options.threads, show_progress=not options.quiet
    )
    seconds = time.perf_counter() - begin
    path = write_exchange(folder / FILE, packing, factors, max_distance=limit)
    n = len(packing)
    sets: list[dict[str, Any]] = []
    for emissivity, rows in zip(settings.emissivity, factors, strict=True):
        shares = rows.wall_factors.mean(axis=0)
        sets.append(
            {
                "emissivity": emissivity,
                "mean_absorbed_by_spheres": float(rows.factors.sum() / n),
                "mean_returned_to_itself": float(rows.factors.diagonal().mean()),
                "mean_absorbed_by_walls": {
                    wall.name: float(share)
                    for wall, share in zip(packing.walls, shares, strict=True)
                },
                "mean_escaped": float(rows.escaped.mean()),
                "mean_stderr": float(rows.stderr.data.mean()) if rows.stderr.nnz else None,
                "factors_stored": int(rows.factors.nnz),
                "paths_cut_short": rows.cut,
            }
        )
    results = {
        "spheres": n,
        "rays_per_sphere": options.rays,
        "seed": options.seed,
        "specular": settings.specular,
        "wall_specular": settings.wall_specular,
        "wall_emissivity": list(settings.wall_emissivity),
        "wall_rays": settings.wall_rays,
        "max_distance_m": limit if math.isfinite(limit) else None,
        "buried_fraction_mean": float(factors[0].buried.mean()),
        "seconds_tracing": seconds,
        "mpaths_per_second": 1e-6 * options.rays * (n - found) / max(seconds, 1e-9),
        "spheres_found_from_stopped_run": found,
        "sets": sets,
    }
    print(f"{n} spheres, {options.rays} paths each, {seconds:.1f} s")
    for one in sets:
        walls = "".join(
            f", {share:.4f} by {name}" for name, share in one["mean_absorbed_by_walls"].items()
        )
        print(
            f"emissivity {one['emissivity']:g}: {one['mean_absorbed_by_spheres']:.4f} absorbed by "
            f"spheres ({one['mean_returned_to_itself']:.4f} by the emitter){walls}, "
            f"{one['mean_escaped']:.4f} escaped"
        )
    return results, found, path


def _numbers(text: str, flag: str) -> tuple[float, ...]:
    from greybed.core.errors import InputError

    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise InputError(
            f"{flag} {text!r} is no list of numbers; give one or several in 0 ... 1, such as "
            "0.3,0.8."
        ) from None
