"""What is missing is found, and then nothing more; half a minute on one core.

python examples/verification/diagnosis.py [FIGURE]; a part of run.py.

Measured speeds of nine sizes of spheres in a viscous liquid against Stokes' law, which lacks the
wall of the tube and inertia; then the same rows against the model with what was found.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from greybed.residual import diagnose, read_study

STUDY = Path(__file__).parents[1] / "settling_spheres/study.toml"


def measure(picture: Path) -> dict[str, float]:
    """Draw, and give what is compared."""
    study = read_study(STUDY)
    found = diagnose(study)
    switched = {effect.name: effect.amplitude for effect in found.effects}
    again = diagnose(replace(study, model=replace(study.model, effects=switched)))
    amplitudes = {effect.name: effect for effect in found.effects}
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    error = found.error
    names = ("Stokes", "recalibrated", "with effects")
    scores = (error.base, error.recalibrated, error.with_effect)
    axes[0].bar(names, [s.value for s in scores], color=("0.6", "0.6", "#1b6ca8"))
    axes[0].set(ylabel=error.metric, title="Rows that were held out")
    for k, effect in enumerate(found.effects):
        low, high = np.array(effect.ci95) / effect.theory
        axes[1].plot([k, k], [low, high], "-", color="#1b6ca8", lw=2)
        axes[1].plot(k, effect.amplitude / effect.theory, "o", color="#1b6ca8")
    axes[1].axhline(1.0, color="k", lw=0.8)
    axes[1].set_xticks(range(len(found.effects)), [e.name for e in found.effects])
    axes[1].set(ylabel="found over theory [-]", title="Amplitudes, 95 % intervals", ylim=(0, 1.6))
    axes[1].set_xlim(-0.5, len(found.effects) - 0.5)
    figure.savefig(picture, dpi=110)
    plt.close(figure)
    return {
        "diagnosis.effects": float(set(amplitudes) == {"wall", "inertia"}),
        "diagnosis.wall": amplitudes["wall"].amplitude if "wall" in amplitudes else np.nan,
        "diagnosis.inertia": amplitudes["inertia"].amplitude if "inertia" in amplitudes else np.nan,
        "diagnosis.before": error.base.value,
        "diagnosis.after": error.with_effect.value,
        "diagnosis.again": float(again.verdict == "none"),
    }


def main() -> None:
    print(measure(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images/diagnosis.png")))


if __name__ == "__main__":
    main()
