"""Two fluids: what is conserved, what is bounded, symmetries, restart, refusals."""

import numpy as np
import pytest

from greybed.cfd.grid import Grid
from greybed.cfd.kinetic import Granular
from greybed.cfd.rims import Inflow, Outlet, Wall
from greybed.cfd.twofluid import StepError, TwoFluid
from greybed.closures.drag.laws import drag_law
from greybed.core.errors import InputError, RangeError

FCC = {"particle_density": 1500.0, "diameter": 75e-6, "gas_density": 1.2, "gas_viscosity": 1.8e-5}
CELL = 3e-4


def box(nx=24, ny=32, nz=1, periodic=(True, True, False)):
    cells = (nx, ny, nz)
    return Grid(cells=cells, upper=tuple(n * CELL for n in cells), periodic=periodic)


def cloudy(grid, mean=0.15, spread=0.6, seed=0):
    """Clouds of some cells, with empty and with dense places."""
    rng = np.random.default_rng(seed)
    phi = rng.random(grid.shape)
    for _ in range(3):
        for axis in range(3):
            phi = (phi + np.roll(phi, 1, axis) + np.roll(phi, -1, axis)) / 3.0
    phi = np.maximum((phi - phi.mean()) / phi.std() * spread + 1.0, 0.0)
    return np.minimum(mean * phi / phi.mean(), 0.6)


def fluids(grid, phi, **options):
    options = {"drag": drag_law("gidaspow"), "longest_step": 2e-4, **FCC, **options}
    return TwoFluid(grid, phi, **options)


@pytest.mark.parametrize("cells", [(24, 32, 1), (12, 14, 10)])
def test_masses_and_momentum_in_a_periodic_box_stay_to_round_off(cells):
    grid = box(*cells, periodic=(True, True, cells[2] > 1))
    sim = fluids(grid, cloudy(grid))
    mass, before = sim.solids_mass, np.array(sim.means.momentum)
    for _ in range(60):
        sim.step()
        assert sim.solid_fraction.min() >= 0.0
    assert abs(sim.solids_mass / mass - 1.0) < 1e-14
    # Over the momentum that the weight would have given in that time.
    scale = 9.81 * sim.time * 1500.0 * 0.15
    assert np.abs(np.array(sim.means.momentum) - before).max() < 1e-12 * scale
    # The gas fills what is left: its mass stays if no volume is created.
    gone = sum(
        np.diff(q, axis=2 - a) / grid.spacing[a] for a, q in enumerate(sim.volume_flux)
    )  # fmt: skip
    assert np.abs(gone).max() * sim.time < 1e-5
    assert sim.means.fraction_variance > 0.0


def test_without_a_pressure_gradient_the_box_falls_freely():
    grid = box()
    sim = fluids(grid, cloudy(grid), pressure_gradient=(0.0, 0.0, 0.0))
    sim.run(4e-3)
    m = sim.means
    weight = 1500.0 * m.solid_fraction + 1.2 * (1.0 - m.solid_fraction)
    assert m.momentum[1] == pytest.approx(-9.81 * weight * sim.time, rel=1e-11)


@pytest.mark.parametrize(
    ("granular", "limited"),
    [(Granular(), False), (Granular(friction_scale=0.0, temperature=0.0), True)],
)
def test_a_violent_collapse_overfills_no_cell(granular, limited):
    """Particles that hardly feel the gas are thrown on the floor with 50 g."""
    grid = box(8, 32, periodic=(True, False, False))
    phi = np.minimum(cloudy(grid, mean=0.35, spread=0.4), 0.45)
    sim = fluids(
        grid, phi, granular=granular, gravity=(0.0, -490.0, 0.0), gas_viscosity=1e-7,
        drag=drag_law("stokes"),
    )  # fmt: skip
    mass, most, ever = sim.solids_mass, 0.0, 0
    while sim.time < 3.5e-3:
        sim.step()
        found = sim.solid_fraction
        assert found.min() >= 0.0
        assert found.max() <= granular.packing
        most, ever = max(most, found.max()), ever + sim.limited
    assert abs(sim.solids_mass / mass - 1.0) < 1e-13
    assert most > 0.55
    # Without any stress nothing but the limiter keeps cells from taking too much.
    assert (ever > 0) == limited
    lower, upper = sim.solid_fraction[0, :8].mean(), sim.solid_fraction[0, -4:].mean()
    assert lower > 0.5 > 0.05 > upper


def test_what_comes_in_goes_out():
    grid = box(12, 40, periodic=(False, False, False))
    phi = np.zeros(grid.shape)
    phi[:, :15] = 0.5
    sim = fluids(
        grid, phi, sides={"y-": Inflow(0.1), "y+": Outlet(), "x-": Wall(specularity=0.5)},
        tolerance=1e-9,
    )  # fmt: skip
    mass = sim.solids_mass
    for _ in range(100):
        sim.step()
    assert sim.solids_mass == pytest.approx(mass, rel=1e-14)
    flux = sim.volume_flux[1]
    np.testing.assert_allclose(flux[0, 0], 0.1, rtol=1e-14)
    assert flux[0].mean(axis=1) == pytest.approx(np.full(41, 0.1), rel=1e-7)


def test_a_mirrored_start_stays_mirrored():
    grid = box(periodic=(False, True, False))
    phi = cloudy(grid)
    a, b = (
        fluids(grid, p, tolerance=1e-11, time_step=1e-4)
        for p in (phi, phi[..., ::-1])
    )  # fmt: skip
    for _ in range(40):
        a.step()
        b.step()
    # Pressures are iterated in another order.
    np.testing.assert_allclose(b.solid_fraction[..., ::-1], a.solid_fraction, atol=1e-10)
    scale = np.abs(a.gas_velocity[1]).max()
    np.testing.assert_allclose(
        -b.gas_velocity[0][..., ::-1], a.gas_velocity[0], atol=1e-7 * scale
    )  # fmt: skip


@pytest.mark.parametrize("periodic", [True, False])
def test_three_dimensions_repeat_two_where_nothing_changes_along_the_third(periodic):
    flat, deep = box(), box(nz=3, periodic=(True, True, periodic))
    phi = cloudy(flat)
    options = {"tolerance": 1e-11, "time_step": 1e-4, "sides": {}}
    a = fluids(flat, phi, **options)
    free = {} if periodic else {"z-": Wall(gas_slips=True), "z+": Wall(gas_slips=True)}
    b = fluids(deep, np.repeat(phi, 3, axis=0), **{**options, "sides": free})
    for _ in range(30):
        a.step()
        b.step()
    for k in range(3):
        np.testing.assert_allclose(b.solid_fraction[k], a.solid_fraction[0], atol=1e-10)
        np.testing.assert_allclose(b.solids_velocity[1][k], a.solids_velocity[1][0], atol=1e-8)


def test_axes_are_alike():
    tall, lying = box(), box(32, 24)
    phi = cloudy(tall)
    a = fluids(tall, phi, tolerance=1e-11, time_step=1e-4)
    b = fluids(
        lying, phi.transpose(0, 2, 1), gravity=(-9.81, 0.0, 0.0), tolerance=1e-11, time_step=1e-4
    )
    for _ in range(30):
        a.step()
        b.step()
    np.testing.assert_allclose(b.solid_fraction.transpose(0, 2, 1), a.solid_fraction, atol=1e-10)


def test_a_restart_has_the_same_bits(tmp_path):
    grid = box(12, 30, periodic=(True, False, False))
    phi = np.full(grid.shape, 0.3)
    options = {"sides": {"y-": Inflow(0.05), "y+": Outlet()}}
    sim = fluids(grid, phi, **options)
    for _ in range(20):
        sim.step()
    np.savez(tmp_path / "state.npz", **sim.save())
    other = fluids(grid, 0.1, **options)
    with np.load(tmp_path / "state.npz") as stored:
        other.restore(stored)
    for _ in range(20):
        sim.step()
        other.step()
    for name, kept in sim.save().items():
        np.testing.assert_array_equal(other.save()[name], kept)
    with pytest.raises(InputError, match="'gas_y' is missing"):
        other.restore({k: v for k, v in sim.save().items() if k != "gas_y"})
    with pytest.raises(InputError, match="must be"):
        fluids(box(), 0.1).restore(sim.save())


def test_run_ends_on_time():
    sim = fluids(box(), 0.1)
    seen = []
    steps = sim.run(1.3e-3, each=lambda s: seen.append(s.time))
    assert sim.time == pytest.approx(1.3e-3, rel=1e-12)
    assert len(seen) == steps == sim.steps
    with pytest.raises(RangeError, match="duration"):
        sim.run(-1.0)


def test_a_correction_of_the_drag_acts_along_its_axis():
    """Slip of a homogeneous suspension under half the drag along gravity: twice that of Stokes."""
    seen = []

    def half(cell):
        seen.append(cell)
        one = np.ones_like(cell.solid_fraction)
        return one, 0.5 * one, one

    # Cells and steps large beside the relaxation time of 26 ms: drag is implicit.
    grid = Grid(cells=(4, 4, 1), upper=(0.04, 0.04, 0.01), periodic=(True, True, False))
    plain = fluids(grid, 0.1, drag=drag_law("stokes"), longest_step=5e-3)
    other = fluids(grid, 0.1, drag=drag_law("stokes"), longest_step=5e-3, correction=half)
    plain.run(0.4)
    other.run(0.8)
    assert other.means.slip[1] == pytest.approx(2.0 * plain.means.slip[1], rel=1e-6)
    assert seen[-1].slip[1] == pytest.approx(np.full(grid.shape, other.means.slip[1]))
    weight = 1500.0 * 0.1 + 1.2 * 0.9
    assert seen[-1].pressure_gradient[1] == pytest.approx(np.full(grid.shape, -9.81 * weight))
    assert seen[-1].size == pytest.approx(0.01)


def test_a_step_that_fails_is_halved_and_then_stops_with_the_reason():
    grid = box()
    calls = []

    def bad(phi, re):
        calls.append(1)
        return np.full_like(phi, np.nan if len(calls) > 3 else 1.0)

    sim = fluids(grid, cloudy(grid), drag=bad)
    for _ in range(3):
        sim.step()
    kept = sim.save()
    with pytest.raises(StepError, match="fails even with"):
        sim.step()
    for name, array in kept.items():
        np.testing.assert_array_equal(sim.save()[name], array)
    # Velocities that cross several cells in the step that is asked for: it is shortened.
    fast = fluids(grid, cloudy(grid), solids_velocity=(3.0, 0.0, 0.0), time_step=3e-4)
    assert fast.step() < 3e-4


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"solid_fraction": 0.64}, "solid fraction of 0.64 must be from 0 to below the packing"),
        ({"solid_fraction": -0.1}, "solid fraction of -0.1"),
        ({"solid_fraction": np.nan}, "solid fraction of nan"),
        ({"diameter": 0.0}, "diameter = 0"),
        ({"courant": 0.9}, "courant = 0.9"),
        ({"time_step": 1.0}, "viscosity of the gas allows"),
        ({"sides": {"x-": Wall()}}, "'x-' is not a side of this grid"),
        ({"pressure_gradient": "none"}, "'balance' or three numbers"),
        ({"tolerance": 0.5}, "tolerance"),
    ],
)
def test_bad_numbers_are_refused(change, message):
    change = {"solid_fraction": 0.1, **change}
    with pytest.raises(InputError, match=message):
        fluids(box(), change.pop("solid_fraction"), **change)


def test_bad_granular_numbers_are_refused():
    with pytest.raises(InputError, match="restitution"):
        Granular(restitution=1.1)
    with pytest.raises(InputError, match="friction_onset"):
        Granular(friction_onset=0.63)
    with pytest.raises(InputError, match="specularity"):
        fluids(box(periodic=(False, True, False)), 0.1, sides={"x-": Wall(specularity=2.0)})
    with pytest.raises(InputError, match="one cell"):
        fluids(box(1, 1, periodic=(False, False, False)), 0.1)
