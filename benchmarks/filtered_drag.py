"""Mean slip of clusters in a periodic box: a fine grid, coarse ones, corrections of the drag.

python benchmarks/filtered_drag.py [--closure NAME ...] prints a row for each grid and correction.
"""

from __future__ import annotations

import argparse

import numpy as np

from greybed.cfd.grid import Grid
from greybed.cfd.twofluid import TwoFluid
from greybed.closures.drag import drag_law
from greybed.closures.drag.filtered import Material
from greybed.coupling.filtered_drag import filtered_drag

FCC = Material(75e-6, 1500.0, 1.3, 1.8e-5)
GRAVITY = (0.0, -9.81, 0.0)
FRACTION = 0.15
CELLS, CELL = (64, 192), 4.0  # of the fine grid, in diameters
NAMES = (
    "radl-sundaresan", "igci", "shipped:filtered_drag_mlp_plain", "shipped:filtered_drag_mlp_full",
)  # fmt: skip


def mean_slip(factor: int, name: str | None) -> tuple[float, float, float]:
    """Mean slip over u_t with its standard error, and the variance of the solid fraction."""
    h = CELL * factor * FCC.diameter
    nx, ny = CELLS[0] // factor, CELLS[1] // factor
    grid = Grid(cells=(nx, ny, 1), upper=(nx * h, ny * h, h), periodic=(True, True, False))
    noise = np.random.default_rng(3).random(grid.shape)
    law = drag_law("wen-yu")
    sim = TwoFluid(
        grid, FRACTION * (0.9 + 0.2 * noise), particle_density=FCC.particle_density,
        diameter=FCC.diameter, gas_density=FCC.gas_density, gas_viscosity=FCC.gas_viscosity,
        drag=law, longest_step=2e-4,
        correction=None if name is None else filtered_drag(name, FCC, law, GRAVITY),
    )  # fmt: skip
    unit = FCC.terminal_velocity / FCC.gravity
    sim.run(6.0 * unit)
    slips, variances = [], []
    for _ in range(24):
        sim.run(0.25 * unit)
        slips.append(sim.means.slip[1] / FCC.terminal_velocity)
        variances.append(sim.means.fraction_variance)
    # One sample in four counts as independent: clusters live about u_t / g.
    error = float(np.std(slips) / np.sqrt(len(slips) / 4 + 1))
    return float(np.mean(slips)), error, float(np.mean(variances))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--closure", nargs="*", default=NAMES, help="names of corrections")
    names = parser.parse_args().closure
    for factor, corrections in ((1, [None]), (4, [None, *names]), (8, [None, *names])):
        for name in corrections:
            slip, error, variance = mean_slip(factor, name)
            print(
                f"{CELL * factor:>4g} d  {name or 'none':<34} slip / u_t {slip:.3f} +- {error:.3f} "
                f" variance of phi {variance:.4f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
