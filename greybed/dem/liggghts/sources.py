"""Particles of a case in the words of LIGGGHTS: a data file of the start, and what comes later."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from greybed.core.sizes import Discrete, Mono, Sizes
from greybed.dem.case_tables import PackTable, StreamTable

Array = NDArray[np.float64]

# Templates that stand for a distribution of sizes: one for each thirty-second of the number.
_CLASSES = 32


def data_text(
    centres: Array, radii: Array, types: NDArray[np.int64], densities: Array,
    velocities: Array, box: Array, n_types: int,
) -> str:  # fmt: skip
    """The spheres of the start with all digits, as ``read_data`` takes them."""
    lines = [f"start\n\n{len(radii)} atoms\n{n_types} atom types"]
    lines += [f"{a!r} {b!r} {x}lo {x}hi" for x, (a, b) in zip("xyz", box.T.tolist(), strict=True)]
    lines.append("\nAtoms\n")
    columns = zip(
        types.tolist(), (2.0 * radii).tolist(), densities.tolist(), centres.tolist(), strict=True
    )
    for k, (kind, d, rho, x) in enumerate(columns, 1):
        lines.append(f"{k} {kind} {d!r} {rho!r} {x[0]!r} {x[1]!r} {x[2]!r}")
    lines.append("\nVelocities\n")
    for k, v in enumerate(velocities.tolist(), 1):
        lines.append(f"{k} {v[0]!r} {v[1]!r} {v[2]!r} 0 0 0")
    return "\n".join(lines) + "\n"


def classes(sizes: Sizes, factor: float = 1.0) -> tuple[Array, Array]:
    """Radii and their shares of the number: those of the distribution, or its quantiles."""
    if isinstance(sizes, Mono):
        return np.array([factor * sizes.radius]), np.ones(1)
    if isinstance(sizes, Discrete):
        return factor * np.array(sizes.sizes), sizes.number_shares
    return factor * sizes.radii(_CLASSES), np.full(_CLASSES, 1.0 / _CLASSES)


def insertion(
    number: int,
    table: PackTable | StreamTable,
    kind: int,
    density: float,
    sizes: Sizes,
    mass: float,
    every: int,
    seed: int,
) -> list[str]:
    """Lines that put particles into a region from now on.

    Parameters
    ----------
    number : int
        Of the table in the case.
    table : PackTable or StreamTable
        A pack comes at once, a stream at its rate.
    kind : int
        Atom type.
    density : float
        [kg/m3]
    sizes : Sizes
        Of the radii.
    mass : float
        Of a stream, still to come [kg].
    every : int
        Steps between two insertions.
    seed : int
        Of the case.
    """
    radii, shares = classes(sizes)
    draw = iter(primes(len(radii) + 2, 100_000 * (number + 1) + 97 * seed))
    lines, names = [], []
    for k, (radius, share) in enumerate(zip(radii.tolist(), shares.tolist(), strict=True)):
        name = f"size_{number}_{k}"
        lines.append(
            f"fix {name} all particletemplate/sphere {next(draw)} atom_type {kind} "
            f"density constant {density!r} radius constant {radius!r}"
        )
        names.append(f"{name} {share!r}")
    lines.append(
        f"fix sizes_{number} all particledistribution/discrete/numberbased {next(draw)} "
        f"{len(radii)} {' '.join(names)}"
    )
    (x, y, z), (X, Y, Z) = table.lower, table.upper
    if table.round:
        radius = 0.5 * min(X - x, Y - y)
        lines.append(
            f"region source_{number} cylinder z {0.5 * (x + X)!r} {0.5 * (y + Y)!r} {radius!r} "
            f"{z!r} {Z!r} units box"
        )
    else:
        lines.append(f"region source_{number} block {x!r} {X!r} {y!r} {Y!r} {z!r} {Z!r} units box")
    vx, vy, vz = table.velocity
    ends = f"overlapcheck yes all_in yes vel constant {vx!r} {vy!r} {vz!r}"
    begins = f"fix source_{number} all insert"
    common = f"seed {next(draw)} distributiontemplate sizes_{number} maxattempt 400"
    if isinstance(table, PackTable):
        lines.append(
            f"{begins}/pack {common} insert_every once {ends} region source_{number} "
            f"particles_in_region {table.count}"
        )
    else:
        lines.append(
            f"{begins}/rate/region {common} mass {mass!r} massrate {table.rate!r} "
            f"insert_every {every} {ends} region source_{number}"
        )
    return lines


def primes(count: int, above: int) -> list[int]:
    """The first primes above a number: LIGGGHTS takes only such seeds, from 10,000 on."""
    found: list[int] = []
    n = max(above, 10_000) | 1
    while len(found) < count:
        if all(n % d for d in range(3, int(n**0.5) + 1, 2)):
            found.append(n)
        n += 2
    return found
