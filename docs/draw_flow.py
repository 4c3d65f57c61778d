"""Picture of the rooms and of what flows between them: python docs/draw_flow.py [FILE]."""

from __future__ import annotations

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

# Room -> place, and what it does. Colours are layers: a room imports paler ones only.
ROOMS = {
    "core": (0.0, 3.6, "packings, walls, units", 0),
    "raytrace": (2.6, 5.0, "view and exchange factors", 1),
    "dem": (2.6, 3.6, "particles", 1),
    "cfd": (2.6, 2.2, "gas, two fluids", 1),
    "coupling": (5.2, 2.9, "beds, particles in gas", 2),
    "datasets": (5.2, 5.0, "traced, filtered", 3),
    "training": (7.8, 5.0, "fit and score", 4),
    "closures": (10.4, 5.0, "limits exact, no torch", 1),
    "export": (10.4, 3.6, "C++, C, Fortran, ONNX", 2),
    "hosts": (10.4, 2.2, "LAMMPS, LIGGGHTS, OpenFOAM", 3),
    "calibration": (5.2, 0.6, "parameters, ambiguity", 4),
    "residual": (7.8, 0.6, "what the model lacks", 5),
    "report": (10.4, 0.6, "one page", 6),
    "blind": (10.4, -0.8, "sealed data, score", 6),
    "measured data": (0.0, 0.6, "tables of a laboratory", None),
}
# From, to, what flows, bend, shift of the words.
FLOWS = (
    ("core", "raytrace", "", 0.0, (0, 0)),
    ("core", "dem", "packing", 0.0, (0, 0.18)),
    ("raytrace", "datasets", "factors", 0.0, (0, 0.18)),
    ("raytrace", "coupling", "factors", 0.0, (0.5, 0.25)),
    ("dem", "coupling", "", 0.0, (0, 0)),
    ("cfd", "coupling", "", 0.0, (0, 0)),
    ("coupling", "datasets", "filtered flows", 0.0, (0.68, 0.1)),
    ("datasets", "training", "HDF5", 0.0, (0, 0.18)),
    ("training", "closures", ".closure", 0.0, (0, 0.18)),
    ("closures", "export", "", 0.0, (0, 0)),
    ("export", "hosts", "libraries", 0.0, (0.48, 0)),
    ("closures", "coupling", "factors, drag", 0.0, (-0.5, 0.3)),
    ("measured data", "calibration", "", 0.0, (0, 0)),
    ("measured data", "residual", "", 0.22, (0, 0)),
    ("coupling", "calibration", "runs", 0.0, (-0.3, 0)),
    ("coupling", "residual", "runs", -0.15, (0.5, 0.4)),
    ("calibration", "residual", "misfit", 0.0, (0, 0.18)),
    ("residual", "coupling", "case with\nthe effect", -0.2, (-0.72, -0.35)),
    ("residual", "report", "", 0.0, (0, 0)),
    ("blind", "residual", "sealed sets", 0.0, (-0.25, -0.22)),
)
WIDE, HIGH = 1.9, 0.8


def main() -> None:
    """Draw it."""
    figure, axis = plt.subplots(figsize=(12, 6.4), layout="constrained")
    boxes = {}
    for room, (x, y, does, layer) in ROOMS.items():
        colour = "#ffffff" if layer is None else plt.get_cmap("Blues")(0.08 + 0.09 * layer)
        boxes[room] = FancyBboxPatch(
            (x - WIDE / 2, y - HIGH / 2), WIDE, HIGH, boxstyle="round,pad=0.02,rounding_size=0.1",
            facecolor=colour, edgecolor="#1b4f72", linestyle="--" if layer is None else "-",
        )  # fmt: skip
        axis.add_patch(boxes[room])
        axis.text(x, y + 0.13, room, ha="center", va="center", weight="bold", size=10)
        axis.text(x, y - 0.17, does, ha="center", va="center", size=7.5, color="#333333")
    for start, end, words, bend, (right, up) in FLOWS:
        a, b = ROOMS[start][:2], ROOMS[end][:2]
        axis.add_patch(
            FancyArrowPatch(
                a, b, patchA=boxes[start], patchB=boxes[end], arrowstyle="-|>", mutation_scale=12,
                shrinkA=2, shrinkB=2, connectionstyle=f"arc3,rad={bend}", color="#555555", lw=1.1,
            )
        )  # fmt: skip
        axis.text(
            (a[0] + b[0]) / 2 + right, (a[1] + b[1]) / 2 + up, words, ha="center", va="center",
            size=8, color="#a04000",
        )  # fmt: skip
    axis.set(xlim=(-1.2, 11.6), ylim=(-1.3, 5.6), aspect="equal")
    axis.axis("off")
    figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "docs/images/flow.png", dpi=110)


if __name__ == "__main__":
    main()
