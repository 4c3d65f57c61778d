"""Cost of rigid bodies: a bed of tetrapods against the spheres that they consist of, one core.

python benchmarks/clumps.py

Tetrapods, and the same spheres without bonds, fall into a box and settle; then steps of both are
timed in turn, in processor time. A bed of bodies has fewer contacts, so the steps alone would
flatter them: what being rigid adds is timed by itself, too, and set against a step of the settled
spheres. The last line is the inverse of the cost 1 + added / step, the median of the pairs.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time

import numpy as np

from greybed.core.walls import box_walls
from greybed.dem import Clumps, Contact, Material, Simulation, SolidWall, _rigid, tetrapod
from greybed.dem.bodies import random_orientations

GLASS = Material(2500.0, 5e6, 0.3, "glass")
CONTACT = Contact(0.5, 0.4)
DIAMETER, ACROSS = 2e-3, 12
POD = tetrapod(DIAMETER, 1.05 * DIAMETER)  # its spheres do not touch each other
CELL = 2.1 * POD.reach
WALLS = [SolidWall(wall) for wall in box_walls((0, 0, 0), (ACROSS * CELL, ACROSS * CELL, 3.0))]


def bodies(count: int) -> Simulation:
    """Tetrapods on a lattice, at random orientations."""
    k = np.arange(count)
    lattice = np.stack([k % ACROSS, k // ACROSS % ACROSS, k // ACROSS**2], axis=1)
    clumps = Clumps(POD, (lattice + 0.5) * CELL, random_orientations(count, 1))
    return Simulation((), (), GLASS, CONTACT, clumps=[clumps], walls=WALLS, threads=1)


def spheres(like: Simulation) -> Simulation:
    """The spheres of a bed of bodies, free."""
    return Simulation(
        like.centres, like.radii, GLASS, CONTACT, velocities=like.velocities, spins=like.spins,
        walls=WALLS, threads=1, time_step=like.time_step,
    )  # fmt: skip


def added(simulation: Simulation, steps: int) -> float:
    """Nanoseconds per sphere and step that go into the motion of bodies."""
    lists, one = simulation._lists, np.int64(1)

    def seconds(last: int) -> float:
        begin = time.process_time()
        for _ in range(steps):
            # A step of no length: loads, kicks and turns are computed, and nothing moves.
            _rigid.kick_some(
                np.int64(0), np.int64(last), lists.rigid, lists.state, lists.near,
                simulation.gravity, lists.edge, 0.0, one, one,
            )  # fmt: skip
        return time.process_time() - begin

    # Less the way into compiled code, which a run takes once for many steps.
    spent = seconds(len(lists.rigid.pose)) - seconds(0)
    return 1e9 * spent / steps / len(simulation.radii)


def clock(simulation: Simulation, steps: int) -> float:
    """Nanoseconds of a step of a sphere."""
    begin = time.process_time()
    simulation.run(steps)
    return 1e9 * (time.process_time() - begin) / steps / len(simulation.radii)


def main() -> int:
    """Settle, then time."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=5000, help="tetrapods (default 5000)")
    parser.add_argument("--settle", type=int, default=20_000, help="steps (default 20000)")
    parser.add_argument("--steps", type=int, default=400, help="in the clock (default 400)")
    parser.add_argument("--pairs", type=int, default=7, help="runs of each (default 7)")
    options = parser.parse_args()
    bound = bodies(options.count)
    bound.run(options.settle)
    rest = spheres(bound)
    rest.run(options.settle)
    costs = []
    for pair in range(options.pairs):
        a, b, c = (
            clock(bound, options.steps),
            clock(rest, options.steps),
            added(bound, options.steps),
        )
        costs.append(1.0 + c / b)
        print(
            f"pair {pair + 1}: a step of the bodies {a:.1f} ns a sphere ({len(bound.contacts)} "
            f"contacts), of the spheres {b:.1f} ns ({len(rest.contacts)}), added {c:.1f} ns",
            flush=True,
        )
    print(f"cost of a body over its spheres {statistics.median(costs):.3f}")
    print(f"ratio {1.0 / statistics.median(costs):.3f}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
