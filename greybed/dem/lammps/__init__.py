"""LAMMPS as the engine of a case of particles: its deck, its run through MPI, its results.

The same case file, the same spheres at the start, the same laws; see docs/hosts.md for what is
handed over and what is refused. The door is :class:`LammpsRun`.
"""

from greybed.dem.lammps.run import LammpsRun

__all__ = ["LammpsRun"]
