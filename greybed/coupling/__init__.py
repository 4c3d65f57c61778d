"""The coupled thermal bed: conduction, radiation through view factors, steady and transient."""

from greybed.core.diffuse import DiffuseExchange, diffuse_exchange
from greybed.coupling.conduction import Conductances, contact_conductances
from greybed.coupling.radiation import NetRadiation, net_radiation
from greybed.coupling.radiative_network import (
    RadiativeResult,
    pairwise_network,
    radiative_network,
)
from greybed.coupling.results import SolverError, Status, ThermalResult
from greybed.coupling.rows import Rows, balanced
from greybed.coupling.thermal import Material, ThermalBed

__all__ = [
    "Conductances",
    "DiffuseExchange",
    "Material",
    "NetRadiation",
    "RadiativeResult",
    "Rows",
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
]
