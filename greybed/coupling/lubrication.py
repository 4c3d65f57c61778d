"""Films of the fluid between spheres that near each other or part."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from greybed.coupling import _lubrication
from greybed.dem.simulation import Simulation

Array = NDArray[np.float64]


def lubrication(
    simulation: Simulation, viscosity: float, reach: float, rough: float, dt: float
) -> tuple[Array, float]:
    r"""Forces of films on spheres, in the simulation's own order, shape (n, 3) [N].

    :math:`-6 \pi \mu R^2 (1/h - 1/h_c) \dot h` along the line of the centres,
    :math:`1/R = 1/r_i + 1/r_j`, h the gap: the leading term of two rigid spheres (Jeffrey & Onishi,
    J. Fluid Mech. 139 (1984) 261), less its value at the outer cut-off :math:`h_c`, beyond which
    drag is thought to have it all. Films thinner than the roughness are taken to be as thick as it
    (Davis, Serayssol & Hinch, J. Fluid Mech. 163 (1986) 479), and where spheres touch there is
    none. It is the same on both, so that the fluid gets nothing. Tangential parts, which grow with
    the logarithm only, and films at walls are not in it.

    Parameters
    ----------
    simulation : Simulation
        The particles.
    viscosity : float
        Of the fluid [Pa s].
    reach, rough : float
        Outer cut-off and roughness, gaps between surfaces [m].
    dt : float
        Time over which the force will act; implicit in the velocity of the pair [s].

    Returns
    -------
    force : ndarray, shape (n, 3)
        [N].
    fastest : float
        Fastest approach over the film's thickness: steps should not exceed a share of one over it
        [1/s].
    """
    state, lists = simulation._state, simulation._lists
    at, ring, edge = state.place[:, :3].copy(), lists.periodic, lists.edge
    if ring.any():
        at[:, ring] = (at[:, ring] - lists.box[0][ring]) % edge[ring]
    tree = cKDTree(at, boxsize=edge if ring.any() else None)
    pairs = tree.query_pairs(2.0 * float(state.place[:, 3].max()) + reach, output_type="ndarray")
    pairs = pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))].astype(np.int64)
    force = np.zeros((len(at), 3))
    fastest = _lubrication.films(
        pairs, state.place, state.motion, edge, ring, viscosity, reach, rough, dt, force
    )
    return force, float(fastest)
