"""The coupled thermal bed: conduction, radiation through view factors, steady and transient."""

from greybed.core.diffuse import DiffuseExchange, diffuse_exchange
from greybed.coupling.conduction import Conductances, contact_conductances
from greybed.coupling.drag_exchange import Settings as GasParticleSettings
from greybed.coupling.gas_heat import BedRadiation, GasHeat, HeatReport
from greybed.coupling.gas_particles import ExchangeReport, GasParticles
from greybed.coupling.radiation import NetRadiation, net_radiation
from greybed.coupling.radiative_network import (
    RadiativeResult,
    pairwise_network,
    radiative_network,
)
from greybed.coupling.results import SolverError, Status, ThermalResult
from greybed.coupling.rows import Rows, balanced
from greybed.coupling.thermal import Material, ThermalBed
from greybed.coupling.void_fraction import Smoother, solid_fraction

__all__ = [
    "BedRadiation",
    "Conductances",
    "DiffuseExchange",
    "ExchangeReport",
    "GasHeat",
    "GasParticleSettings",
    "GasParticles",
    "HeatReport",
    "Material",
    "NetRadiation",
    "RadiativeResult",
    "Rows",
    "Smoother",
    "SolverError",
    "Status",
    "ThermalBed",
    "ThermalResult",
    "balanced",
    "contact_conductances",
    "diffuse_exchange",
    "net_radiation",
    "pairwise_network",
    "radiative_network",
    "solid_fraction",
]
