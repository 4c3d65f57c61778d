"""Heaps and slopes: draw-down box, ledge, lifting cylinder."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from greybed.calibration.experiment import Measure, RunFailed, Value, named
from greybed.calibration.experiments.case import History, column
from greybed.calibration.experiments.grains import Grains, plane, rectangle
from greybed.calibration.experiments.shaped import ShapedGrains
from greybed.core.config import quantity, whole


@dataclass(frozen=True, kw_only=True)
class LiftingCylinder(Grains):
    """``kind = "lifting-cylinder"``: a tube is drawn up, what was in it makes a heap."""

    kind: ClassVar[str] = "lifting-cylinder"
    measures = named(
            Measure(name="repose_angle", unit="deg", what="slope of the heap"),
            Measure(name="profile", unit="m", kind="signal", what="height over the distance from "
                    "the axis"),
            Measure(name="height", unit="m", what="of the heap"),
    )  # fmt: skip
    count: int = whole(500, at_least=50)
    tube: float = quantity("dimensionless", 10.0, above=3.0)  # diameter over that of grains [-]
    speed: float = quantity("velocity", 0.04, above=0.0)  # of the tube [m/s]

    def case(self, values: Mapping[str, float]) -> dict[str, Any]:
        """See :meth:`ParticleExperiment.case`."""
        d, r = self.d, 0.5 * self.tube * self.d
        # Random places fill a quarter of the tube.
        top = 4.0 * self.count * d**3 * 0.524 / (3.1416 * r**2)
        up = 0.5 * top / self.speed  # the heap has left the tube by then
        start = 0.1 + 1.2 * float(np.sqrt(2.0 * top / 9.81))
        content = self.tables(values, start + up + 0.3)
        content |= {
            "wall": [
                plane("floor", [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
                {"name": "tube", "kind": "cylinder", "material": "walls", "radius": r,
                 "length": 1.2 * top, "velocity": [0.0, 0.0, self.speed], "starts": start},
            ],
            "particles": [self.pack(self.count, [-r, -r, 0.0], [r, r, top], True)],
            "measure": [{"name": "heap", "kind": "pile", "width": 1.2 * d}],
        }  # fmt: skip
        return content

    def read(self, results: Mapping[str, Any], history: History) -> dict[str, Value]:
        """See :meth:`ParticleExperiment.read`."""
        heap = results["measures"]["heap"]
        if "position_m" not in heap:
            raise RunFailed("there is no heap")
        return {
            "repose_angle": flank_angle(heap),
            "profile": [heap["position_m"], heap["height_m"]],
            "height": float(max(heap["height_m"])),
        }


@dataclass(frozen=True, kw_only=True)
class DrawDownBox(ShapedGrains):
    """``kind = "draw-down-box"``: a flap opens in the floor of a box, a heap forms below."""

    kind: ClassVar[str] = "draw-down-box"
    measures = named(
        Measure(name="shear_angle", unit="deg", what="slope that stays above"),
        Measure(name="repose_angle", unit="deg", what="slope of the heap below"),
        Measure(name="mass", unit="kg", what="mass in the lower box"),
        Measure(name="mass_share", what="mass in the lower box over that of all"),
        Measure(name="mass_flow", unit="kg/s", what="into the lower box, from 20 to 80 %"),
        Measure(name="over_share", what="of what was over the middle half of the opening, stays"),
        Measure(name="arch", what="1 where a tenth of that stays or more, 0 otherwise"),
    )
    count: int = whole(900, at_least=100)
    width: float = quantity("dimensionless", 22.0, above=10.0)  # of the boxes over d [-]
    depth: float = quantity("dimensionless", 4.0, at_least=1.1)  # over d [-]
    repeats: bool = False  # no front and back: the slice repeats
    opening: float = quantity("dimensionless", 6.0, above=0.0)  # over d [-]
    fall: float = quantity("dimensionless", 16.0, above=2.0)  # height of the lower box over d [-]
    lasts: float | None = quantity("time", None, above=0.0)  # from the opening on [s]

    def _start(self) -> tuple[float, float]:
        """Height of the first grains, and time at which the flap opens."""
        top = 4.0 * self.count * self.d * 0.524 / (self.width * self.depth)
        return top, 0.1 + 1.2 * float(np.sqrt(2.0 * top / 9.81))

    def case(self, values: Mapping[str, float]) -> dict[str, Any]:
        """See :meth:`ParticleExperiment.case`."""
        d = self.d
        w, t, o, h = 0.5 * self.width * d, self.depth * d, 0.5 * self.opening * d, self.fall * d
        thick = 2.0 * self.radius  # of the spheres
        top, start = self._start()
        lasts = self.lasts or 1.0 + 6.0 * float(np.sqrt(2.0 * h / 9.81))
        content = self.tables(values, start + lasts)
        # A wall that ends at a periodic face would have an edge there.
        y, deep = (-t, 3.0 * t) if self.repeats else (0.0, t)
        up, across = [0.0, 0.0, 1.0], [0.0, deep, 0.0]
        sides = [] if self.repeats else [
            plane("front", [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
            plane("back", [0.0, t, 0.0], [0.0, -1.0, 0.0]),
        ]  # fmt: skip
        if self.repeats:
            content["periodic"] = {"lower": [-w, 0.0, -h], "upper": [w, t, 2.0 * top], "axes": "y"}
        content |= {
            "wall": [
                plane("left", [-w, 0.0, 0.0], [1.0, 0.0, 0.0]),
                plane("right", [w, 0.0, 0.0], [-1.0, 0.0, 0.0]),
                *sides,
                rectangle("floor left", [-w, y, 0.0], [w - o, 0.0, 0.0], across),
                rectangle("floor right", [o, y, 0.0], [w - o, 0.0, 0.0], across),
                rectangle("flap", [-o, y, 0.0], [2.0 * o, 0.0, 0.0], across, removed=start),
                plane("ground", [0.0, 0.0, -h], up),
            ],
            "particles": [self.pack(self.count, [-w, 0.0, 0.0], [w, t, top])],
            "measure": [
                {"name": "lower", "kind": "solid", "lower": [-w, 0.0, -h], "upper": [w, t, 0.0]},
                {"name": "over", "kind": "solid", "lower": [-0.5 * o, 0.0, 0.0],
                 "upper": [0.5 * o, t, top]},
                {"name": "shear", "kind": "pile", "axis": "x", "width": thick, "above": 0.0,
                 "lower": -w + thick, "upper": -o},
                {"name": "heap", "kind": "pile", "axis": "x", "width": 1.5 * thick, "below": 0.0,
                 "lower": 0.0, "upper": w - thick},
            ],
        }  # fmt: skip
        return content

    def read(self, results: Mapping[str, Any], history: History) -> dict[str, Value]:
        """See :meth:`ParticleExperiment.read`."""
        time, mass = column(history, "time [s]"), column(history, "mass in lower [kg]")
        total = float(results["mass_kg"])
        share = float(mass[-1]) / total
        above = column(history, "mass in over [kg]")
        over = float(above[-1] / np.interp(self._start()[1], time, above))
        found: dict[str, Value] = {
            "mass": float(mass[-1]), "mass_share": share, "over_share": over,
            "arch": float(over >= 0.1),
        }  # fmt: skip
        inside = (mass >= 0.2 * mass[-1]) & (mass <= 0.8 * mass[-1]) & (mass > 0.0)
        arched = over >= 0.1
        flow = float(np.polyfit(time[inside], mass[inside], 1)[0]) if inside.sum() > 2 else 0.0
        found["mass_flow"] = 0.0 if share < 0.02 else flow
        found["shear_angle"] = 90.0 if arched else flank_angle(results["measures"]["shear"])
        little = share < 0.02
        found["repose_angle"] = 0.0 if little else flank_angle(results["measures"]["heap"])
        return found


def flank_angle(profile: Mapping[str, Any]) -> float:
    """Angle of a slope that falls from left to right, of a slice of few grains [degrees].

    A straight line through the bins of a tenth to nine tenths of the height, and their neighbours
    where these are fewer than three; that of greybed.dem takes 20 to 80 % and refuses slopes of so
    few bins.

    Raises
    ------
    RunFailed
        Where fewer than three bins hold grains.
    """
    x = np.asarray(profile.get("position_m", ()), float)
    z = np.asarray(profile.get("height_m", ()), float)
    if len(x) < 3:
        raise RunFailed("fewer than three bins of the slope hold grains")
    low, high = float(z.min()), float(z.max())
    inside = (z > low + 0.1 * (high - low)) & (z < high - 0.1 * (high - low))
    if inside.sum() < 3:
        inside = np.convolve(inside, [1, 1, 1], "same") > 0
    if inside.sum() < 3:
        inside[:] = True
    return math.degrees(math.atan(-float(np.polyfit(x[inside], z[inside], 1)[0])))


@dataclass(frozen=True, kw_only=True)
class Ledge(Grains):
    """``kind = "ledge"``: the side of a box opens, what flows out leaves a slope (shear box)."""

    kind: ClassVar[str] = "ledge"
    measures = named(
        Measure(name="slope", unit="deg", what="of what stays"),
        Measure(name="mass_share", what="that stays, over that of all"),
    )
    count: int = whole(400, at_least=50)
    width: float = quantity("dimensionless", 16.0, above=6.0)  # over d [-]
    depth: float = quantity("dimensionless", 5.0, at_least=3.0)  # over d [-]

    def case(self, values: Mapping[str, float]) -> dict[str, Any]:
        """See :meth:`ParticleExperiment.case`."""
        d = self.d
        w, t = self.width * d, self.depth * d
        top = 4.0 * self.count * d**3 * 0.524 / (w * t)
        start = 0.1 + 1.2 * float(np.sqrt(2.0 * top / 9.81))
        content = self.tables(values, start + 0.9)
        content |= {
            "wall": [
                plane("left", [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]),
                plane("front", [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]),
                plane("back", [0.0, t, 0.0], [0.0, -1.0, 0.0]),
                rectangle("floor", [0.0, -d, 0.0], [w, 0.0, 0.0], [0.0, t + 2.0 * d, 0.0]),
                rectangle("flap", [w, -d, 0.0], [0.0, t + 2.0 * d, 0.0], [0.0, 0.0, 1.2 * top],
                          removed=start),
                plane("ground", [0.0, 0.0, -60.0 * d], [0.0, 0.0, 1.0]),
            ],
            "sink": [{"name": "below", "lower": [-1.0, -1.0, -1.0], "upper": [1.0, 1.0, -5.0 * d]}],
            "particles": [self.pack(self.count, [0.0, 0.0, 0.0], [w, t, top])],
            "measure": [
                {"name": "slope", "kind": "pile", "axis": "x", "width": 1.5 * d, "above": 0.0,
                 "lower": 0.0, "upper": w},
                {"name": "box", "kind": "solid", "lower": [0.0, 0.0, 0.0], "upper": [w, t, top]},
            ],
        }  # fmt: skip
        return content

    def read(self, results: Mapping[str, Any], history: History) -> dict[str, Value]:
        """See :meth:`ParticleExperiment.read`."""
        mass = column(history, "mass in box [kg]")
        first = column(history, "mass [kg]")[0]
        return {
            "slope": flank_angle(results["measures"]["slope"]),
            "mass_share": float(mass[-1] / first),
        }
