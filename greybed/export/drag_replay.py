"""Runs exported closures of filtered drag and replays their golden rows."""

from __future__ import annotations

import io
import os
import subprocess
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.closures.drag.filtered.closure import DragPrediction
from greybed.core import VerificationError
from greybed.export.replay import CompiledProgram, OnnxGraph

Array = NDArray[np.float64]


def _filled(names: tuple[str, ...], markers: dict[str, ArrayLike]) -> dict[str, ArrayLike]:
    return {"parcels": 1.0, **markers} if "parcels" in names else markers


class CompiledDrag(CompiledProgram):
    """Filtered drag exported to C++, answering through its compiled test program.

    Unlike in Python, markers out of range give NaN instead of an error.
    """

    def predict(self, **markers: ArrayLike) -> DragPrediction:
        """Kept fractions; all rows in one call of the program."""
        table, shape = self.rows(_filled(self.marker_names, markers), 5)
        return DragPrediction(
            table[:, 0].reshape(shape), table[:, 1].reshape(shape), table[:, 2].reshape(shape),
            table[:, 3].reshape(shape), (table[:, 4] > 0.0).reshape(shape),
        )  # fmt: skip

    def forces(self, rows: ArrayLike) -> tuple[Array, Array]:
        """Forces (n, 3) [N m-3] and derivatives (n, 3, 3) [N s m-4] of rows (n, 18), all SI.

        A row is diameter, particle and gas density, gas viscosity, gravity, solid fraction, slip,
        pressure gradient, filter size, F, Re dF/dRe, parcels.
        """
        text = "\n".join(",".join(f"{x:.17g}" for x in row) for row in np.atleast_2d(rows))
        done = subprocess.run(
            [self.program, "forces"], input=text + "\n", capture_output=True, text=True
        )
        if done.returncode:
            raise VerificationError(
                f"{self.program}: exit code {done.returncode} ({done.stderr.strip()}); "
                "export and compile it again."
            )
        table = np.loadtxt(io.StringIO(done.stdout), delimiter=",", ndmin=2)
        return table[:, :3], table[:, 3:].reshape(-1, 3, 3)

    def nanoseconds(self) -> float:
        """Time of one force with its derivative, best of five turns [ns]."""
        done = subprocess.run([self.program, "time"], capture_output=True, text=True)
        return float(done.stdout.split()[0])


class OnnxDrag(OnnxGraph):
    """Filtered drag exported to ONNX, answering through onnxruntime on one thread."""

    def __init__(self, path: str | os.PathLike[str]) -> None:
        super().__init__(path)

    def predict(self, **markers: ArrayLike) -> DragPrediction:
        """Kept fractions."""
        results: list[Any] = self.run(_filled(self.marker_names, markers))
        return DragPrediction(*results)
