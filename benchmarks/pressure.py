"""Pressure: cost per cell of a solve, from small grids to large ones.

python benchmarks/pressure.py           64^2 to 512^2 and 32^3 to 96^3, one core
python benchmarks/pressure.py --update  the same with new coefficients before each solve

Coefficients vary by a factor of three or so from face to face, as in a bed; x repeats, one end of z
is open. The residual comes down by 1e-8 from a start of 0. Of five solves the fastest counts, grids
in turn. A last line for 2-D and 3-D is the ratio of the largest to the smallest cost per cell.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from greybed.cfd.poisson import Poisson

GRIDS = {
    "2-D": [(64, 1, 64), (128, 1, 128), (256, 1, 256), (512, 1, 512)],
    "3-D": [(32, 32, 32), (64, 64, 64), (96, 96, 96)],
}
REPEATS = 5


def faces(shape: tuple[int, int, int]) -> list[np.ndarray]:
    rng = np.random.default_rng(1)
    nz, ny, nx = shape
    found = [
        np.exp(0.5 * rng.standard_normal(s))
        for s in ((nz, ny, nx + 1), (nz, ny + 1, nx), (nz + 1, ny, nx))
    ]
    found[0][..., -1] = found[0][..., 0]
    found[1][:, 0] = found[1][:, -1] = 0.0
    found[2][0] = 0.0
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--update", action="store_true")
    update = parser.parse_args().update
    for name, shapes in GRIDS.items():
        cases = []
        for shape in shapes:
            ways = faces(shape)
            solver = Poisson(*ways, (True, False, False))
            b = np.random.default_rng(2).standard_normal(shape)
            solver.solve(b)
            cases.append((shape, ways, solver, b))
        best = dict.fromkeys(shapes, np.inf)
        count = {}
        for _ in range(REPEATS):
            for shape, ways, solver, b in cases:
                start = time.perf_counter()
                if update:
                    solver.update(*ways)
                _, count[shape] = solver.solve(b)
                best[shape] = min(best[shape], time.perf_counter() - start)
        cost = {shape: best[shape] / np.prod(shape) for shape in shapes}
        for shape in shapes:
            print(
                f"{name} {'x'.join(map(str, shape)):>12}: {count[shape]:3d} iterations, "
                f"{best[shape] * 1e3:8.1f} ms, {cost[shape] * 1e9:6.0f} ns per cell"
            )
        print(f"{name} ratio {cost[shapes[-1]] / cost[shapes[0]]:.2f}")


if __name__ == "__main__":
    main()
