"""Compiles the dearest kernels, so that processes which begin at once begin with different ones.

Each process of ``pytest -n`` starts with other rooms, but most of these need the same kernels: both
would stand before the same lock while one compiles. Nothing happens where machine code is kept.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

import greybed
from greybed.core import Packing, box_walls

PACKAGE = Path(greybed.__file__).parent
CENTRES, RADIUS, CORNER = [[0.25, 0.5, 0.5], [0.75, 0.5, 0.5]], 0.2, (1.0, 1.0, 1.0)


def particles() -> None:
    """Contacts, walls, lists and steps."""
    from greybed.dem import Contact, Material, Simulation, SolidWall

    glass, walls = Material(2500.0, 5e6, 0.3), [SolidWall(w) for w in box_walls((0, 0, 0), CORNER)]
    Simulation(CENTRES, RADIUS, glass, Contact(0.5, 0.3), walls=walls).run(2)


def rays() -> None:
    """View factors, and lines between pairs."""
    from greybed.raytrace import view_factors

    view_factors(Packing(CENTRES, RADIUS, walls=box_walls((0, 0, 0), CORNER)), rays=16)
    view_factors(Packing(CENTRES, RADIUS), rel_error=0.5, least=0.05)


def light() -> None:
    """Paths with reflections, and what an eye sees."""
    from greybed.raytrace import exchange_factors, first_hits

    bed = Packing(CENTRES, RADIUS, walls=box_walls((0, 0, 0), CORNER))
    exchange_factors(bed, 0.5, wall_emissivity=0.5, rays=16, wall_rays=16)
    first_hits(bed, [[0.0, 0.5, 0.5]], [[1.0, 0.0, 0.0]])


def gas() -> None:
    """One step of gas between walls."""
    from greybed.cfd.gas import Fluid, GasSolver, Grid, Inflow, Outlet

    grid = Grid(cells=(4, 4, 4), upper=CORNER)
    solver = GasSolver(
        grid, {"z-": Inflow(0.1), "z+": Outlet()}, Fluid(density=1.2, viscosity=1.8e-5)
    )
    solver.step(1e-3, void_fraction=np.full(grid.shape, 0.9))


# What compiles, and the kernel by whose machine code one sees that it has been done.
SHARES = (
    ((particles, "dem", "_step.advance"),),
    (
        (rays, "raytrace", "_rows.trace_block"),
        (light, "raytrace", "_paths.follow"),
        (gas, "cfd", "_flux.convect"),
    ),
)


def compile_share(process: int) -> None:
    """Compile what falls to the first and to the second process; to others nothing."""
    if any(os.environ.get(name) for name in ("NUMBA_DISABLE_JIT", "NUMBA_CACHE_DIR")):
        return
    for compile_them, room, kernel in SHARES[process] if process < len(SHARES) else ():
        if not any((PACKAGE / room / "__pycache__").glob(f"{kernel}-*.nbc")):
            compile_them()
