"""Plots of the two-fluid solver's verification: python examples/verification/twofluid.py --out DIR.

Writes twofluid.png (growth of small waves against the linear theory, order in space, the fronts of
a sedimentation against Kynch), clusters.png (a periodic box that has fallen into clusters) and
summary.json. Three minutes on one core.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
import matplotlib.pyplot as plt

from greybed.cfd.grid import Grid
from greybed.cfd.kinetic import Granular
from greybed.cfd.rims import Wall
from greybed.cfd.twofluid import TwoFluid
from greybed.closures.drag.laws import drag_law
from greybed.core.files import output_folder, write_summary

sys.path.insert(0, str(Path(__file__).parents[2] / "tests" / "cfd"))
from linear import waves

FCC = {"particle_density": 1500.0, "diameter": 75e-6, "gas_density": 1.2, "gas_viscosity": 1.8e-5}
WATER = {"particle_density": 2500.0, "diameter": 1e-4, "gas_density": 1000.0,
         "gas_viscosity": 1e-3}  # fmt: skip
PHI = 0.2


def column(n: int, height: float, periodic: bool = True) -> Grid:
    """Cells above each other."""
    width = height / n
    return Grid(cells=(1, n, 1), upper=(width, height, width), periodic=(False, periodic, False))


def wave(
    n: int, length: float, theta: float, dt: float
) -> tuple[TwoFluid, float, complex, complex]:
    """A column that starts as the first mode of the linear theory."""
    granular = Granular(temperature=theta)
    k = 2.0 * np.pi / length
    rates, vectors, slip = waves(k, PHI, drag_law("wen-yu"), granular, **FCC)
    vector = vectors[:, 0] / vectors[0, 0] * 1e-6
    grid = column(n, length)
    v, u = (np.real(x * np.exp(1j * k * grid.faces(1)))[None, :, None] for x in vector[1:3])
    mean = np.sinc(0.5 * k * grid.spacing[1] / np.pi)
    phi = PHI + mean * np.real(vector[0] * np.exp(1j * k * grid.centres(1)))[None, :, None]
    sim = TwoFluid(
        grid, phi, drag=drag_law("wen-yu"), granular=granular, time_step=dt, tolerance=1e-9,
        solids_velocity=(0, v, 0), gas_velocity=(0, slip + u, 0), **FCC,
    )  # fmt: skip
    return sim, k, complex(rates[0]), complex(vector[0])


def growth(axis: Any) -> float:
    """Growth rates over the wavelength."""
    worst = 0.0
    for theta, colour in ((3e-4, "C0"), (1e-3, "C1"), (2e-3, "C2")):
        lengths = np.geomspace(1.5e-3, 2e-2, 60)
        law = drag_law("wen-yu")
        exact = [
            waves(2 * np.pi / x, PHI, law, Granular(temperature=theta), **FCC)[0][0].real
            for x in lengths
        ]
        axis.semilogx(1e3 * lengths, exact, "-", color=colour, label=f"θ = {theta:g} m²/s²")
        for length in (2e-3, 4e-3, 1e-2):
            _, _, rate, _ = wave(16, length, theta, 1e-5)
            # Euler steps add the frequency squared times dt / 2.
            dt = 0.1 / abs(rate.imag) ** 2
            sim, k, rate, _ = wave(64, length, theta, dt)
            times, modes = [], []
            for _ in range(150):
                sim.step()
                times.append(sim.time)
                shape = np.exp(-1j * k * sim.grid.centres(1))
                modes.append(abs((sim.solid_fraction[0, :, 0] * shape).mean()))
            found = float(np.polyfit(times, np.log(modes), 1)[0])
            axis.plot(1e3 * length, found, "o", color=colour, mfc="none")
            worst = max(worst, abs(found - rate.real))
    axis.axhline(0.0, color="0.7", lw=0.8)
    axis.set_xticks((2, 5, 10, 20), labels=("2", "5", "10", "20"), minor=False)
    axis.xaxis.set_minor_formatter("")
    axis.set(xlabel="wavelength [mm]", ylabel="growth rate [1/s]", title="Small waves, φ = 0.2")
    axis.legend()
    return worst


def order(axis: Any) -> float:
    """Error of a smooth wave over the cells."""
    cells, errors = np.array([16, 32, 64]), []
    for n in cells:
        sim, k, rate, vector = wave(int(n), 0.01, 2e-3, 0.064 / n**2)
        sim.run(0.004)
        exact = np.real(vector * np.exp(1j * k * sim.grid.centres(1) + rate * sim.time))
        errors.append(np.abs(sim.solid_fraction[0, :, 0] - PHI - exact).mean() / abs(vector))
    axis.loglog(cells, errors, "o-", mfc="none", label="greybed")
    axis.loglog(cells, errors[0] * (cells[0] / cells) ** 2.0, "k--", lw=0.8, label="second order")
    axis.set(xlabel="cells per wave", ylabel="mean error over amplitude", title="Order in space")
    axis.set_xticks(cells, labels=[str(n) for n in cells])
    axis.xaxis.set_minor_formatter("")
    axis.legend()
    return float(np.log2(errors[-2] / errors[-1]))


def kynch(axis: Any) -> float:
    """Fronts of a sedimentation."""
    height, n = 0.1, 200
    law = drag_law("wen-yu")
    sim = TwoFluid(
        column(n, height, False), PHI, drag=law, longest_step=0.05, courant=0.4,
        sides={"y-": Wall(), "y+": Wall()}, **WATER,
    )  # fmt: skip
    slip = 0.01
    for _ in range(100):
        re = (1 - PHI) * slip * 1e-4 / 1e-6
        slip = 1500.0 * 9.81 * 1e-8 / (18e-3 * float(law(np.array([PHI]), np.array([re]))[0]))
    speed = (1 - PHI) * slip
    y, rows = sim.grid.centres(1), []
    for _ in range(10):
        sim.run(1.0)
        found = sim.solid_fraction[0, :, 0]
        rows.append((sim.time, y[found > 0.1].max(), y[found > 0.4].max()))
    t, clear, sediment = np.array(rows).T
    axis.plot(t, 1e2 * clear, "o", mfc="none", label="clear front")
    axis.plot(t, 1e2 * sediment, "s", mfc="none", label="sediment")
    dense = found[y < sediment[-1] - 1e-3].mean()
    axis.plot(t, 1e2 * (height - speed * t), "k-", lw=0.8, label="Kynch")
    axis.plot(t, 1e2 * PHI * speed / (dense - PHI) * t, "k-", lw=0.8)
    axis.set(xlabel="time [s]", ylabel="height [cm]", title="Spheres settle in water, φ = 0.2")
    axis.legend()
    return float(-np.polyfit(t, clear, 1)[0] / speed - 1.0)


def clusters(picture: Path, time: float) -> dict[str, float]:
    """FCC particles in a periodic box."""
    nx, ny, h = 64, 256, 3e-4
    grid = Grid(cells=(nx, ny, 1), upper=(nx * h, ny * h, h), periodic=(True, True, False))
    start = 0.1 * (0.9 + 0.2 * np.random.default_rng(0).random(grid.shape))
    sim = TwoFluid(grid, start, drag=drag_law("gidaspow"), longest_step=2e-4, **FCC)
    mass, rows = sim.solids_mass, []
    while sim.time < time:
        sim.step()
        rows.append((sim.time, sim.means.slip[1]))
    figure, axes = plt.subplots(1, 3, figsize=(8, 6.5), width_ratios=(1, 1, 1.4))
    phi = sim.solid_fraction[0]
    box = (0, 1e3 * nx * h, 0, 1e3 * ny * h)
    seen = axes[0].imshow(phi, origin="lower", extent=box, cmap="magma_r", vmin=0, vmax=0.4)
    figure.colorbar(seen, ax=axes[0], label="solid fraction", shrink=0.6)
    v = sim.solids_velocity[1]
    fall = 0.5 * (v[0, 1:] + v[0, :-1])
    most = float(np.quantile(abs(fall), 0.99))
    seen = axes[1].imshow(fall, origin="lower", extent=box, cmap="RdBu_r", vmin=-most, vmax=most)
    figure.colorbar(seen, ax=axes[1], label="rise of the solids [m/s]", shrink=0.6)
    for axis in axes[:2]:
        axis.set(xlabel="x [mm]", ylabel="y [mm]")
    t, slip = np.array(rows).T
    axes[2].plot(t, slip)
    axes[2].axhline(slip[: len(slip) // 5].mean(), color="0.7", lw=0.8)
    axes[2].set(xlabel="time [s]", ylabel="mean slip [m/s]", title="Clusters fall faster")
    figure.tight_layout()
    figure.savefig(picture, dpi=110)
    plt.close(figure)
    return {"mass": sim.solids_mass / mass - 1.0, "steps": sim.steps, "slip": float(slip[-1]),
            "most": float(phi.max()), "least": float(phi.min())}  # fmt: skip


def measure(picture: Path, of_clusters: Path, time: float = 0.16) -> dict[str, float]:
    """Draw, and give what is compared."""
    figure, axes = plt.subplots(1, 3, figsize=(13, 4))
    found = {
        "twofluid.growth": growth(axes[0]),
        "twofluid.order": order(axes[1]),
        "twofluid.front": kynch(axes[2]),
    }
    figure.tight_layout()
    figure.savefig(picture, dpi=110)
    plt.close(figure)
    return found | {f"twofluid.clusters_{k}": v for k, v in clusters(of_clusters, time).items()}


def main() -> None:
    """Draw and write the numbers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", required=True)
    parser.add_argument("--time", type=float, default=0.16, help="of the clusters [s]")
    options = parser.parse_args()
    out = output_folder(options.out)
    found = measure(out / "twofluid.png", out / "clusters.png", options.time)
    print(found)
    print(f"wrote {write_summary(out, 'verification', found)}")


if __name__ == "__main__":
    main()
