"""Pictures and films of particles that move: frames on a fixed stage, joined to a GIF."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.files import atomic_path
from greybed.core.packing import Packing
from greybed.report.picture import View, bed_picture

VIEW = View(azimuth=-60.0, elevation=15.0)
WIDTH = 420


def frame_picture(
    packing: Packing, values: ArrayLike, stage: ArrayLike, limits: tuple[float, float]
) -> NDArray[np.uint8]:
    """One frame, shape (height, width, 3), on white; see :func:`bed_picture`."""
    rgba = bed_picture(
        packing, values, width=WIDTH, view=VIEW, cut=False, limits=limits, stage=stage
    ).astype(np.float64)
    opaque = rgba[..., 3:] / 255.0
    return np.round(rgba[..., :3] * opaque + 255.0 * (1.0 - opaque)).astype(np.uint8)


def write_frame(path: str | os.PathLike[str], frame: NDArray[np.uint8]) -> Path:
    """Write a frame as PNG."""
    from PIL import Image

    with atomic_path(path) as part, open(part, "wb") as stream:
        Image.fromarray(frame).save(stream, format="PNG")
    return Path(path)


def write_film(
    path: str | os.PathLike[str], frames: Sequence[str | os.PathLike[str]], seconds: float
) -> Path:
    """Join PNG frames of one size to a GIF that lasts so long [s]."""
    from PIL import Image

    images = [Image.open(frame).convert("P", palette=Image.Palette.ADAPTIVE) for frame in frames]
    each = max(20, round(1000.0 * seconds / len(images)))
    with atomic_path(path) as part, open(part, "wb") as stream:
        images[0].save(
            stream, format="GIF", save_all=True, append_images=images[1:], duration=each, loop=0
        )
    for image in images:
        image.close()
    return Path(path)


def write_history(path: str | os.PathLike[str], history: Sequence[Mapping[str, float]]) -> Path:
    """Plots of the samples of a run: energies, height, coordination, sinks, temperature."""
    time = [row["time [s]"] for row in history]
    sinks = [name for name in history[0] if name.startswith("mass in ")]
    warm = "mean temperature [K]" in history[0]
    panels = 2 + bool(sinks) + warm
    figure, axes = plt.subplots(1, panels, figsize=(11.0, 3.4), layout="constrained")
    for name in ("kinetic energy [J]", "rotational energy [J]"):
        axes[0].plot(time, [row[name] or math.nan for row in history], label=name)
    axes[0].set_yscale("log")
    axes[0].legend(fontsize=8)
    axes[1].plot(time, [1e3 * row["height [m]"] for row in history], "C2", label="height [mm]")
    axes[1].set_ylabel("height [mm]")
    other = axes[1].twinx()
    other.plot(time, [row["coordination [-]"] for row in history], "C3--", label="coordination")
    other.set_ylabel("coordination [-] (dashed)")
    for name in sinks:
        axes[2].plot(time, [row[name] for row in history], label=name)
    if sinks:
        axes[2].legend(fontsize=8)
    if warm:
        axes[-1].plot(time, [row["mean temperature [K]"] for row in history])
        axes[-1].set_ylabel("mean temperature [K]")
    for axis in axes:
        axis.set_xlabel("time [s]")
    with atomic_path(path) as part, open(part, "wb") as stream:
        figure.savefig(stream, format="png", dpi=110, metadata={"Software": None})
    plt.close(figure)
    return Path(path)
