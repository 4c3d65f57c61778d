"""Random packings that were sheared: their fabric differs from direction to direction."""

from __future__ import annotations

import math

import numpy as np

from greybed.core.errors import InputError
from greybed.core.packing import Packing
from greybed.core.sizes import Sizes
from greybed.datasets.containers import PeriodicBox
from greybed.datasets.generate import STEPS, _relax, _Setup, _verified, random_packing

SHEAR_STEP = 0.02  # strain between two relaxations [-]


def sheared_packing(
    n: int, solid_fraction: float, sizes: Sizes, stretch: float, *, seed: int = 0
) -> Packing:
    """Random packing that was sheared: its fabric differs from direction to direction.

    A random packing in a periodic box is stretched along x and pressed together along z, at
    constant volume, in steps of 2 %; after each step the spheres push each other apart. It ends
    in a cube.

    Parameters
    ----------
    n, solid_fraction, sizes, seed
        As for :func:`random_packing`.
    stretch : float
        Final over first edge along x, 1 to 2 [-].

    Raises
    ------
    InputError
        If a number is out of range, or the bed jams on the way.
    """
    if not 1.0 <= stretch <= 2.0:
        raise InputError(f"stretch = {stretch:g} [-] must lie in 1 ... 2; mend it.")
    bed = random_packing(
        n, solid_fraction, sizes, container=PeriodicBox(aspect=(1.0 / stretch, 1.0, stretch)),
        seed=seed,
    )  # fmt: skip
    scale = float(bed.radii.mean())
    falling = np.argsort(-bed.radii, kind="stable")
    radii = bed.radii[falling]
    setup = _Setup(radii=radii / scale, metres=radii, container=PeriodicBox(), scale=scale)
    lengths, x = bed.edges / scale, bed.centres[falling] / scale
    steps = max(1, math.ceil(math.log(stretch) / SHEAR_STEP))
    factor = stretch ** (1.0 / steps)
    for step in range(steps):
        turn = np.array([factor, 1.0, 1.0 / factor])
        state = _relax(setup, x * turn, lengths * turn, STEPS)
        if not state.done:
            raise InputError(
                f"stretch = {stretch:g} [-]: the bed at solid fraction {solid_fraction:g} [-] jams "
                f"at {factor**step:.2f}; lower the stretch or the fraction."
            )
        x, lengths = state.centres, lengths * turn
    return _verified(setup, x, lengths, np.argsort(falling))
