"""Plots of the particles' verification: python examples/verification/particles.py --out DIR.

Writes particles.png and summary.json: impacts against Hertz, restitution asked for and returned,
oblique impacts against rigid bodies that slide throughout, the order of the steps, energy of a body
that tumbles freely, and a ball that slides until it rolls. A minute on one core.
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

from greybed.core.files import output_folder, write_summary
from greybed.core.walls import Plane
from greybed.dem import Clumps, Contact, ContactLaw, Material, Simulation, SolidWall, sphere_union

GLASS = Material(2800.0, 48e9, 0.2, "glass")
OXIDE = Material(4000.0, 380e9, 0.23, "aluminium oxide")
SOFT = Material(2500.0, 5e6, 0.3, "soft")
FLOOR = SolidWall(Plane((0, 0, 0), (0, 0, 1), "floor"))


def hertz_impact(axis: Any) -> float:
    """Chung & Ooi's first test: two glass spheres of 10 mm at 10 m/s each."""
    r, speed = 10e-3, 20.0
    modulus = 0.5 * GLASS.youngs_modulus / (1.0 - GLASS.poissons_ratio**2)
    mass = 0.5 * GLASS.density * 4.0 / 3.0 * math.pi * r**3
    deep = (15.0 * mass * speed**2 / (16.0 * modulus * math.sqrt(0.5 * r))) ** 0.4
    sim = Simulation(
        [[-r, 0, 0], [r, 0, 0]], r, GLASS, Contact(1.0, 0.35), gravity=(0, 0, 0),
        velocities=[[speed / 2, 0, 0], [-speed / 2, 0, 0]], time_step=2e-8, threads=1,
    )  # fmt: skip
    rows = []
    while len(rows) < 5 or sim.forces.any():
        rows.append((2 * r - (sim.centres[1, 0] - sim.centres[0, 0]), abs(sim.forces[0, 0])))
        sim.run(20)
    d, force = np.array(rows).T
    line = np.linspace(0.0, deep, 100)
    exact = 4.0 / 3.0 * modulus * math.sqrt(0.5 * r)
    axis.plot(1e6 * line, 1e-3 * exact * line**1.5, "k-", label="Hertz")
    axis.plot(1e6 * d[::4], 1e-3 * force[::4], "o", ms=4, mfc="none", label="greybed")
    axis.axvline(1e6 * deep, color="0.7", lw=0.8)
    axis.set(xlabel="overlap [µm]", ylabel="force [kN]", title="Two glass spheres, 20 m/s")
    axis.legend()
    return float(d.max() / deep - 1.0)


def restitution(axis: Any) -> float:
    """Asked for and returned, for three laws."""
    asked = np.linspace(0.1, 0.9, 9)
    worst = 0.0
    for law, mark in (
        (ContactLaw(), "o"), (ContactLaw(limit_force=True), "x"),
        (ContactLaw(normal="linear"), "s"), (ContactLaw(normal="hysteresis"), "^"),
    ):  # fmt: skip
        found = []
        for e in asked:
            sim = Simulation(
                [[0, 0, 1e-3]], 1e-3, SOFT, Contact(e, 0.0, stiffness=1e4), law=law, walls=[FLOOR],
                gravity=(0, 0, 0), velocities=[[0, 0, -0.3]], time_step=5e-8, threads=1,
            )  # fmt: skip
            for _ in range(100):
                sim.run(400)
                if sim.velocities[0, 2] > 0.0 and not sim.forces.any():
                    break
            found.append(sim.velocities[0, 2] / 0.3)
        name = law.normal + (", cut" if law.limit_force else "")
        axis.plot(asked, np.array(found) - asked, mark + "-", mfc="none", lw=0.6, label=name)
        worst = max(worst, float(abs(np.array(found) - asked).max()))
    axis.axhline(0.0, color="k", lw=0.8)
    axis.set(xlabel="restitution asked for [-]", ylabel="returned less asked for [-]")
    axis.set_title("Restitution")
    axis.legend()
    return worst


def oblique(axis: Any) -> float:
    """Chung & Ooi's fourth test: aluminium oxide at 3.9 m/s on a wall, by the angle."""
    r, e, mu = 2.5e-3, 0.98, 0.092
    angle = np.radians(np.linspace(2, 80, 27))
    kept = []
    for a in angle:
        v, u = 3.9 * math.cos(a), 3.9 * math.sin(a)
        sim = Simulation(
            [[0, 0, r]], r, OXIDE, Contact(e, mu), law=ContactLaw(tangential_damping=False),
            walls=[FLOOR], gravity=(0, 0, 0), velocities=[[u, 0, -v]], time_step=4e-9, threads=1,
        )  # fmt: skip
        sim.run(8000)
        kept.append(sim.velocities[0, 0] / u)
    slides = 1.0 - mu * (1.0 + e) / np.tan(angle)
    kappa = 2.0 * (1.0 - OXIDE.poissons_ratio) / (2.0 - OXIDE.poissons_ratio)
    gross = np.tan(angle) > 1.2 * mu * (7.0 * kappa - 1.0) / kappa
    axis.plot(np.degrees(angle), kept, "o", mfc="none", label="greybed")
    axis.plot(
        np.degrees(angle[slides > 0.5]), slides[slides > 0.5], "k-", label="slides throughout"
    )
    axis.axhline(5.0 / 7.0, color="0.5", ls="--", lw=0.8, label="rolls (5/7)")
    axis.set(xlabel="angle of impact [°]", ylabel="speed along the wall, after/before [-]")
    axis.set_title("Oblique impacts, µ = 0.092")
    axis.legend()
    return float(abs(np.array(kept) - slides)[gross].max())


def order(axis: Any) -> list[float]:
    """Error in the place of a sphere after a time on a floor, with and without damping."""
    steps = 2.0 ** np.arange(4, 10)
    slopes = []
    for e, mark in ((1.0, "o"), (0.5, "s")):

        def end(parts: float, e: float = e) -> float:
            sim = Simulation(
                [[0, 0, 1e-3]], 1e-3, SOFT, Contact(e, 0.0, stiffness=2e3), walls=[FLOOR],
                law=ContactLaw(normal="linear"), gravity=(0, 0, 0), velocities=[[0, 0, -0.1]],
                time_step=1e-4 / parts, threads=1, most_overlap=1.0,
            )  # fmt: skip
            sim.run(int(parts))
            return float(sim.centres[0, 2])

        exact = end(2.0**16)
        error = [abs(end(k) - exact) / 1e-3 for k in steps]
        slope = float(-np.polyfit(np.log(steps), np.log(error), 1)[0])
        slopes.append(slope)
        axis.loglog(steps, error, mark + "-", mfc="none", label=f"e = {e:g}: order {slope:.2f}")
    axis.set_xticks(steps, [f"{k:g}" for k in steps], minor=False)
    axis.minorticks_off()
    axis.set(
        xlabel="steps", ylabel="error in the place over the radius [-]", title="Order of the steps"
    )
    axis.legend()
    return slopes


def tumbling(axis: Any) -> float:
    """Energy of a free body of three spheres over 100,000 steps."""
    shape = sphere_union([[0, 0, 0], [2e-3, 0, 0], [0, 3.5e-3, 0]], [1e-3, 1.2e-3, 0.8e-3])
    sim = Simulation(
        (), (), SOFT, Contact(1.0, 0.0), gravity=(0, 0, 0), time_step=2e-5, threads=1,
        clumps=[Clumps(shape, [[0, 0, 0]], [[0.3, 0.5, -0.2, 0.7]], spins=[90.0, 25.0, -60.0])],
    )  # fmt: skip
    energy, time = [], []
    for _ in range(1000):
        energy.append(sim.energies.rotational)
        time.append(sim.time)
        sim.run(100)
    error = np.array(energy) / np.mean(energy) - 1.0
    axis.plot(time, 1e6 * error, lw=0.6)
    axis.set(xlabel="time [s]", ylabel="energy, relative error [1e-6]", title="A body that tumbles")
    return float(abs(error).max())


def sliding(axis: Any) -> float:
    """A ball that is put down sliding: mu g slows it down until it rolls at 5/7 of its speed."""
    mu, u = 0.3, 0.2
    sim = Simulation(
        [[0, 0, 1e-3]], 1e-3, SOFT, Contact(0.2, mu), walls=[FLOOR], velocities=[[u, 0, 0]],
        threads=1,
    )  # fmt: skip
    rows = []
    while sim.time < 0.04:
        rows.append((sim.time, sim.velocities[0, 0], 1e-3 * sim.spins[0, 1]))
        sim.run(20)
    time, speed, turn = np.array(rows).T
    axis.plot(time, speed, label="speed")
    axis.plot(time, turn, label="spin times radius")
    exact = np.maximum(u - mu * 9.81 * time, 5.0 / 7.0 * u)
    axis.plot(time[::40], exact[::40], "k.", ms=4, label="Coulomb, then 5/7")
    axis.set(xlabel="time [s]", ylabel="[m/s]", title="Sliding, then rolling")
    axis.legend()
    return float(speed[-1] / (5.0 / 7.0 * u) - 1.0)


def measure(picture: Path) -> dict[str, float]:
    """Draw all of it, and give what is compared."""
    style = {"font.size": 8, "legend.fontsize": 7, "legend.frameon": False}
    with plt.rc_context(style):
        figure, axes = plt.subplots(2, 3, figsize=(10, 6), layout="constrained")
        undamped, damped = order(axes[1, 0])
        found = {
            "particles.hertz": hertz_impact(axes[0, 0]),
            "particles.restitution": restitution(axes[0, 1]),
            "particles.oblique": oblique(axes[0, 2]),
            "particles.order_undamped": undamped,
            "particles.order_damped": damped,
            "particles.tumbling": tumbling(axes[1, 1]),
            "particles.rolling": sliding(axes[1, 2]),
        }
        figure.savefig(picture, dpi=90)
    plt.close(figure)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("runs/verification"))
    folder = output_folder(parser.parse_args().out)
    results = measure(folder / "particles.png")
    for name, value in results.items():
        print(f"{name}: {value}")
    print(f"wrote {write_summary(folder, 'verification', results)}")


if __name__ == "__main__":
    main()
