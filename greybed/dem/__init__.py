"""Particles that collide: contact laws, walls, time steps, and what is measured of them."""

from greybed.dem.bodies import Clumps
from greybed.dem.checkpoint import restore, save
from greybed.dem.clump import Clump, sphere_union
from greybed.dem.clump_shapes import fitted_clump, spherocylinder, tetrapod
from greybed.dem.heat import Heat
from greybed.dem.laws import ContactLaw
from greybed.dem.materials import Contact, Material
from greybed.dem.particles import Energies
from greybed.dem.simulation import Simulation
from greybed.dem.walls import SolidWall

__all__ = [
    "Clump",
    "Clumps",
    "Contact",
    "ContactLaw",
    "Energies",
    "Heat",
    "Material",
    "Simulation",
    "SolidWall",
    "fitted_clump",
    "restore",
    "save",
    "sphere_union",
    "spherocylinder",
    "tetrapod",
]
