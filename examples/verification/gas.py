"""Figure of docs/gas.md: the gas against closed forms and Ghia's cavity; about two minutes.

python examples/verification/gas.py [FIGURE]; a part of run.py.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

from greybed.cfd.gas import Fluid, GasSolver, Grid, Inflow, Outlet, Wall

# u on the vertical centreline: Ghia, Ghia & Shin, J. Comput. Phys. 48 (1982) 387, table I.
GHIA = np.array(
    [
        # y, Re = 100, Re = 400
        [0.0547, -0.03717, -0.08186], [0.0625, -0.04192, -0.09266], [0.0703, -0.04775, -0.10338],
        [0.1016, -0.06434, -0.14612], [0.1719, -0.10150, -0.24299], [0.2813, -0.15662, -0.32726],
        [0.4531, -0.21090, -0.17119], [0.5, -0.20581, -0.11477], [0.6172, -0.13641, 0.02135],
        [0.7344, 0.00332, 0.16256], [0.8516, 0.23151, 0.29093], [0.9531, 0.68717, 0.55892],
        [0.9609, 0.73722, 0.61756], [0.9688, 0.78871, 0.68439], [0.9766, 0.84123, 0.75837],
    ]
)  # fmt: skip


def cavity(reynolds: float, n: int, until: float) -> tuple[np.ndarray, np.ndarray]:
    """Heights and velocities on the vertical centreline."""
    grid = Grid(cells=(n, n, 1), upper=(1.0, 1.0, 1.0 / n))
    solver = GasSolver(
        grid, {"y+": Wall(velocity=(1.0, 0.0, 0.0))}, Fluid(density=1.0, viscosity=1 / reynolds)
    )
    while solver.time < until:
        solver.step(min(solver.time_step(0.45, most=0.45 / n), until - solver.time + 1e-12))
    u = solver.velocity[0][0, :, n // 2]
    return np.r_[0, grid.centres(1), 1], np.r_[0, u, 1]


def vortices(n: int) -> tuple[float, float, float]:
    """Error of decaying Taylor-Green vortices, and its parts of viscosity and of the rest.

    The first part is known in closed form: second differences of a wave.
    """
    grid = Grid(cells=(n, n, 1), upper=(1.0, 1.0, 1.0 / n), periodic=(True, True, False))
    k = 2 * np.pi
    solver = GasSolver(grid, {}, Fluid(density=1.0, viscosity=0.02))
    u = np.sin(k * grid.faces(0))[None, :] * np.cos(k * grid.centres(1))[:, None]
    v = -np.cos(k * grid.centres(0))[None, :] * np.sin(k * grid.faces(1))[:, None]
    u[:, -1], v[-1] = u[:, 0], v[0]
    solver.set_velocity(u[None], v[None], np.zeros(grid.face_shapes[2]))
    for _ in range(2 * n):
        solver.step(0.1 / n)
    exact, discrete = (
        u * np.exp(-2 * 0.02 * rate * 0.2) for rate in (k**2, 2 * n**2 * (1 - np.cos(k / n)))
    )
    found = solver.velocity[0][0]
    whole, viscous, rest = (
        float(np.sqrt((e**2).mean())) for e in (found - exact, discrete - exact, found - discrete)
    )
    return whole, viscous, rest


def heated(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Heights and temperatures of gas that flows through hot particles."""
    grid = Grid(cells=(1, 1, n), upper=(0.1 / n, 0.1 / n, 0.1))
    fluid = Fluid(density=1.2, viscosity=1.8e-5, heat_capacity=1000.0, conductivity=0.0)
    solver = GasSolver(
        grid, {"z-": Inflow(0.4, 300.0), "z+": Outlet()}, fluid, void_fraction=0.5,
        temperature=300.0,
    )  # fmt: skip
    for _ in range(4 * n):
        solver.step(0.05 / n, heat_coefficient=2e4, heat_target=500.0)
    return grid.centres(2), solver.temperature[:, 0, 0]


def measure(picture: Path) -> dict[str, float]:
    """Draw, and give what is compared."""
    found: dict[str, float] = {}
    figure, axes = plt.subplots(1, 3, figsize=(12, 3.8))
    for column, (reynolds, n, until) in enumerate(((100, 32, 15.0), (400, 48, 30.0)), start=1):
        y, u = cavity(reynolds, n, until)
        off = abs(np.interp(GHIA[:, 0], y, u) - GHIA[:, column]).max()
        print(f"cavity, Re = {reynolds}, {n} x {n}: largest difference to Ghia {off:.4f}")
        found[f"gas.cavity_{reynolds}"] = float(off)
        line = axes[0].plot(u, y, label=f"Re = {reynolds}, {n} x {n}")[0]
        axes[0].plot(GHIA[:, column], GHIA[:, 0], "o", ms=4, mfc="none", color=line.get_color())
    axes[0].set(xlabel="u [lid's]", ylabel="y [side]", title="Cavity (circles: Ghia 1982)")
    axes[0].legend()
    sizes = np.array([16, 32, 64, 128])
    errors = np.array([vortices(int(n)) for n in sizes])
    orders = np.log2(errors[:-1] / errors[1:])
    print("vortices: errors", errors, "orders", orders)
    found |= {"gas.order_viscosity": float(orders[-1, 1]), "gas.order_rest": float(orders[-1, 2])}
    for part, name, mark in zip(
        errors.T, ("all of u", "of viscosity", "the rest"), "o^s", strict=True
    ):
        axes[1].loglog(sizes, part, f"{mark}-", ms=4, label=name)
    second = errors[0, 1] * (sizes[0] / sizes) ** 2.0
    axes[1].loglog(sizes, second, "k--", lw=0.8, label="second order")
    axes[1].set(xlabel="cells per side", title="Taylor-Green vortices")
    axes[1].set_xticks(sizes, labels=[str(n) for n in sizes])
    axes[1].xaxis.set_minor_formatter("")
    axes[1].legend()
    z, t = heated(40)
    exact = 500 - 200 * np.exp(-2e4 * z / 480.0)
    found["gas.heated"] = float(abs(t - exact).max() / 200.0)
    fine = np.linspace(0, 0.1, 200)
    axes[2].plot(fine, 500 - 200 * np.exp(-2e4 * fine / 480.0), "k-", label="closed form")
    axes[2].plot(z, t, "o", ms=4, mfc="none", label="40 cells")
    axes[2].set(xlabel="z [m]", ylabel="T [K]", title="Gas through hot particles")
    axes[2].legend()
    figure.tight_layout()
    figure.savefig(picture, dpi=110)
    plt.close(figure)
    return found


def main() -> None:
    measure(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images/gas_verification.png"))


if __name__ == "__main__":
    main()
