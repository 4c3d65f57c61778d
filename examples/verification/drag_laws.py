"""Plot of the drag laws: python examples/verification/drag_laws.py --out DIR. Seconds.

Writes drag_laws.png: F over the solid fraction at three Reynolds numbers, and over Re in a bed.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt
from fluids.drag import Haider_Levenspiel
from fluids.packed_bed import Ergun

from greybed.closures.drag import LAWS
from greybed.core.files import output_folder

SLOW = ("stokes", "schiller-naumann", "clift-gauvin", "haider-levenspiel", "wen-yu", "bvk")
BEDS = [law for law in LAWS.values() if law.bed]


def measure(picture: Path) -> dict[str, float]:
    """Draw, and give what is compared: limits that are known, and two laws by other hands."""
    figure, axes = plt.subplots(2, 2, figsize=(11, 8), constrained_layout=True)
    phi = np.linspace(0.0, 0.62, 400)
    colours = plt.get_cmap("tab20")(np.arange(len(BEDS)) % 20)
    for axis, re in zip(axes.flat, (0.1, 10.0, 100.0), strict=False):
        for law, colour in zip(BEDS, colours, strict=True):
            inside = ~law.outside(phi, re)
            axis.semilogy(phi, law(phi, re), ":", color=colour, lw=0.8)
            axis.semilogy(phi, np.where(inside, law(phi, re), np.nan), color=colour, label=law.name)
        axis.set(xlabel="solid fraction [-]", ylabel="F [-]", title=f"Re = {re:g}", ylim=(0.9, 300))
    re = np.geomspace(1e-2, 3e3, 400)
    for law, colour in zip(BEDS, colours, strict=True):
        axes[1, 1].loglog(re, law(0.4, re), color=colour)
    axes[1, 1].set(xlabel="Re [-]", ylabel="F [-]", title="solid fraction 0.4")
    axes[0, 0].legend(fontsize=8)
    figure.savefig(picture, dpi=110)
    plt.close(figure)
    # 18 mu phi F U / (eps d^2) is the pressure gradient; here with mu = rho = d = 1, so U = Re.
    bed = Ergun(dp=1.0, voidage=0.4, vs=50.0, rho=1.0, mu=1.0, L=1.0)
    return {
        "drag.stokes": max(abs(float(LAWS[name](0.0, 1e-12)) - 1.0) for name in SLOW),
        "drag.ergun": float(LAWS["ergun"](0.6, 50.0)) * 18.0 * 0.6 * 50.0 / 0.4 / bed - 1.0,
        "drag.sphere": float(LAWS["haider-levenspiel"](0.0, 100.0))
        / (Haider_Levenspiel(100.0) * 100.0 / 24.0)
        - 1.0,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    print(measure(output_folder(parser.parse_args().out) / "drag_laws.png"))


if __name__ == "__main__":
    main()
