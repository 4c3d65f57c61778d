"""Forces of single contacts, and the stress in a volume from them."""

from __future__ import annotations

import itertools
import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError
from greybed.dem import _step
from greybed.dem.crew import run_steps
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
    rows = np.zeros((n, 2))
    run_steps(
        1, _step.FORCES, 1, state, alone, lists.rigid, none, simulation._law, lists.edge,
        lists.wraps, simulation.gravity, 0.0, lists.skin - lists.reach, 0.0, 0.0, False, rows, rows,
    )  # fmt: skip
    acts = alone.crossing[:, :3].any(axis=1)
    low = near.owner[:m][acts]
    high = near.partner[:m][acts]
    shift = near.shift[:m][acts].astype(np.int64)
    images = np.stack([shift // 9, shift // 3 % 3, shift % 3], axis=1) - 1
    branches = state.place[low, :3] - state.place[high, :3] - images * lists.edge
    arms = simulation._arms()
    branches = branches - arms[low] + arms[high]
    pairs = np.stack([lists.ident[low], lists.ident[high]], axis=1)
    return pairs, -alone.crossing[acts, :3], branches


def stress_in(simulation: Simulation, lower: ArrayLike, upper: ArrayLike) -> Array:
    r"""Mean stress of the contacts between particles in a box, compression positive.

    As :func:`stress`, each contact with the share of its branch that lies in the box (Hardy, J.
    Chem. Phys. 76, 1982, 622): boxes that fill a space share out the stress of the whole.

    Parameters
    ----------
    simulation : Simulation
        Between two runs.
    lower, upper : array_like, shape (3,)
        Corners, within periodic faces and a diameter from walls: branches to walls are not counted
        [m].

    Returns
    -------
    ndarray, shape (3, 3)
        Stress [Pa].

    Raises
    ------
    InputError
        For corners out of range.
    """
    low, high = np.asarray(lower, dtype=np.float64), np.asarray(upper, dtype=np.float64)
    if low.shape != (3,) or high.shape != (3,) or not (high > low).all():
        raise InputError("lower and upper must be two corners, upper above lower [m].")
    pairs, forces, branches = pair_forces(simulation)
    first = simulation.centres[pairs[:, 0]]
    lists = simulation._lists
    share = np.zeros(len(pairs))
    sides = [(-1.0, 0.0, 1.0) if repeats else (0.0,) for repeats in lists.periodic]
    for image in itertools.product(*sides):
        # A branch may cross a periodic face: what is beyond it lies in the box of an image.
        shift = np.where(lists.periodic, np.array(image) * lists.edge, 0.0)
        share += _share_inside(first + shift, branches, low, high)
    result: Array = (forces * share[:, None]).T @ branches / float((high - low).prod())
    return result


def _share_inside(start: Array, branch: Array, low: Array, high: Array) -> Array:
    """Share of the lines from ``start`` to ``start - branch`` that lies in a box [-]."""
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b = (start - low) / branch, (start - high) / branch
    enter, leave = np.minimum(a, b), np.maximum(a, b)
    # Along an axis that a line does not follow it is inside from end to end, or nowhere.
    along = branch == 0.0
    inside = (start >= low) & (start < high)
    enter = np.where(along, np.where(inside, -np.inf, np.inf), enter)
    leave = np.where(along, np.where(inside, np.inf, -np.inf), leave)
    first = np.maximum(enter.max(axis=1), 0.0)
    last = np.minimum(leave.min(axis=1), 1.0)
    return np.maximum(last - first, 0.0)


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
