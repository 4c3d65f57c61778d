"""Two bodies for the tests of the contact laws."""

from __future__ import annotations

import numpy as np

from greybed.core.walls import Plane
from greybed.dem import Contact, ContactLaw, Material, Simulation, SolidWall

GLASS = Material(2500.0, 5e6, 0.3, "glass")


def pair(law=None, contact=None, gap=1e-5, speed=1.0, radii=(1e-3, 1e-3), **more):
    """Two spheres that meet head on along x, each with half of ``speed``."""
    middle = radii[0] + radii[1] + gap
    return Simulation(
        [[0, 0, 0], [middle, 0, 0]], radii, more.pop("materials", GLASS),
        contact or Contact(0.8, 0.3), law=law or ContactLaw(),
        gravity=more.pop("gravity", (0, 0, 0)), threads=1,
        velocities=more.pop("velocities", [[0.5 * speed, 0, 0], [-0.5 * speed, 0, 0]]), **more,
    )  # fmt: skip


def on_floor(law=None, contact=None, height=0.0, radius=1e-3, **more):
    """One sphere on or above a floor."""
    return Simulation(
        [[0, 0, radius + height]], [radius], more.pop("materials", GLASS),
        contact or Contact(0.5, 0.3), law=law or ContactLaw(),
        walls=[SolidWall(Plane((0, 0, 0), (0, 0, 1)), more.pop("wall", None))], threads=1, **more,
    )  # fmt: skip


def apart(simulation, steps=400, most=200):
    """Run until no two bodies touch any more, after they have."""
    before = simulation.velocities
    for _ in range(most):
        simulation.run(steps)
        touching = len(simulation.contacts) > 0 or np.abs(simulation.forces).max() > 0.0
        if not touching and np.abs(simulation.velocities - before).max() > 1e-9:
            return simulation
    raise AssertionError("the bodies have not parted")
