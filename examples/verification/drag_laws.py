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

from greybed.closures.drag import LAWS
from greybed.core.files import output_folder

BEDS = [law for law in LAWS.values() if law.bed]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    out = output_folder(parser.parse_args().out)
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
    figure.savefig(out / "drag_laws.png", dpi=110)


if __name__ == "__main__":
    main()
