"""Grains that are bodies of spheres: tetrapods and spherocylinders."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from greybed.calibration.experiments.grains import Grains
from greybed.core.config import choice, quantity, whole
from greybed.core.errors import InputError


@dataclass(frozen=True, kw_only=True)
class ShapedGrains(Grains):
    """Grains of one shape; ``radius`` is that of the spheres that they are made of.

    Bodies are all alike (``spread`` is of spheres only), and the lengths of vessels count in
    diameters of the ball that a body turns in.
    """

    shape: str = choice(("sphere", "tetrapod", "spherocylinder"), "sphere")
    # Between two spheres of a tetrapod, over their diameter: below 1 they overlap [-].
    spacing: float = quantity("dimensionless", 2.5, above=0.0)
    # Of a spherocylinder, over its diameter [-].
    length: float = quantity("dimensionless", 2.0, above=1.0)
    spheres: int = whole(5, at_least=2)  # of a spherocylinder

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.shape != "sphere" and self.bulk_density is not None:
            raise InputError(
                f"experiment {self.name!r}: bulk_density is found with spheres, not with shape = "
                f"{self.shape!r}; give the density of the grains instead."
            )

    @property
    def d(self) -> float:
        """Diameter of the ball that a grain turns in [m]."""
        thick = 2.0 * self.radius
        if self.shape == "tetrapod":
            return thick * (1.0 + self.spacing * math.sqrt(1.5))
        return thick * (self.length if self.shape == "spherocylinder" else 1.0)

    @property
    def solid(self) -> float:
        """Volume of a grain [m3]."""
        ball = 4.0 / 3.0 * math.pi * self.radius**3
        if self.shape == "tetrapod":
            return 4.0 * ball  # as long as its spheres do not overlap
        if self.shape == "spherocylinder":
            return ball + math.pi * self.radius**3 * 2.0 * (self.length - 1.0)
        return ball

    def tables(self, values: Mapping[str, float], duration: float) -> dict[str, Any]:
        """See :meth:`Grains.tables`; with the shape."""
        content = super().tables(values, duration)
        thick = 2.0 * self.radius
        if self.shape == "tetrapod":
            content["shape"] = [{"name": "grain", "kind": "tetrapod", "diameter": thick,
                                 "spacing": self.spacing * thick}]  # fmt: skip
        elif self.shape == "spherocylinder":
            content["shape"] = [{"name": "grain", "kind": "spherocylinder", "diameter": thick,
                                 "length": self.length * thick,
                                 "spheres": self.spheres}]  # fmt: skip
        return content

    def pack(self, count: int, lower: list[float], upper: list[float], round_: bool = False) -> Any:
        """See :meth:`Grains.pack`."""
        table = super().pack(count, lower, upper, round_)
        if self.shape != "sphere":
            del table["sizes"]
            table["shape"] = "grain"
        return table
