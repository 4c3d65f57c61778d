"""``greybed check --against``: a closure of view factors beside the traced ones of a bed."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from scipy import sparse

    from greybed.closures.artifact import Closure

# Traced factors above these are compared one by one [-].
LEAST = (0.01, 0.001)


def add_against_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the trace, and the bed that it is of."""
    group = parser.add_argument_group("against a trace (closures of view factors)")
    group.add_argument(
        "--against", metavar="TRACE", help="folder of greybed trace, or its view_factors.h5"
    )
    group.add_argument("--bed", metavar="FILE", help="the bed that was traced")
    group.add_argument(
        "--wall", action="append", default=[], metavar="W", help="its walls, as for greybed trace"
    )
    group.add_argument("--length-unit", metavar="U", help="of the bed, as for greybed trace")
    group.add_argument("--frame", type=int, metavar="K", help="of the bed, as for greybed trace")


def refuse_without_trace(options: argparse.Namespace) -> None:
    """Refuse a trace without its bed, and a bed without a trace.

    Raises
    ------
    InputError
        With what is missing.
    """
    from greybed.core.errors import InputError

    if options.against is not None and options.bed is None:
        raise InputError("--against needs the bed that was traced; give --bed FILE and its --wall.")
    if options.against is None and (options.bed is not None or options.wall):
        word = "--wall" if options.bed is None else "--bed"
        raise InputError(f"{word} is for --against only; give the trace, or leave it out.")


def against(options: argparse.Namespace, closure: Closure) -> dict[str, Any]:
    """Compare all pairs of a bed, and its walls.

    Parameters
    ----------
    options : Namespace
        With those of :func:`add_against_arguments`.
    closure : Closure
        One of view factors.

    Returns
    -------
    dict
        Numbers for the summary: R2 [-], rms error [-], mean relative errors [-], shares of walls.

    Raises
    ------
    InputError
        If the bed is not the one that was traced, or the closure is of something else.
    """
    import numpy as np

    from greybed.cli.walls import parse_walls
    from greybed.core.errors import InputError
    from greybed.core.readers import read_packing
    from greybed.datasets.factors_file import read_factors

    if closure.quantity != "viewfactor":
        raise InputError(f"--against is for closures of view factors, not of {closure.quantity}.")
    walls = [
        wall for k, text in enumerate(options.wall) for wall in parse_walls(text, f"wall_{k + 1}")
    ]
    packing = read_packing(options.bed, walls, frame=options.frame, unit=options.length_unit)
    place = Path(options.against)
    stored = read_factors(place / "view_factors.h5" if place.is_dir() else place)
    stored.check(packing)
    traced = stored.result
    # Markers speak of whole beds; rays that ended early would leave out what the closure counts.
    if np.isfinite(stored.max_distance):
        raise InputError(f"{place}: its rays ended early; trace without --max-distance.")
    learnt = closure.bed_factors(packing)  # type: ignore[union-attr]
    truth, made = (_pairs(result.factors) for result in (traced, learnt))
    pairs = len(packing) * (len(packing) - 1)
    error2 = float(((made - truth).data ** 2).sum())
    spread = float((truth.data**2).sum() - truth.data.sum() ** 2 / pairs)
    noise2 = float((traced.stderr.data**2).sum())
    found: dict[str, Any] = {
        "spheres": len(packing),
        "rays_per_sphere": traced.rays,
        "r2": 1.0 - error2 / spread,
        "rms_error": float(np.sqrt(error2 / pairs)),
        "rms_stderr_of_trace": float(np.sqrt(noise2 / pairs)),
        "rms_error_without_noise": float(np.sqrt(max(error2 - noise2, 0.0) / pairs)),
        "extrapolated": learnt.extrapolated,
    }
    seen = truth.tocoo()
    beside = made[seen.row, seen.col]
    relative = np.abs(beside - seen.data) / seen.data
    for least in LEAST:
        large = seen.data > least
        mean = float(relative[large].mean()) if large.any() else None
        found[f"factors_above_{least:g}"] = int(large.sum())
        found[f"mean_relative_error_above_{least:g}"] = mean
    found["walls"] = {
        name: {"traced": float(a.mean()), "closure": float(b.mean())}
        for name, a, b in zip(
            [*stored.wall_names, "opening"],
            [*traced.wall_factors.T, traced.escaped],
            [*learnt.wall_factors.T, learnt.escaped],
            strict=True,
        )
    }
    return found


def _pairs(factors: sparse.csr_array) -> sparse.csr_array:
    """Factors without what a sphere sees of its own images, and without stored zeros."""
    from scipy import sparse

    others = sparse.csr_array(factors - sparse.diags_array(factors.diagonal()))
    others.eliminate_zeros()
    return others


def against_text(found: dict[str, Any]) -> str:
    """The comparison in lines."""
    lines = [
        f"against the trace of {found['spheres']} spheres, {found['rays_per_sphere']} rays each",
        f"  R2 of all pairs {found['r2']:.5f}, rms error {found['rms_error']:.2e} "
        f"({found['rms_stderr_of_trace']:.2e} is the trace's noise, so the closure's own is "
        f"{found['rms_error_without_noise']:.2e})",
    ]
    for least in LEAST:
        count = found[f"factors_above_{least:g}"]
        if count:
            mean = 100.0 * found[f"mean_relative_error_above_{least:g}"]
            lines.append(f"  F above {least:g}: {count} factors, mean relative error {mean:.1f} %")
    lines.append(f"  outside the training data: {100.0 * found['extrapolated']:.2g} % of the pairs")
    for name, shares in found["walls"].items():
        lines.append(
            f"  mean share of {name}: traced {shares['traced']:.4f}, "
            f"closure {shares['closure']:.4f}"
        )
    return "\n".join(lines)
