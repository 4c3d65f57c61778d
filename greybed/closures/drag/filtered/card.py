"""The card of a closure of filtered drag as lines of text."""

from __future__ import annotations

from typing import Any


def drag_lines(card: dict[str, Any]) -> list[str]:
    """What data it was trained on, how far it is off, and beside what."""
    sources = ", ".join(card.get("sources", ()))
    lines = [
        f"  {'convention':<18}{card.get('convention', '')}",
        f"  {'data':<18}SHA-256 {card.get('data_sha256') or 'unknown'}",
        f"  {'cases':<18}{card.get('cases')} ({sources}), drag law {card.get('law')}",
    ]
    for name, (low, high) in card.get("ranges", {}).items():
        lines.append(f"  {name:<30}{low:.4g} to {high:.4g}")
    score = card.get("score", {})
    if score:
        lines.append(
            f"  held-out cases: R2 of the drift flux {score['drift_r2']:.3f}, of H "
            f"{score['kept_r2']:.3f}; H off by {score['kept_rms']:.3f} rms, bias "
            f"{score['kept_bias']:+.3f}; 95 % intervals hold {100 * card['coverage95']:.1f} %"
        )
    for row in card.get("guesses", ()):
        lines.append(
            f"    {row['name']:<38}drift flux {row['drift_r2']:.3f}, H {row['kept_r2']:.3f}, off "
            f"by {row['kept_rms']:.3f} rms"
        )
    for case, error in card.get("limits", {}).items():
        lines.append(f"    {case:<56}{error:.1e}")
    return lines
