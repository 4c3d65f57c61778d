"""The card of a closure as plain results and as text: data, ranges, errors by regime, limits."""

from __future__ import annotations

from typing import Any

import numpy as np

from greybed.closures.artifact import Closure, content_hash
from greybed.closures.drag.filtered.card import drag_lines
from greybed.closures.drag.filtered.closure import QUANTITY

UNITS = {
    "viewfactor": "view factor between spheres",
    "wallfactor": "view factor sphere to wall",
    "exchange": "exchange factor between spheres",
    QUANTITY: "filtered drag: fraction kept along gravity and across it",
}
WORDS = {
    "factor": "F",
    "solid_fraction": "solid fraction",
    "radius_ratio": "r_j / r_i",
    "blocked_fraction": "blocked share",
    "distance_over_radius": "distance from the wall / r",
    "emissivity": "emissivity",
    "kind": "packings",
}


def regime_name(row: dict[str, Any]) -> str:
    """What a regime is, in words, such as ``F 0.001 to 0.01``."""
    word = WORDS.get(str(row["by"]), str(row["by"]))
    if "name" in row:
        return f"{word}: {row['name']}"
    low, high = row.get("low"), row.get("high")
    if high is None or not np.isfinite(high):
        return f"{word} above {low:g}"
    if row["by"] == "radius_ratio" and high - low < 0.01:
        return f"{word} = 1"
    if row["by"] == "blocked_fraction" and high < 1e-6:
        return "nothing between"
    return f"{word} {low:.3g} to {min(high, 1.0) if row['by'] == 'blocked_fraction' else high:.3g}"


def describe_closure(closure: Closure) -> dict[str, Any]:
    """What a closure is and what its card says, as plain values."""
    arrays = closure.predictor.arrays().values()
    return {
        "quantity": closure.quantity,
        "kind": closure.kind,
        "markers": closure.markers.name,
        "hash": content_hash(closure),
        "numbers": int(sum(array.size for array in arrays)),
        "card": closure.card,
    }


def report_closure(results: dict[str, Any], title: str) -> str:
    """Lay the results of :func:`describe_closure` out for reading."""
    card = results["card"]
    lines = [
        title,
        f"  {'gives':<18}{UNITS.get(results['quantity'], results['quantity'])}",
        f"  {'form':<18}{results['kind']}, markers {results['markers']}, "
        f"{results['numbers']} numbers",
        f"  {'hash':<18}{results['hash']}",
    ]
    if not card:
        return "\n".join([*lines, "  untrained: no card"])
    if results["quantity"] == QUANTITY:
        return "\n".join([*lines, *drag_lines(card)])
    packings = ", ".join(f"{n} to {split}" for split, n in card.get("packings", {}).items())
    fractions = card.get("solid_fractions") or [float("nan")]
    lines += [
        f"  {'data':<18}SHA-256 {card.get('data_sha256', 'unknown')}",
        f"  {'packings':<18}{packings}; {', '.join(card.get('kinds', ['random']))}",
        f"  {'solid fractions':<18}{min(fractions):g} to {max(fractions):g}",
    ]
    for name, (low, high) in card.get("ranges", {}).items():
        lines.append(f"  {name:<30}{low:.4g} to {high:.4g}")
    score = card.get("score", {})
    if score:
        lines.append(
            f"  held-out packings: R2 {score['r2']:.5f}, own error {score['rmse_own']:.2e} rms "
            f"(trace {score['noise']:.1e}), 95 % intervals hold {100 * score['coverage95']:.1f} %"
        )
    for row in card.get("regimes", ()):
        lines.append(
            f"    {regime_name(row):<38}{row['rmse']:.2e} rms ({100 * row['relative']:.1f} %), "
            f"bias {row['bias']:+.1e}, 95 %: {100 * row['coverage95']:.1f} %"
        )
    for case, error in card.get("limits", {}).items():
        lines.append(f"    {case:<56}{error:.1e}")
    return "\n".join(lines)
