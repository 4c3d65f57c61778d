"""What a step of gas and particles has exchanged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ExchangeReport:
    """What a gas step has exchanged.

    Attributes
    ----------
    time, dt, contact_steps
        At its end [s], its length [s], steps of the particles in it.
    given : array, shape (3,)
        Momentum that drag, lift and added mass have given to the particles [N s].
    taken, from_rims : array, shape (3,)
        The same as the gas has lost it inside, and at rim faces, where the boundary holds it.
    pressure : array, shape (3,)
        Momentum that the pressure gradient has given to the particles [N s].
    defect : float
        Given less taken and from rims, over the largest of the sums of their parts [-].
    least_void : float
        Lowest void fraction, before any limit [-].
    limited : int
        Cells where the void fraction was raised to the limit.
    outside : float
        Share of particles outside the data of the drag law [-].
    largest_reynolds : float
        [-].
    """

    time: float
    dt: float
    contact_steps: int
    given: Array
    taken: Array
    from_rims: Array
    pressure: Array
    defect: float
    least_void: float
    limited: int
    outside: float
    largest_reynolds: float
