"""Filtered drag from particles in a gas: sums are those of the particles, states go on alike."""

import dataclasses

import numpy as np
import pytest

from greybed.core.errors import InputError
from greybed.datasets.drag_campaign import generate
from greybed.datasets.drag_design import DragDesign, FlowDesign
from greybed.datasets.drag_filters import filtered
from greybed.datasets.drag_flows import clock, drag_of
from greybed.datasets.drag_particles import ParticleFlow

SMALL = FlowDesign(
    name="p", kind="cfd-dem", diameter=100e-6, particle_density=1500.0, solid_fraction=0.1,
    cells=(4, 4, 4), cell=3.0, develop=0.02, apart=0.01, samples=2,
)  # fmt: skip


@pytest.fixture(scope="module")
def flow():
    made = ParticleFlow(SMALL)
    end = 0.02 * clock(SMALL)
    while made.time < end:
        made.step(end)
    return made


def test_cells_hold_the_volume_momentum_and_drag_of_the_particles(flow):
    seen = flow.look()
    sphere = np.pi / 6.0 * SMALL.diameter**3
    cell = flow.grid.cell_volume
    v = flow.particles._state.motion[:, :3]
    assert seen.solid_fraction.sum() * cell == pytest.approx(len(v) * sphere, rel=1e-12)
    momentum = (seen.solid_fraction * seen.solids).sum(axis=(1, 2, 3)) * cell
    np.testing.assert_allclose(
        momentum, sphere * v.sum(axis=0), atol=1e-12 * sphere * np.abs(v).sum()
    )
    terms = flow.both._terms(flow.both._look(), flow.both._read(flow.gas.velocity))
    force = terms.coefficient[:, None] * (flow.both._read(flow.gas.velocity) - v)
    np.testing.assert_allclose(
        seen.drag.sum(axis=(1, 2, 3)) * cell,
        force.sum(axis=0),
        rtol=1e-3,
        atol=1e-3 * np.abs(force).sum(),
    )  # the coupling's void fraction is that of before its last step


def test_the_mean_gradient_carries_the_weight_and_phases_keep_momentum(flow):
    seen = flow.look()
    solid = seen.solid_fraction.mean()
    weight = 9.81 * (solid * 1500.0 + (1.0 - solid) * 1.2)
    assert seen.gradient[1].mean() == pytest.approx(-weight, rel=1e-9)
    # Nothing from without: what the gas rises with, the particles fall with, but for what the
    # pressure leaves of continuity (1e-6).
    density = seen.solid_fraction * 1500.0 * seen.solids + (
        (1.0 - seen.solid_fraction) * 1.2 * seen.gas
    )
    given = 9.81 * 1500.0 * solid * flow.time
    assert np.abs(density.mean(axis=(1, 2, 3))).max() < 1e-5 * given


def test_drag_of_one_cell_is_near_the_law_and_that_of_many_follows_from_it(flow):
    # Not exact: a particle sees the gas where it is, the cell knows its mean.
    seen = flow.look()
    slip = seen.gas - seen.solids
    law = drag_of(SMALL, seen.solid_fraction, slip)
    kept = (seen.drag * slip).sum() / (law * slip).sum()
    assert 0.9 < kept < 1.1
    whole = filtered(seen, 4)
    np.testing.assert_allclose(
        whole["drag_force"][:, 0, 0, 0], seen.drag.mean(axis=(1, 2, 3)), rtol=1e-9
    )


def test_a_kept_state_goes_on_with_the_same_bits():
    first, again = ParticleFlow(SMALL), ParticleFlow(dataclasses.replace(SMALL, seed=9))
    for _ in range(3):
        first.step(1.0)
    again.restore(first.save())
    for _ in range(3):
        first.step(1.0)
        again.step(1.0)
    one, two = first.look(), again.look()
    for name in ("solid_fraction", "gas", "solids", "gradient", "drag"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name), err_msg=name)


def test_a_campaign_takes_particles_and_says_so(tmp_path):
    data, left = generate(DragDesign(case=(SMALL,), filters=(1, 2), each=50), tmp_path)
    assert not left
    assert data is not None
    assert data.cases[0].source == "cfd-dem"
    assert data.cases[0].dimension == 3
    assert set(data.filter_cells) == {1, 2}
    assert np.isfinite(data.drag_force).all()


def test_boxes_of_few_diameters_are_refused():
    with pytest.raises(InputError, match="8 at least along each axis"):
        dataclasses.replace(SMALL, cells=(8, 8, 1), cell=4.0)
