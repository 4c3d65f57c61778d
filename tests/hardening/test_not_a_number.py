"""A number that is none, anywhere in a state, stops the run and is told with its place."""

from __future__ import annotations

import numpy as np
import pytest
from hardening_targets import _flow, _particles
from scipy import sparse

from greybed.core.errors import GreybedError
from greybed.coupling.network import HeatNetwork, State, newton


@pytest.mark.parametrize("part", ["place", "motion", "load"])
def test_particles(part):
    run = _particles.__wrapped__()
    run.simulation.run(20)
    getattr(run.simulation._lists.state, part)[0, 0] = np.nan
    with pytest.raises(GreybedError, match=r"step 20: particle 0 is at \(nan, 0, .* no place"):
        run.simulation.run(2000)


def test_gas():
    flow = _flow.__wrapped__("gas").flow
    flow.solver.state.velocity[0][3, 0, 1] = np.nan
    with pytest.raises(GreybedError, match=r"velocity along x at face .* is not finite"):
        flow.run(1e-3, lambda: None)


@pytest.mark.parametrize(
    ("part", "said"), [("ug", "gas velocity along x at face"), ("phi", "solid fraction at cell")]
)
def test_two_fluids(part, said):
    flow = _flow.__wrapped__("two-fluid").flow
    state = flow.solver._state
    inside = flow.solver._rims.inside
    if part == "ug":
        inside(state.ug[0], 0)[0, 3, 2] = np.nan
    else:
        inside(state.phi)[0, 3, 2] = np.nan
    with pytest.raises(GreybedError, match=rf"{said} \(2, 3, 0\) is not finite"):
        flow.run(1e-3, lambda: None)


def test_heat():
    chain = sparse.csr_matrix(np.diag([1.0, 1.0, 1.0], 1) + np.diag([1.0, 1.0, 1.0], -1))
    walls = np.array([[1.0], [0.0], [0.0], [0.0]])
    sources = np.array([0.0, 0.0, np.nan, 0.0])
    network = HeatNetwork(chain, walls, None, np.array([300.0, np.nan]), sources)
    _, status, _ = newton(
        network, State(np.full(4, 300.0), np.zeros(4)), None, tolerance=1e-9, max_iterations=9
    )
    assert not status.converged
    assert "heat of sphere 2 is not finite (its temperature is 300 K)" in status.reason
