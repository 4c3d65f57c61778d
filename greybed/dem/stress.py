"""Forces of single contacts, and the stress in a volume from them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError
from greybed.dem import _step
from greybed.dem.simulation import Simulation

Array = NDArray[np.float64]


def pair_forces(simulation: Simulation) -> tuple[NDArray[np.int64], Array, Array]:
    """Forces between particles, contact by contact.

    Parameters
    ----------
    simulation : Simulation
        Between two runs; it is not changed.

    Returns
    -------
    pairs : ndarray of int, shape (m, 2)
        Numbers in the order of ``simulation.centres``, each pair once.
    forces : ndarray, shape (m, 3)
        On the first one of each pair [N].
    branches : ndarray, shape (m, 3)
        From the centre of the second one to that of the first one, across periodic faces where
        that is nearer; of spheres of a body from and to its centre of mass [m].
    """
    lists = simulation._lists
    near, n = lists.near, len(lists.state.place)
    m = int(near.first[-1])
    # As if each particle were a block of its own: then every force waits in a slot of its own.
    alone = near._replace(
        touch=near.touch.copy(), history=near.history.copy(),
        slot=np.arange(m, dtype=np.int32), crossing=np.zeros((m, 6)), block=np.arange(n + 1),
    )  # fmt: skip
    state = lists.state._replace(load=np.zeros((n, 8)))
    none = lists.surfaces._replace(kinds=np.zeros(0, np.int64))
    _step.forces(
        state, alone, none, simulation._law, lists.edge, lists.wraps, 0.0, np.zeros((n, 3))
    )
    acts = alone.crossing[:, :3].any(axis=1)
    low = np.repeat(np.arange(n), np.diff(near.first))[acts]
    high = near.partner[:m][acts]
    shift = near.shift[:m][acts].astype(np.int64)
    images = np.stack([shift // 9, shift // 3 % 3, shift % 3], axis=1) - 1
    branches = state.place[low, :3] - state.place[high, :3] - images * lists.edge
    arms = simulation._arms()
    branches = branches - arms[low] + arms[high]
    pairs = np.stack([lists.ident[low], lists.ident[high]], axis=1)
    return pairs, -alone.crossing[acts, :3], branches


def stress(simulation: Simulation, volume: float) -> Array:
    r"""Mean stress of the contacts between particles, compression positive.

    .. math:: \sigma = \frac{1}{V} \sum_c f \otimes l

    with the force f on one particle of a contact and the branch l from the other one to it (Love
    1927; Weber 1966). Motion adds nothing here.

    Parameters
    ----------
    simulation : Simulation
        Between two runs.
    volume : float
        That the particles fill, voids included, above 0 [m3].

    Returns
    -------
    ndarray, shape (3, 3)
        Stress [Pa].

    Raises
    ------
    InputError
        For a volume out of range.
    """
    if not (volume > 0.0 and math.isfinite(volume)):
        raise InputError(f"volume = {volume:g} [m3] must be finite and above 0.")
    _, forces, branches = pair_forces(simulation)
    return forces.T @ branches / volume
