"""Pictures of fields on a grid, and plots of a flow's history."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import NDArray

from greybed.core.files import atomic_path

Array = NDArray[np.float64]

AXES = "xyz"


def field_picture(
    path: str | os.PathLike[str],
    values: Array,
    lower: Sequence[float],
    upper: Sequence[float],
    label: str,
    limits: tuple[float, float] | None = None,
    title: str = "",
) -> Path:
    """Draw a cut through the middle of cell values [z, y, x] as PNG.

    Parameters
    ----------
    path : path
        ``.png`` file to write.
    values : ndarray, shape (nz, ny, nx)
        Values; of vectors give one component.
    lower, upper : three floats
        Corners of the grid [m].
    label : str
        Name with unit, beside the colours.
    limits : two floats, optional
        Values of the first and last colour.
    title : str
        Above the picture.
    """
    cells = values.shape[::-1]
    # The cut is across the axis of fewest cells; the higher axis goes up.
    across = int(np.argmin(cells))
    flat = np.take(values, cells[across] // 2, axis=2 - across)
    right, up = (axis for axis in range(3) if axis != across)
    extent = (1e3 * lower[right], 1e3 * upper[right], 1e3 * lower[up], 1e3 * upper[up])
    wide, high = extent[1] - extent[0], extent[3] - extent[2]
    size = (6.4 * min(1.0, wide / high) + 1.6, 6.4 * min(1.0, high / wide) + 0.8)
    figure, axis = plt.subplots(figsize=size, layout="constrained")
    low, top = limits or (float(flat.min()), float(flat.max()))
    image = axis.imshow(
        flat, origin="lower", extent=extent, cmap="viridis", vmin=low, vmax=top, aspect="equal",
        interpolation="nearest",
    )  # fmt: skip
    figure.colorbar(image, ax=axis, label=label, shrink=0.8)
    axis.set_xlabel(f"{AXES[right]} [mm]")
    axis.set_ylabel(f"{AXES[up]} [mm]")
    axis.set_title(title, fontsize=9)
    with atomic_path(path) as part, open(part, "wb") as stream:
        figure.savefig(stream, format="png", dpi=100, metadata={"Software": None})
    plt.close(figure)
    return Path(path)


def write_flow_history(
    path: str | os.PathLike[str], history: Sequence[Mapping[str, float]]
) -> Path:
    """Plots of the samples of a flow, quantities of one unit in one panel."""
    time = [row["time [s]"] for row in history]
    units: dict[str, list[str]] = {}
    for name in history[0]:
        if name != "time [s]":
            units.setdefault(name[name.rindex("[") :], []).append(name)
    columns = min(3, len(units))
    lines = -(-len(units) // columns)
    figure, axes = plt.subplots(
        lines, columns, figsize=(3.7 * columns, 3.0 * lines), layout="constrained", squeeze=False
    )
    for axis, (unit, names) in zip(axes.flat, units.items(), strict=False):
        for name in names:
            axis.plot(time, [row[name] for row in history], label=name.removesuffix(unit).strip())
        axis.set_ylabel(unit)
        axis.set_xlabel("time [s]")
        axis.legend(fontsize=7)
    for axis in axes.flat[len(units) :]:
        axis.set_visible(False)
    with atomic_path(path) as part, open(part, "wb") as stream:
        figure.savefig(stream, format="png", dpi=100, metadata={"Software": None})
    plt.close(figure)
    return Path(path)
