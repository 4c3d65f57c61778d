"""What the grid and the box change in filtered drag: one flow resolved finer, and in a wider box.

python examples/filtered_drag/grid.py                  the data set that comes with greybed
python examples/filtered_drag/grid.py --data FILE

Medians of H, the share of the law's drag that is kept along gravity, over filters of the same width
in diameters, by ranges of the filtered solid fraction.
"""

from __future__ import annotations

import argparse

import numpy as np

from greybed.closures.drag import drag_law
from greybed.datasets.filtered_drag import (
    FilteredDrag,
    read_filtered_drag,
    shipped_filtered_drag,
)

FLOWS = ("fcc-15", "fcc-15-fine", "fcc-15-wide")
FRACTIONS = ((0.02, 0.1), (0.1, 0.2), (0.2, 0.35))
# Slips that are nearly 0 say nothing of a quotient of forces.
LEAST_SLIP = 0.05  # [m/s]


def kept(data: FilteredDrag, name: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Solid fractions, widths over the diameter and H of the rows of a case."""
    at = [case.name for case in data.cases].index(name)
    case, own = data.cases[at], data.case == at
    phi, slip = data.solid_fraction[own], data.slip[own]
    eps = 1.0 - phi
    re = eps * case.gas_density * case.diameter / case.gas_viscosity
    force = np.asarray(drag_law(case.law)(phi, re * np.sqrt((slip**2).sum(axis=1))))
    beta = 18.0 * case.gas_viscosity * eps * phi * force / case.diameter**2
    good = slip[:, 1] > LEAST_SLIP
    h = data.drag_force[own][good, 1] / (beta[good] * slip[good, 1])
    return phi[good], data.filter_size[own][good] / case.diameter, h


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--data", help="data set (default: the one that comes with greybed)")
    options = parser.parse_args()
    data = read_filtered_drag(options.data) if options.data else shipped_filtered_drag()
    found = {name: kept(data, name) for name in FLOWS}
    widths = sorted(set.intersection(*({round(w, 3) for w in f[1]} for f in found.values())))
    print("filter [d]  solid fraction  " + "  ".join(f"{name:>12}" for name in FLOWS))
    for width in widths:
        for low, high in FRACTIONS:
            cells = []
            for phi, wide, h in found.values():
                rows = h[(abs(wide - width) < 1e-3) & (phi > low) & (phi <= high)]
                cells.append(f"{np.median(rows):.3f}" if rows.size > 20 else "-")
            row = "  ".join(f"{cell:>12}" for cell in cells)
            print(f"{width:10.0f}  {low:5.2f} to {high:4.2f}    {row}")


if __name__ == "__main__":
    main()
