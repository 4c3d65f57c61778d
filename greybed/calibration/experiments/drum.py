"""A drum that turns: slope, and the energies and period of its avalanches."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from scipy.signal import find_peaks

from greybed.calibration.experiment import Measure, RunFailed, Value, named
from greybed.calibration.experiments.case import History, column, number_at
from greybed.calibration.experiments.grains import Grains, plane
from greybed.core.config import quantity, whole


@dataclass(frozen=True, kw_only=True)
class Drum(Grains):
    """``kind = "drum"``: a slice of a drum, turned at a Froude number.

    The energies of a revolution powder analyser (source paper 004): potential energy per mass
    above the drum's lowest point, before avalanches (break) and after them (rest).
    """

    kind: ClassVar[str] = "drum"
    measures = named(
            Measure(name="angle", unit="deg", what="slope, mean over the time"),
            Measure(name="break_energy", unit="J/kg", what="before avalanches"),
            Measure(name="rest_energy", unit="J/kg", what="after avalanches"),
            Measure(name="avalanche_energy", unit="J/kg", what="their difference"),
            Measure(name="period", unit="s", what="between avalanches"),
            Measure(name="energy", unit="J/kg", kind="signal", what="potential energy over the "
                    "time of turning"),
    )  # fmt: skip
    count: int = whole(260, at_least=50)
    drum: float = quantity("dimensionless", 18.0, above=8.0)  # diameter over d [-]
    depth: float = quantity("dimensionless", 3.0, at_least=2.5)  # over d [-]
    froude: float = quantity("dimensionless", 3e-3, above=0.0, at_most=1.0)  # w^2 R / g [-]
    turns: float = quantity("dimensionless", 0.4, above=0.0)  # that are measured [-]

    def _times(self) -> tuple[float, float, float]:
        """Start of the turning, begin and end of what is measured [s]."""
        spin = math.sqrt(self.froude * 9.81 / (0.5 * self.drum * self.d))
        start = 0.15 + 1.3 * math.sqrt(2.0 * self.drum * self.d / 9.81)
        begin = start + 0.15 * 2.0 * math.pi / spin
        return start, begin, begin + self.turns * 2.0 * math.pi / spin

    def case(self, values: Mapping[str, float]) -> dict[str, Any]:
        """See :meth:`ParticleExperiment.case`."""
        d = self.d
        r, t = 0.5 * self.drum * d, self.depth * d
        spin = math.sqrt(self.froude * 9.81 / r)
        start, begin, end = self._times()
        content = self.tables(values, end)
        content["output"]["samples"] = (end - begin) / 150.0
        turning = {"spin": [0.0, spin, 0.0], "starts": start}
        half = 0.69 * r
        content |= {
            "wall": [
                {"name": "drum", "kind": "cylinder", "material": "walls",
                 "axis": [0.0, 1.0, 0.0], "radius": r, **turning},
                plane("front", [0.0, 0.0, 0.0], [0.0, 1.0, 0.0], **turning),
                plane("back", [0.0, t, 0.0], [0.0, -1.0, 0.0], **turning),
            ],
            "particles": [self.pack(self.count, [-half, 0.0, -half], [half, t, half])],
            "measure": [{"name": "surface", "kind": "pile", "axis": "x", "width": 1.5 * d,
                         "average": end - begin}],
        }  # fmt: skip
        return content

    def read(self, results: Mapping[str, Any], history: History) -> dict[str, Value]:
        """See :meth:`ParticleExperiment.read`."""
        time = column(history, "time [s]")
        energy = column(history, "potential energy [J]") / column(history, "mass [kg]")
        energy = energy + 9.81 * 0.5 * self.drum * self.d
        begin = self._times()[1]
        late = time >= begin
        t, e = time[late] - begin, energy[late]
        high, low, fall, period = avalanches(t, e)
        return {
            "angle": abs(number_at(results, "measures.surface.mean_angle_deg")),
            "break_energy": high, "rest_energy": low, "avalanche_energy": fall, "period": period,
            "energy": [t.tolist(), e.tolist()],
        }  # fmt: skip


def avalanches(time: np.ndarray, energy: np.ndarray) -> tuple[float, float, float, float]:
    """Mean energy before and after avalanches, their difference, and the time between them.

    Parameters
    ----------
    time : ndarray (n,)
        Of the samples [s].
    energy : ndarray (n,)
        Potential energy, in any unit.

    Notes
    -----
    Avalanches begin at maxima that stand out by a fifth of the spread (5 to 95 %) of the energy.

    Raises
    ------
    RunFailed
        Where there are fewer than two.
    """
    spread = float(np.quantile(energy, 0.95) - np.quantile(energy, 0.05))
    tops, _ = find_peaks(energy, prominence=0.2 * spread)
    if len(tops) < 2 or spread <= 0.0:
        raise RunFailed("fewer than two avalanches; turn for longer")
    ends = [*tops[1:], len(energy)]
    floors = [float(energy[a:b].min()) for a, b in zip(tops, ends, strict=True)]
    high, low = float(energy[tops].mean()), float(np.mean(floors))
    return high, low, high - low, float(np.diff(time[tops]).mean())
