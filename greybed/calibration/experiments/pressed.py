"""Grains under a load: uniaxial compression, direct shear, penetration, a heated box."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from greybed.calibration.experiment import Measure, Value, named
from greybed.calibration.experiments.case import History, column, number_at
from greybed.calibration.experiments.grains import Grains, plane, rectangle
from greybed.core.config import quantity, whole


@dataclass(frozen=True, kw_only=True)
class _Pressed(Grains):
    """Stiffer grains by default, for there are loads."""

    youngs_modulus: float = quantity("pressure", 3e6, above=0.0)  # [Pa]


@dataclass(frozen=True, kw_only=True)
class Compression(_Pressed):
    """``kind = "compression"``: a lid presses a bed in a cylinder."""

    kind: ClassVar[str] = "compression"
    measures = named(
        Measure(name="solid_fraction", what="in the middle under the load"),
        Measure(name="height", unit="m", what="of the bed under the load"),
        Measure(name="loose_fraction", what="before the lid comes, from the bed's height"),
    )
    count: int = whole(300, at_least=50)
    tube: float = quantity("dimensionless", 10.0, above=5.0)  # diameter over d [-]
    stress: float = quantity("pressure", 3000.0, above=0.0)  # of the lid [Pa]

    def case(self, values: Mapping[str, float]) -> dict[str, Any]:
        """See :meth:`ParticleExperiment.case`."""
        d = self.d
        r = 0.5 * self.tube * d
        area = math.pi * r**2
        top = 4.0 * self.count * d**3 * 0.524 / area
        bed = self.count * d**3 * 0.524 / (0.58 * area)
        start = 0.1 + 1.2 * math.sqrt(2.0 * top / 9.81)
        speed = (top - 0.8 * bed) / 0.35
        content = self.tables(values, start + 0.6)
        content["look"] = 1e-3
        content |= {
            "wall": [
                {"name": "side", "kind": "cylinder", "material": "walls", "radius": r},
                plane("floor", [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
                plane("lid", [0.0, 0.0, 1.02 * top], [0.0, 0.0, -1.0],
                      velocity=[0.0, 0.0, -speed], starts=start, servo=self.stress * area),
            ],
            "particles": [self.pack(self.count, [-r, -r, 0.0], [r, r, top], True)],
            "measure": [{"name": "middle", "kind": "solid",
                         "lower": [-0.6 * r, -0.6 * r, 0.25 * bed],
                         "upper": [0.6 * r, 0.6 * r, 0.7 * bed]}],
        }  # fmt: skip
        return content

    def read(self, results: Mapping[str, Any], history: History) -> dict[str, Value]:
        """See :meth:`ParticleExperiment.read`."""
        d, r = self.d, 0.5 * self.tube * self.d
        top = 4.0 * self.count * d**3 * 0.524 / (math.pi * r**2)
        start = 0.1 + 1.2 * math.sqrt(2.0 * top / 9.81)
        time, height = column(history, "time [s]"), column(history, "height [m]")
        loose = float(np.interp(start, time, height))
        return {
            "solid_fraction": number_at(results, "measures.middle.solid_fraction"),
            "height": float(results["height_m"]),
            "loose_fraction": self.count * d**3 * 0.524 / (math.pi * r**2 * loose),
        }


@dataclass(frozen=True, kw_only=True)
class DirectShear(_Pressed):
    """``kind = "direct-shear"``: the lower half of a box moves under a loaded lid."""

    kind: ClassVar[str] = "direct-shear"
    measures = named(
        Measure(name="residual", what="shear over load, mean of the late part"),
        Measure(name="peak", what="largest shear over load"),
    )
    count: int = whole(500, at_least=200)
    width: float = quantity("dimensionless", 14.0, above=8.0)  # over d [-]
    depth: float = quantity("dimensionless", 5.0, at_least=3.0)  # over d, periodic [-]
    stress: float = quantity("pressure", 3000.0, above=0.0)  # of the lid [Pa]
    speed: float = quantity("velocity", 0.05, above=0.0)  # of the lower half [m/s]
    path: float = quantity("dimensionless", 4.0, above=1.0)  # of the shear over d [-]

    def case(self, values: Mapping[str, float]) -> dict[str, Any]:
        """See :meth:`ParticleExperiment.case`."""
        d = self.d
        w, t = 0.5 * self.width * d, self.depth * d
        top = 4.0 * self.count * d**3 * 0.524 / (2.0 * w * t)
        bed = self.count * d**3 * 0.524 / (0.56 * 2.0 * w * t)
        half = 0.45 * bed
        start = 0.1 + 1.2 * math.sqrt(2.0 * top / 9.81)
        down = start + 0.35
        lasts = self.path * d / self.speed
        content = self.tables(values, down + lasts)
        content["look"] = 1e-3
        content["output"]["samples"] = lasts / 100.0
        moves = {"velocity": [self.speed, 0.0, 0.0], "starts": down}
        across, shelf = [0.0, t + 4.0 * d, 0.0], (self.path + 4.0) * d
        y = -2.0 * d
        content |= {
            "periodic": {"lower": [-4.0 * w, 0.0, -d], "upper": [4.0 * w, t, 2.0 * top],
                         "axes": "y"},
            "wall": [
                rectangle("floor", [-w, y, 0.0], [2.0 * w, 0.0, 0.0], across, **moves),
                rectangle("lower left", [-w, y, 0.0], across, [0.0, 0.0, half], **moves),
                rectangle("lower right", [w, y, 0.0], across, [0.0, 0.0, half], **moves),
                rectangle("lower shelf", [-w - shelf, y, half], [shelf, 0.0, 0.0], across, **moves),
                rectangle("upper left", [-w, y, half], across, [0.0, 0.0, 1.2 * top]),
                rectangle("upper right", [w, y, half], across, [0.0, 0.0, 1.2 * top]),
                rectangle("upper shelf", [w, y, half], [shelf, 0.0, 0.0], across),
                plane("lid", [0.0, 0.0, 1.02 * top], [0.0, 0.0, -1.0], starts=start,
                      velocity=[0.0, 0.0, -(top - 0.7 * bed) / 0.3],
                      servo=self.stress * 2.0 * w * t),
            ],
            "particles": [self.pack(self.count, [-w, 0.0, 0.0], [w, t, top])],
            "measure": [{"name": "shear", "kind": "shear", "load": "lid", "after": down + 0.02,
                         "walls": ["floor", "lower left", "lower right", "lower shelf"],
                         "share": 0.4}],
        }  # fmt: skip
        return content

    def read(self, results: Mapping[str, Any], history: History) -> dict[str, Value]:
        """See :meth:`ParticleExperiment.read`."""
        return {
            "residual": number_at(results, "measures.shear.residual"),
            "peak": number_at(results, "measures.shear.peak"),
        }


@dataclass(frozen=True, kw_only=True)
class Penetration(_Pressed):
    """``kind = "penetration"``: a rod's flat end is pushed into a bed."""

    kind: ClassVar[str] = "penetration"
    scale_invariant = False
    measures = named(
        Measure(name="force", unit="N", what="mean over the last third of the way"),
        Measure(name="resistance", unit="N", kind="signal", what="force over the depth [m]"),
    )
    count: int = whole(800, at_least=100)
    tube: float = quantity("dimensionless", 12.0, above=8.0)  # diameter over d [-]
    rod: float = quantity("dimensionless", 4.0, above=1.0)  # diameter over d [-]
    speed: float = quantity("velocity", 0.1, above=0.0)  # [m/s]
    way: float = quantity("dimensionless", 3.0, above=1.0)  # into the bed over d [-]

    def _times(self) -> tuple[float, float, float]:
        d, r = self.d, 0.5 * self.tube * self.d
        top = 4.0 * self.count * d**3 * 0.524 / (math.pi * r**2)
        bed = self.count * d**3 * 0.524 / (0.56 * math.pi * r**2)
        return top, bed, 0.1 + 1.2 * math.sqrt(2.0 * top / 9.81)

    def case(self, values: Mapping[str, float]) -> dict[str, Any]:
        """See :meth:`ParticleExperiment.case`."""
        d, r = self.d, 0.5 * self.tube * self.d
        top, bed, start = self._times()
        down = (top + d - bed + self.way * d) / self.speed
        content = self.tables(values, start + down)
        content["output"]["samples"] = self.way * d / self.speed / 60.0
        content |= {
            "wall": [
                {"name": "side", "kind": "cylinder", "material": "walls", "radius": r},
                plane("floor", [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]),
                {"name": "rod", "kind": "disc", "material": "walls",
                 "point": [0.0, 0.0, top + d], "normal": [0.0, 0.0, -1.0],
                 "radius": 0.5 * self.rod * d, "velocity": [0.0, 0.0, -self.speed],
                 "starts": start},
            ],
            "particles": [self.pack(self.count, [-r, -r, 0.0], [r, r, top], True)],
        }  # fmt: skip
        return content

    def read(self, results: Mapping[str, Any], history: History) -> dict[str, Value]:
        """See :meth:`ParticleExperiment.read`."""
        d = self.d
        top, bed, start = self._times()
        time, force = column(history, "time [s]"), column(history, "force z on rod [N]")
        depth = bed - (top + d) + self.speed * (time - start)
        inside = depth >= -d
        late = depth >= depth[-1] - self.way * d / 3.0
        return {
            "force": float(force[late].mean()),
            "resistance": [depth[inside].tolist(), force[inside].tolist()],
        }


@dataclass(frozen=True, kw_only=True)
class HeatedBox(_Pressed):
    """``kind = "heated-box"``: a bed under a constant stress between a hot and a cold wall."""

    kind: ClassVar[str] = "heated-box"
    measures = named(
            Measure(name="solid_fraction", what="in the middle"),
            Measure(name="conductivity", unit="W/m/K", what="heat over the gradient inside the "
                    "bed"),
            Measure(name="wall_conductivity", unit="W/m/K", what="heat over the difference of the "
                    "walls' temperatures and their distance"),
    )  # fmt: skip
    takes = (*Grains.takes, "conductivity")
    count: int = whole(400, at_least=100)
    width: float = quantity("dimensionless", 6.0, at_least=4.0)  # over d, periodic [-]
    stress_ratio: float = quantity("dimensionless", 1e-3, above=0.0, at_most=0.1)  # over E [-]
    conductivity: float = quantity("conductivity", 1.0, above=0.0)  # of the grains [W/m/K]

    def case(self, values: Mapping[str, float]) -> dict[str, Any]:
        """See :meth:`ParticleExperiment.case`."""
        d = self.d
        w = self.width * d
        top = 4.0 * self.count * d**3 * 0.524 / w**2
        bed = self.count * d**3 * 0.524 / (0.56 * w**2)
        modulus = self.number(values, "youngs_modulus")
        load = self.stress_ratio * modulus * w**2
        content = self.tables(values, 1.1)
        content["gravity"], content["look"] = [0.0, 0.0, 0.0], 1e-3
        heat = {"conductivity": self.number(values, "conductivity"),
                "heat_capacity": 0.005}  # fmt: skip
        content["material"][0] |= heat
        low, high = 0.25 * bed, 0.75 * bed
        content |= {
            "heat": {"temperature": 350.0},
            "periodic": {"lower": [0.0, 0.0, -d], "upper": [w, w, 1.5 * top], "axes": "xy"},
            "wall": [
                plane("floor", [0.0, 0.0, 0.0], [0.0, 0.0, 1.0], temperature=400.0),
                plane("lid", [0.0, 0.0, 1.02 * top], [0.0, 0.0, -1.0], temperature=300.0,
                      velocity=[0.0, 0.0, -(top - 0.7 * bed) / 0.35], servo=load),
            ],
            "particles": [self.pack(self.count, [0.0, 0.0, 0.0], [w, w, top])],
            "measure": [
                {"name": "bed", "kind": "conduction", "walls": ["floor", "lid"], "lower": low,
                 "upper": high, "area": w**2},
                {"name": "middle", "kind": "solid", "lower": [0.0, 0.0, low],
                 "upper": [w, w, high]},
            ],
        }  # fmt: skip
        content["material"][1] |= heat
        return content

    def read(self, results: Mapping[str, Any], history: History) -> dict[str, Value]:
        """See :meth:`ParticleExperiment.read`."""
        bed = results["measures"]["bed"]
        flux = number_at(results, "measures.bed.heat_flow_W") / (self.width * self.d) ** 2
        return {
            "solid_fraction": number_at(results, "measures.middle.solid_fraction"),
            "conductivity": float(bed["conductivity_W_per_m_K"]),
            "wall_conductivity": abs(flux) * float(results["height_m"]) / 100.0,
        }
