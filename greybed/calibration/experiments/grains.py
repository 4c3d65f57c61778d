"""Experiments over the particle engine: the grains, their contacts, and what all of them share."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, ClassVar

from greybed._version import __version__
from greybed.calibration.experiment import COST, Experiment, Value
from greybed.calibration.experiments.case import ParticleExperiment, number_at, run_case
from greybed.calibration.experiments.listed import COMMON, Listed
from greybed.core.config import choice, quantity
from greybed.core.errors import InputError
from greybed.dem.laws import COHESION, ROLLING

# Names of parameters that every experiment of this library knows.
TAKES: tuple[str, ...] = (
    "density", "youngs_modulus", "poissons_ratio", "restitution", "friction", "rolling_friction",
    "cohesion", "wall_restitution", "wall_friction", "wall_rolling_friction", "wall_cohesion",
)  # fmt: skip
_FILLING = 260  # grains of the box in which bulk densities are found


@dataclass(frozen=True, kw_only=True)
class Grains(Listed, ParticleExperiment):
    """Grains between walls: numbers of contacts that the study does not give as parameters.

    All lengths of vessels are by default in grain diameters, so that larger grains come in a
    larger vessel.
    """

    radius: float = quantity("length", 2e-3, above=0.0)  # mean [m]
    spread: float = quantity("dimensionless", 0.1, at_least=0.0, at_most=0.5)  # +- of it [-]
    density: float = quantity("density", 2500.0, above=0.0)  # [kg/m3]
    youngs_modulus: float = quantity("pressure", 5e5, above=0.0)  # [Pa]
    poissons_ratio: float = quantity("dimensionless", 0.25, at_least=0.0, at_most=0.5)  # [-]
    restitution: float = quantity("dimensionless", 0.4, above=0.0, at_most=1.0)  # [-]
    friction: float = quantity("dimensionless", 0.5, at_least=0.0)  # [-]
    rolling_friction: float = quantity("dimensionless", 0.1, at_least=0.0)  # [-]
    cohesion: float = quantity("dimensionless", 0.0, at_least=0.0)  # SI of the law
    wall_restitution: float | None = quantity("dimensionless", None, above=0.0, at_most=1.0)
    wall_friction: float | None = quantity("dimensionless", None, at_least=0.0)  # as grains
    wall_rolling_friction: float | None = quantity("dimensionless", None, at_least=0.0)
    wall_cohesion: float = quantity("dimensionless", 0.0, at_least=0.0)
    rolling_law: str = choice(tuple(ROLLING), "epsd-modified")
    cohesion_law: str = choice(tuple(COHESION), "none")
    limit_force: bool = False  # no attraction by damping
    time_step: float | None = quantity("time", None, above=0.0)  # a tenth of Rayleigh's [s]
    # Kept for every parameter set: the grains' density follows from how they settle [kg/m3].
    bulk_density: float | None = quantity("density", None, above=0.0)

    kind: ClassVar[str] = ""
    takes = TAKES
    scale_invariant = True

    def __post_init__(self) -> None:
        if self.cohesion > 0.0 and self.cohesion_law == "none":
            raise InputError("cohesion is above 0 without a law; give cohesion_law, such as sjkr.")

    @property
    def d(self) -> float:
        """Mean diameter [m]."""
        return 2.0 * self.radius

    def experiment(self, folder: Path) -> Experiment:
        """See :meth:`Listed.experiment`."""
        return self

    def identity(self) -> Any:
        """See :meth:`Experiment.identity`."""
        own = {k: v for k, v in asdict(self).items() if k not in COMMON}
        return [self.kind, __version__, json.loads(json.dumps(own, default=str))]

    def run(self, values: Mapping[str, float], seed: int) -> dict[str, Value]:
        """See :meth:`Experiment.run`; first the density, where that of the bulk is kept."""
        if self.bulk_density is None:
            return super().run(values, seed)
        fraction, work = self._solid_fraction(values, seed)
        found = super().run({**values, "density": self.bulk_density / fraction}, seed)
        found[COST] = float(found[COST]) + work  # type: ignore[arg-type]
        return found

    def _solid_fraction(self, values: Mapping[str, float], seed: int) -> tuple[float, float]:
        """Of grains with these contacts that have settled in a periodic box, and its work."""
        d = self.d
        content = self.tables(values, 0.5)
        content |= {
            "periodic": {"lower": [0.0, 0.0, -d], "upper": [5.0 * d, 5.0 * d, 60.0 * d],
                         "axes": "xy"},
            "wall": [{"name": "floor", "kind": "plane", "material": "walls",
                      "normal": [0.0, 0.0, 1.0]}],
            "particles": [self.pack(_FILLING, [0.0, 0.0, 0.0], [5.0 * d, 5.0 * d, 30.0 * d])],
            "measure": [{"name": "middle", "kind": "solid", "lower": [0.0, 0.0, 2.0 * d],
                         "upper": [5.0 * d, 5.0 * d, 6.0 * d]}],
            "seed": seed,
        }  # fmt: skip
        results, _ = run_case(content, self.place, self.watch)
        work = float(results["steps"]) * _FILLING
        return number_at(results, "measures.middle.solid_fraction"), work

    def number(self, values: Mapping[str, float], name: str) -> float:
        """A number of the contacts: the study's parameter, or what the experiment says."""
        if name in values:
            return float(values[name])
        own = getattr(self, name)
        return self.number(values, name.removeprefix("wall_")) if own is None else float(own)

    def tables(self, values: Mapping[str, float], duration: float) -> dict[str, Any]:
        """Law, materials and contacts of a case that lasts so long [s]."""

        def contact(front: str) -> dict[str, Any]:
            return {
                "restitution": min(self.number(values, f"{front}restitution"), 1.0),
                "friction": self.number(values, f"{front}friction"),
                "rolling_friction": self.number(values, f"{front}rolling_friction"),
                "cohesion": self.number(values, f"{front}cohesion"),
            }

        cohesive = "cohesion" in values or "wall_cohesion" in values
        law = self.cohesion_law if self.cohesion_law != "none" or not cohesive else "sjkr"
        material = {
            "density": self.number(values, "density"),
            "youngs_modulus": self.number(values, "youngs_modulus"),
            "poissons_ratio": self.number(values, "poissons_ratio"),
        }
        step = {} if self.time_step is None else {"time_step": self.time_step}
        return {
            "kind": "particles",
            "duration": duration,
            **step,
            "law": {"rolling": self.rolling_law, "cohesion": law, "limit_force": self.limit_force},
            "material": [{"name": "grains", **material}, {"name": "walls", **material}],
            "contact": [
                {"between": ["grains", "grains"], **contact("")},
                {"between": ["grains", "walls"], **contact("wall_")},
            ],
            "output": {"samples": duration / 100.0},
        }

    def pack(self, count: int, lower: list[float], upper: list[float], round_: bool = False) -> Any:
        """A table of particles at random places."""
        low, high = self.radius * (1.0 - self.spread), self.radius * (1.0 + self.spread)
        sizes = f"mono:{self.radius:.9g}m" if self.spread == 0.0 else (
            f"uniform:{low:.9g}m,{high:.9g}m"
        )  # fmt: skip
        return {
            "kind": "pack", "material": "grains", "sizes": sizes, "count": count,
            "lower": lower, "upper": upper, "round": round_,
        }  # fmt: skip


def plane(name: str, point: list[float], normal: list[float], **more: Any) -> dict[str, Any]:
    """A table of a plane wall."""
    return {"name": name, "kind": "plane", "material": "walls", "point": point, "normal": normal,
            **more}  # fmt: skip


def rectangle(
    name: str, corner: list[float], a: list[float], b: list[float], **more: Any
) -> dict[str, Any]:
    """A table of a rectangular wall."""
    return {"name": name, "kind": "rectangle", "material": "walls", "corner": corner, "a": a,
            "b": b, **more}  # fmt: skip
