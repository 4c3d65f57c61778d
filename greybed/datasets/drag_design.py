"""Designs of filtered-drag data sets: flows that are resolved, and filters that go over them."""

from __future__ import annotations

from dataclasses import dataclass

from greybed.closures.drag import drag_law
from greybed.core.config import choice, counts, quantity, rows, whole, wholes
from greybed.core.errors import InputError

LEAST_BOX = 8.0  # diameters across a box of particles


@dataclass(frozen=True, kw_only=True)
class FlowDesign:
    """A box that repeats, in which the gas carries the particles."""

    name: str
    kind: str = choice(("two-fluid", "cfd-dem"))
    diameter: float = quantity("length", above=0.0)  # [m]
    particle_density: float = quantity("density", above=0.0)  # [kg/m3]
    gas_density: float = quantity("density", 1.2, above=0.0)  # [kg/m3]
    gas_viscosity: float = quantity("viscosity", 1.8e-5, above=0.0)  # [Pa s]
    solid_fraction: float = quantity("dimensionless", above=0.0, at_most=0.6)  # mean [-]
    cells: tuple[int, int, int] = counts()  # along x, y, z; one along z for two dimensions
    cell: float = quantity("dimensionless", 4.0, above=0.1)  # edge over the diameter [-]
    law: str = "wen-yu"
    restitution: float = quantity("dimensionless", 0.9, above=0.0, at_most=1.0)  # [-]
    packing: float = quantity("dimensionless", 0.63, above=0.0, at_most=0.99)  # [-]
    # In terminal velocities over gravity: until clusters have formed, and between two samples.
    develop: float = quantity("dimensionless", 5.0, above=0.0)  # [-]
    apart: float = quantity("dimensionless", 0.6, above=0.0)  # [-]
    samples: int = whole(6, at_least=1)
    most_steps: int = whole(8000, at_least=10)  # a case ends there with the samples that it has
    seed: int = whole(1, at_least=0)

    def __post_init__(self) -> None:
        drag_law(self.law)
        if not self.solid_fraction < self.packing:
            raise InputError(
                f"case {self.name!r}: solid_fraction = {self.solid_fraction:g} [-] must be below "
                f"packing = {self.packing:g}; take less."
            )
        # Particles would meet their own images.
        least = min(self.cells) * self.cell
        if self.kind == "cfd-dem" and least < LEAST_BOX:
            raise InputError(
                f"case {self.name!r}: a box of particles is {least:g} diameters across and must be "
                f"{LEAST_BOX:g} at least along each axis; take more cells, along z too."
            )

    @property
    def dimension(self) -> int:
        """2 where one cell stands along z."""
        return 2 if self.cells[2] == 1 else 3

    @property
    def narrow(self) -> int:
        """Cells across the narrowest side of the box."""
        return min(self.cells[: self.dimension])


@dataclass(frozen=True, kw_only=True)
class DragDesign:
    """A data set: flows, and the filters that go over each."""

    case: tuple[FlowDesign, ...] = rows(FlowDesign)
    filters: tuple[int, ...] = wholes((3, 4, 6, 8, 12, 16))  # cells across
    each: int = whole(300, at_least=10)  # rows of each filter and sample at most

    def __post_init__(self) -> None:
        names = [case.name for case in self.case]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise InputError(f"two cases are called {twice[0]!r}; give each a name of its own.")
        if not self.case:
            raise InputError("case: there is none; give at least one [[case]].")
        for cells in self.filters:
            if cells < 1:
                raise InputError(
                    f"filters: {cells} cells is smaller than a cell; take whole numbers from 1."
                )
        for case in self.case:
            if 2 * min(self.filters) > case.narrow:
                raise InputError(
                    f"case {case.name!r}: its {case.narrow} cells are less than two of the "
                    f"narrowest filter, {min(self.filters)} cells; take more cells or a narrower "
                    "filter."
                )
