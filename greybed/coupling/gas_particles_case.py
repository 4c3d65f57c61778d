"""The case ``gas-particles``: tables of particles and of the gas around them."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field
from pathlib import Path

from greybed.closures.drag import MIXTURES, drag_law
from greybed.closures.drag.filtered.naming import kept_drag
from greybed.core.config import choice, quantity, read_case, tables, vector, whole
from greybed.core.errors import InputError
from greybed.coupling.drag_exchange import TREATMENTS, Settings
from greybed.coupling.flow_tables import (
    SIDE_KINDS,
    GridTable,
    InflowSide,
    OutletSide,
    SideTable,
    check_cells,
    check_sides,
)
from greybed.coupling.forces import LIFTS
from greybed.coupling.gas_tables import GasTable
from greybed.coupling.nusselt import NUSSELT
from greybed.coupling.void_fraction import METHODS
from greybed.dem.case import ParticleCase
from greybed.dem.case_tables import FileTable, PackTable

PACKED = 0.74  # solid fraction of the densest lattice of equal spheres


@dataclass(frozen=True, kw_only=True)
class CouplingTable:
    """``[coupling]``: how gas and particles act on each other; see ``Settings``."""

    drag: str = "bvk"
    treatment: str = choice(TREATMENTS, "semi-implicit")
    width: float = quantity("dimensionless", 3.0, at_least=0.0)  # of smoothing, in diameters [-]
    void: str = choice(tuple(METHODS), "exact")
    least_void: float = quantity("dimensionless", 0.2, at_least=0.01, at_most=0.99)  # [-]
    mixture: str = choice(tuple(MIXTURES), "none")
    pressure: bool = True
    buoyancy: bool = True
    added_mass: float = quantity("dimensionless", 0.0, at_least=0.0, at_most=10.0)  # [-]
    lift: str = choice(tuple(LIFTS), "none")
    lubrication: float = quantity("dimensionless", 0.0, at_least=0.0, at_most=1.0)  # reach [-]
    roughness: float = quantity("dimensionless", 1e-3, at_least=1e-6, at_most=0.1)  # [-]
    courant: float = quantity("dimensionless", 0.5, above=0.0, at_most=1.0)  # of the gas [-]
    most_steps: int = whole(1000, at_least=1)  # of the particles in one of the gas [-]
    # Filtered drag: radl-sundaresan, igci, milioli, a .closure file or shipped:NAME.
    correction: Path | None = None
    filter_ratio: float = quantity("dimensionless", 1.0)  # size of a filter over a cell's [-]

    def __post_init__(self) -> None:
        drag_law(self.drag)
        if self.correction is not None:
            kept_drag(self.correction)

    @property
    def settings(self) -> Settings:
        """The settings themselves, but for the correction, which needs the particles."""
        names = (
            "drag", "treatment", "width", "void", "least_void", "mixture", "pressure", "buoyancy",
            "added_mass", "lift", "lubrication", "roughness",
        )  # fmt: skip
        return Settings(**{name: getattr(self, name) for name in names})


@dataclass(frozen=True, kw_only=True)
class GasHeatTable:
    """``[gas_heat]``: heat between particles and gas; particles need ``[heat]`` too."""

    nusselt: str = choice(tuple(NUSSELT), "gunn")
    contacts: bool = True  # whether heat goes through contacts, too
    # Factors of radiation: traced, by a closure (a file, or shipped:NAME), or none.
    radiation: str = choice(("off", "trace", "closure"), "off")
    closure: str = "shipped:viewfactor_mlp_pencil"
    emissivity: float = quantity("dimensionless", 0.9, above=0.0, at_most=1.0)  # of particles [-]
    surroundings: float | None = quantity("temperature", None, above=0.0)  # seen from the bed [K]
    rays: int = whole(2000, at_least=64)  # of each particle, traced [-]
    every: int = whole(100, at_least=1)  # gas steps after which the factors are renewed [-]


@dataclass(frozen=True, kw_only=True)
class GasParticlesCase(ParticleCase):
    """A whole case file: that of particles, and the gas."""

    kind: str = choice(("gas-particles",))
    grid: GridTable
    gas: GasTable
    side: tuple[SideTable, ...] = tables("kind", SIDE_KINDS, ())
    model: str = choice(("A", "B"), "A")
    # Imposed along axes that repeat.
    gradient: tuple[float, float, float] = vector("pressure gradient", (0.0, 0.0, 0.0))  # [Pa/m]
    gas_gravity: bool = False  # whether the gas's pressure bears its own weight
    tolerance: float = quantity("dimensionless", 1e-6, above=0.0, at_most=0.1)  # of pressure [-]
    coupling: CouplingTable = field(default_factory=CouplingTable)
    gas_heat: GasHeatTable | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        check_sides(self.side, self.grid)
        if self.coarse_graining != 1.0:
            raise InputError(
                f"coarse_graining = {self.coarse_graining:g} [-]: drag of parcels is not in here; "
                "take 1."
            )
        if self.shape or any(getattr(t, "shape", None) for t in self.particles):
            raise InputError("gas-particles: clumps have no drag law here; take spheres.")
        repeats = "" if self.periodic is None else self.periodic.axes
        if set(repeats) != set(self.grid.periodic):
            raise InputError(
                f"grid.periodic = {self.grid.periodic!r} and periodic.axes = {repeats!r} differ; "
                "the same axes must repeat for gas and particles."
            )
        largest = [
            2.0 * float(t.distribution.radii(8).max())
            for t in self.particles
            if not isinstance(t, FileTable) and t.sizes is not None
        ]
        if largest:
            check_cells(self.grid, max(largest))
        self._check_room()
        self._check_warmth()

    def _check_room(self) -> None:
        """More solid than the grid can hold."""
        volume = math.prod(self.grid.cells) * self.grid.grid.cell_volume
        solid = sum(
            4.0 / 3.0 * math.pi * float((t.distribution.radii(t.count) ** 3).sum())
            for t in self.particles
            if isinstance(t, PackTable) and t.sizes is not None
        )
        if solid > PACKED * volume:
            share = solid / max(volume, 1e-300)
            raise InputError(
                f"particles of {solid:.3g} [m3] would fill {share:.3g} of the grid, more "
                f"than {PACKED} [-], the densest packing; insert fewer, or widen the grid."
            )

    def _check_warmth(self) -> None:
        if self.gas_heat is None:
            warm = [s.name for s in self.side if s.temperature is not None]
            if warm or self.gas.temperature is not None:
                where = f"side {warm[0]!r}" if warm else "gas"
                raise InputError(
                    f"{where} has a temperature, but the case has no [gas_heat]; give it, or take "
                    "the temperature out."
                )
            return
        if self.heat is None or self.gas.temperature is None:
            raise InputError(
                "[gas_heat] needs [heat] with the temperature of the particles and a temperature "
                "in [gas]; give both."
            )
        cold = [
            s.name
            for s in self.side
            if isinstance(s, InflowSide | OutletSide) and s.temperature is None
        ]
        if cold:
            raise InputError(
                f"side {cold[0]!r} lets gas in or out and has no temperature; give one [K]."
            )


def load_gas_particles_case(path: str | os.PathLike[str]) -> GasParticlesCase:
    """Read and check a case file.

    Raises
    ------
    InputError
        In one sentence with file, key, value, unit, bound and remedy.
    """
    return read_case(path, GasParticlesCase)
