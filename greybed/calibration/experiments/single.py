"""Single grains on walls: a drop that rebounds, a plate that tilts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from greybed.calibration.experiment import Measure, RunFailed, Value, named
from greybed.calibration.experiments.case import History, column, number_at
from greybed.calibration.experiments.grains import Grains, plane
from greybed.core.config import quantity, whole

WALL = (
    "density", "youngs_modulus", "poissons_ratio", "wall_restitution", "wall_friction",
    "wall_rolling_friction", "restitution", "friction", "rolling_friction",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class RestitutionDrop(Grains):
    """``kind = "restitution"``: grains fall on a plate one by one; the height of the rebound."""

    kind: ClassVar[str] = "restitution"
    takes = (
        "density", "youngs_modulus", "poissons_ratio", "wall_restitution", "restitution",
    )  # fmt: skip
    measures = named(
        Measure(name="ratio", what="root of the height of the rebound over that of the drop"),
    )
    height: float = quantity("length", 0.1, above=0.0)  # of the drop [m]

    def case(self, values: Mapping[str, float]) -> dict[str, Any]:
        """See :meth:`ParticleExperiment.case`."""
        r, lasts = self.radius, 2.1 * math.sqrt(2.0 * self.height / 9.81)
        content = self.tables(values, lasts)
        content["output"]["samples"] = lasts / 800.0
        at = r * 1.01 + self.height
        content |= {
            "wall": [plane("plate", [0.0, 0.0, 0.0], [0.0, 0.0, 1.0])],
            "particles": [{
                "kind": "pack", "material": "grains", "sizes": f"mono:{r:.9g}m", "count": 1,
                "lower": [-1.01 * r, -1.01 * r, at - 1.01 * r],
                "upper": [1.01 * r, 1.01 * r, at + 1.01 * r],
            }],
        }  # fmt: skip
        return content

    def watch(self, simulation: Any) -> dict[str, float]:
        """Height of the grain above the plate."""
        return {"gap": float(simulation.centres[0, 2] - simulation.radii[0])}

    def read(self, results: Mapping[str, Any], history: History) -> dict[str, Value]:
        """See :meth:`ParticleExperiment.read`."""
        gap = column(history, "gap")
        hit = int(gap.argmin())
        after = gap[hit:]
        top = float(after.max())
        if len(after) < 3 or top <= 0.0:
            raise RunFailed("the grain does not come back")
        return {"ratio": math.sqrt(top / float(gap[0]))}


@dataclass(frozen=True, kw_only=True)
class InclinedWall(Grains):
    """``kind = "inclined-wall"``: grains that cannot roll slide on a plate that tilts."""

    kind: ClassVar[str] = "inclined-wall"
    takes = ("wall_friction", "friction")
    measures = named(Measure(name="slip_angle", unit="deg", what="tilt at which they slide"))
    count: int = whole(40, at_least=5)
    rate: float = quantity("angular velocity", 0.35, above=0.0)  # of the tilt [rad/s]
    most: float = quantity("angle", 0.9, above=0.1, at_most=1.4)  # [rad]

    def case(self, values: Mapping[str, float]) -> dict[str, Any]:
        """See :meth:`ParticleExperiment.case`."""
        d = self.d
        half = 1.5 * d * math.sqrt(self.count)
        content = self.tables(values, 0.2 + self.most / self.rate)
        content["output"]["samples"] = 4e-3
        for contact in content["contact"]:
            contact["rolling_friction"] = 3.0  # they slide before they roll
        content["law"]["rolling"] = "epsd-modified"
        content |= {
            "wall": [plane("plate", [0.0, 0.0, 0.0], [0.0, 0.0, 1.0],
                           spin=[0.0, self.rate, 0.0], starts=0.15)],
            "particles": [self.pack(self.count, [-half, -half, 0.0], [half, half, 1.4 * d])],
            "measure": [{"name": "slide", "kind": "slip", "wall": "plate", "speed": 2e-3,
                         "after": 0.18}],
        }  # fmt: skip
        return content

    def read(self, results: Mapping[str, Any], history: History) -> dict[str, Value]:
        """See :meth:`ParticleExperiment.read`."""
        return {"slip_angle": number_at(results, "measures.slide.angle_deg")}
