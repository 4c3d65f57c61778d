"""Particles that collide: contact laws, walls, time steps, and what is measured of them."""

from greybed.dem.checkpoint import restore, save
from greybed.dem.heat import Heat
from greybed.dem.laws import ContactLaw
from greybed.dem.materials import Contact, Material
from greybed.dem.particles import Energies
from greybed.dem.simulation import Simulation
from greybed.dem.walls import SolidWall

__all__ = [
    "Contact",
    "ContactLaw",
    "Energies",
    "Heat",
    "Material",
    "Simulation",
    "SolidWall",
    "restore",
    "save",
]
