"""LIGGGHTS as the engine of a case of particles: its deck, its run through MPI, its results.

The same case file, the same spheres at the start, the same laws; see docs/liggghts.md for what is
handed over and what is refused. The door is :class:`LiggghtsRun`.
"""

from greybed.dem.liggghts.run import LiggghtsRun

__all__ = ["LiggghtsRun"]
