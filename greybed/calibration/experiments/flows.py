"""Grains that fall: a hopper that empties, a portion that drops through a tube."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from greybed.calibration.experiment import Measure, RunFailed, Value, named
from greybed.calibration.experiments.case import History, column
from greybed.calibration.experiments.shaped import ShapedGrains
from greybed.core.config import quantity, whole


@dataclass(frozen=True, kw_only=True)
class Hopper(ShapedGrains):
    """``kind = "hopper"``: a cone, or a flat floor with a hole, under a tube."""

    kind: ClassVar[str] = "hopper"
    scale_invariant = False  # flow goes with the root of the size
    measures = named(
            Measure(name="mass_flow", unit="kg/s", what="from 20 to 70 % of what comes out"),
            Measure(name="left_share", what="mass that stays, over that of all"),
            Measure(name="discharge", unit="kg", kind="signal", what="mass that has come out, from "
                    "the opening of the gate on"),
    )  # fmt: skip
    count: int = whole(700, at_least=100)
    tube: float = quantity("dimensionless", 12.0, above=6.0)  # diameter over d [-]
    opening: float = quantity("dimensionless", 6.0, above=1.0)  # diameter over d [-]
    angle: float = quantity("angle", 0.7, above=0.05, at_most=1.5)  # of the cone to the axis [rad]

    def _start(self) -> tuple[float, float, float]:
        """Height of the cone, of the first grains, and time at which the gate opens."""
        d = self.d
        r, o = 0.5 * self.tube * d, 0.5 * self.opening * d
        cone = (r - o) / math.tan(self.angle)
        top = cone + 4.0 * self.count * d**3 * 0.524 / (math.pi * r**2)
        return cone, top, 0.1 + 1.2 * math.sqrt(2.0 * top / 9.81)

    def case(self, values: Mapping[str, float]) -> dict[str, Any]:
        """See :meth:`ParticleExperiment.case`."""
        d = self.d
        r, o = 0.5 * self.tube * d, 0.5 * self.opening * d
        cone, top, start = self._start()
        # Twice what Beverloo's law says for this opening (Beverloo et al. 1961, C = 0.58, k = 1.4).
        free = max(self.opening - 1.4, 1.0) * d
        rate = 0.58 * 0.6 * self.density * math.sqrt(9.81) * free**2.5
        empty = self.count * self.density * 0.524 * d**3 / rate
        content = self.tables(values, start + 1.6 * empty + 0.2)
        content |= {
            "wall": [
                {"name": "side", "kind": "cylinder", "material": "walls", "radius": r},
                {"name": "cone", "kind": "cone", "material": "walls", "radius": o,
                 "end_radius": r, "length": cone},
                {"name": "gate", "kind": "disc", "material": "walls", "radius": 1.05 * o,
                 "normal": [0.0, 0.0, 1.0], "removed": start},
            ],
            "sink": [{"name": "below", "lower": [-1.0, -1.0, -9.0], "upper": [1.0, 1.0, -2.0 * d]}],
            "particles": [self.pack(self.count, [-r, -r, cone], [r, r, top], True)],
        }  # fmt: skip
        return content

    def read(self, results: Mapping[str, Any], history: History) -> dict[str, Value]:
        """See :meth:`ParticleExperiment.read`."""
        time, out = column(history, "time [s]"), column(history, "mass in below [kg]")
        total = out[-1] + (0.0 if results["emptied"] else float(results["mass_kg"]))
        inside = (out >= 0.2 * out[-1]) & (out <= 0.7 * out[-1]) & (out > 0.0)
        flow = float(np.polyfit(time[inside], out[inside], 1)[0]) if inside.sum() > 2 else 0.0
        since = time - self._start()[2]
        return {
            "mass_flow": flow,
            "left_share": float(1.0 - out[-1] / total),
            "discharge": [since.tolist(), out.tolist()],
        }


@dataclass(frozen=True, kw_only=True)
class Drop(ShapedGrains):
    """``kind = "drop"``: a portion falls through a tube, seen from the side (source paper 002)."""

    kind: ClassVar[str] = "drop"
    scale_invariant = False
    measures = named(
            Measure(name="front", unit="m", kind="signal", what="fall of the lowest grain"),
            Measure(name="tail", unit="m", kind="signal", what="fall of the highest grain"),
            Measure(name="centre", unit="m", kind="signal", what="fall of the centre of mass"),
            Measure(name="area", unit="m2", kind="signal", what="seen from the side, in the tube"),
            Measure(name="residence", unit="s", what="between first and last grain at the end of "
                    "the tube"),
    )  # fmt: skip
    count: int = whole(300, at_least=50)
    tube: float = quantity("dimensionless", 10.0, above=4.0)  # diameter over d [-]
    fall: float = quantity("dimensionless", 60.0, above=10.0)  # length of the tube over d [-]
    tilt: float = quantity("angle", 0.35, at_least=0.0, at_most=1.2)  # of the tube [rad]

    def _start(self) -> tuple[float, float]:
        r = 0.5 * self.tube * self.d
        top = 4.0 * self.count * self.d**3 * 0.524 / (math.pi * r**2)
        return top, 0.1 + 1.2 * math.sqrt(2.0 * top / 9.81)

    def case(self, values: Mapping[str, float]) -> dict[str, Any]:
        """See :meth:`ParticleExperiment.case`; gravity is tilted, not the tube."""
        d = self.d
        r, fall = 0.5 * self.tube * d, self.fall * d
        top, start = self._start()
        lasts = 2.2 * math.sqrt(2.0 * (fall + top) / (9.81 * math.cos(self.tilt))) + 0.05
        content = self.tables(values, start + lasts)
        content["gravity"] = [9.81 * math.sin(self.tilt), 0.0, -9.81 * math.cos(self.tilt)]
        content["look"] = lasts / 200.0
        content["output"]["samples"] = lasts / 80.0
        content |= {
            "wall": [
                {"name": "tube", "kind": "cylinder", "material": "walls", "radius": r},
                {"name": "gate", "kind": "disc", "material": "walls", "radius": 1.1 * r,
                 "normal": [0.0, 0.0, 1.0], "removed": start},
            ],
            "sink": [{"name": "end", "lower": [-9.0, -9.0, -99.0],
                      "upper": [9.0, 9.0, -1.5 * fall]}],
            "particles": [self.pack(self.count, [-r, -r, 0.0], [r, r, top], True)],
        }  # fmt: skip
        return content

    def watch(self, simulation: Any) -> dict[str, float]:
        """Heights and the visible area at a moment."""
        x, r = simulation.centres, simulation.radii
        fall = self.fall * self.d
        seen = x[:, 2] > -fall
        return {
            "lowest": float((x[:, 2] - r).min()),
            "highest": float((x[:, 2] + r).max()),
            "mean": float(np.maximum(x[:, 2], -fall).mean()),
            "area": seen_area(x[seen][:, [0, 2]], r[seen]),
        }

    def read(self, results: Mapping[str, Any], history: History) -> dict[str, Value]:
        """See :meth:`ParticleExperiment.read`."""
        since = column(history, "time [s]") - self._start()[1]
        falls = since >= -1e-9
        time = since[falls].tolist()
        low = np.minimum.accumulate(column(history, "lowest")[falls])
        high = np.minimum.accumulate(column(history, "highest")[falls])
        end = -self.fall * self.d
        if not (high < end).any():
            raise RunFailed("grains are still in the tube at the end")
        t = np.array(time)
        first, last = (float(np.interp(-end, -ends, t)) for ends in (low, high))
        return {
            # What has left the tube is not seen any more.
            "front": [time, np.minimum(-low, -end).tolist()],
            "tail": [time, np.minimum(-high, -end).tolist()],
            "centre": [time, np.minimum(-column(history, "mean")[falls], -end).tolist()],
            "area": [time, column(history, "area")[falls].tolist()],
            "residence": last - first,
        }


def seen_area(places: np.ndarray, radii: np.ndarray) -> float:
    """Area that discs cover in a plane, counted on a grid of a quarter of the mean radius [m2].

    Parameters
    ----------
    places : ndarray (n, 2)
        Centres [m].
    radii : ndarray (n,)
        Radii [m].
    """
    if len(radii) == 0:
        return 0.0
    step = 0.25 * float(radii.mean())
    reach = math.ceil(float(radii.max()) / step) + 1
    offset = np.arange(-reach, reach + 1)
    around = np.stack(np.meshgrid(offset, offset), axis=-1).reshape(-1, 2)
    cell = np.floor(places / step).astype(np.int64)
    cells = cell[:, None, :] + around
    inside = (((cells + 0.5) * step - places[:, None, :]) ** 2).sum(axis=2) < radii[:, None] ** 2
    return len(np.unique(cells[inside], axis=0)) * step**2
