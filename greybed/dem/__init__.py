"""Particles: contact laws, walls, neighbour search and time steps of spheres."""

from greybed.dem.laws import ContactLaw
from greybed.dem.materials import Contact, Material
from greybed.dem.simulation import Energies, Simulation
from greybed.dem.walls import SolidWall

__all__ = ["Contact", "ContactLaw", "Energies", "Material", "Simulation", "SolidWall"]
