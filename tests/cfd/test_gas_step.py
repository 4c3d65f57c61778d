"""Steps of the gas: conservation, symmetry, parts, restart, refusals."""

import numpy as np
import pytest

from greybed.cfd.gas import Fluid, GasSolver, Grid, Inflow, Outlet, SolverError, Wall
from greybed.core.errors import InputError

AIR = Fluid(density=1.2, viscosity=1.8e-5)
SIDES = {"z-": Inflow(0.4), "z+": Outlet(), "x-": Wall(velocity=(0.0, 0.0, 0.3)), "x+": Wall()}


def bed(budget=False, **other):
    grid = Grid(cells=(8, 1, 12), upper=(0.08, 0.01, 0.12))
    return GasSolver(grid, SIDES, AIR, budget=budget, void_fraction=0.6, **other)


def particles(grid, seed, beta=100.0):
    """Void fraction, drag, target and source of uneven particles."""
    rng = np.random.default_rng(seed)
    drag = tuple(beta * rng.random(s) for s in grid.face_shapes)
    target = tuple(0.2 * rng.standard_normal(s) for s in grid.face_shapes)
    source = tuple(rng.standard_normal(s) for s in grid.face_shapes)
    for faces in (drag, target, source):
        for axis, repeats in enumerate(grid.periodic):
            if repeats:
                a = np.moveaxis(faces[axis], 2 - axis, 0)
                a[-1] = a[0]
    return {"void_fraction": 0.5 + 0.2 * rng.random(grid.shape), "drag": drag, "target": target,
            "source": source}  # fmt: skip


def test_momentum_is_accounted_for_to_round_off():
    solver = bed(budget=True, gravity=(0.3, 0.0, -9.81))
    for k in range(12):
        b = solver.step(0.02, **particles(solver.grid, k % 3)).budget
        parts = (b.transport, b.pressure, b.drag, b.source, b.weight, b.lag)
        size = sum(abs(p) for p in parts).max()
        assert abs(b.change - sum(parts)).max() < 1e-13 * size


def test_drag_is_that_of_the_velocities_which_are_told():
    solver = bed(budget=True)
    for k, dt in enumerate((0.001, 0.02)):
        given = particles(solver.grid, k)
        report = solver.step(dt, **given)
        assert report.parts == 1 if k == 0 else report.parts > 1
        force = given["drag"][2] * (report.velocity[2] - given["target"][2])
        force = -dt * solver.grid.cell_volume * force[1:-1].sum()
        assert report.budget.drag[2] == pytest.approx(force, rel=1e-12)


def test_inside_a_periodic_box_transport_neither_makes_nor_takes_momentum():
    grid = Grid(cells=(8, 6, 10), upper=(0.8, 0.6, 1.0), periodic=(True,) * 3)
    solver = GasSolver(grid, {}, Fluid(density=1.2, viscosity=0.05), budget=True, void_fraction=0.6)
    for k in range(4):
        report = solver.step(0.02, **particles(grid, k, beta=5.0))
    b = report.budget
    assert abs(b.transport).max() < 1e-12 * abs(b.drag).max()
    # What a steady void fraction leaves of the lag is what the pressure's tolerance leaves.
    same = particles(grid, 3, beta=5.0)
    for _ in range(3):
        b = solver.step(0.02, **same).budget
    assert abs(b.lag).max() < 1e-6 * abs(b.drag).max()


def test_gas_makes_way_for_particles():
    # What the void fraction loses leaves through the outlet, what it wins comes back through it.
    grid = Grid(cells=(6, 1, 10), upper=(0.06, 0.01, 0.1))
    solver = GasSolver(grid, {"z+": Outlet()}, AIR, void_fraction=0.7, tolerance=1e-12)
    rng = np.random.default_rng(1)
    for sign in (-1.0, 1.0):
        before = solver.state.void_fraction
        after = np.clip(before + sign * 0.05 * rng.random(grid.shape), 0.3, 1.0)
        dt = 0.01
        solver.step(dt, void_fraction=after)
        out = 1e-4 * (after[-1] * solver.velocity[2][-1]).sum()
        lost = (before - after).sum() * grid.cell_volume / dt
        assert out == pytest.approx(lost, rel=1e-9)
        assert np.sign(out) == -sign


def test_uniform_wind_stays_uniform_whatever_it_blows_along():
    grid = Grid(cells=(12, 1, 9), upper=(1.2, 0.1, 0.9), periodic=(True, False, True))
    rng = np.random.default_rng(3)
    eps = 0.4 + 0.5 * rng.random(grid.shape)
    solver = GasSolver(grid, {}, AIR, void_fraction=eps, tolerance=1e-12)
    wind = (0.7, 0.0, -0.4)
    solver.set_velocity(*wind)
    for _ in range(8):
        eps = 0.4 + 0.5 * rng.random(grid.shape)
        rate = np.zeros(grid.shape)
        for axis, u in ((2, wind[0]), (0, wind[2])):
            face = 0.5 * (eps + np.roll(eps, 1, axis=axis))
            rate -= u * (np.roll(face, -1, axis=axis) - face) / 0.1
        solver.step(0.02, void_fraction=eps, void_rate=rate)
    for u, expected in zip(solver.velocity, wind, strict=True):
        assert abs(u - expected).max() < 1e-10
    assert abs(solver.pressure).max() < 1e-10


def test_planes_are_alike():
    found = []
    for a, b in ((0, 1), (0, 2), (1, 2)):
        cells, upper = [1, 1, 1], [0.01] * 3
        cells[a], cells[b], upper[a], upper[b] = 8, 12, 0.08, 0.12
        grid = Grid(cells=tuple(cells), upper=tuple(upper))
        names = "xyz"
        along = [0.0, 0.0, 0.0]
        along[b] = 0.3
        sides = {f"{names[b]}-": Inflow(0.4), f"{names[b]}+": Outlet(),
                 f"{names[a]}-": Wall(velocity=tuple(along))}  # fmt: skip
        solver = GasSolver(grid, sides, AIR, tolerance=1e-11)
        rng = np.random.default_rng(5)
        eps = 0.5 + 0.3 * rng.random((12, 8))
        drag = [np.zeros(s) for s in grid.face_shapes]
        drag[a] += 30.0
        drag[b] += 30.0 * rng.random((13, 8)).reshape(drag[b].shape)
        for _ in range(5):
            solver.step(0.01, void_fraction=eps.reshape(grid.shape), drag=tuple(drag))
        found.append((solver.pressure.ravel(), solver.velocity[a].ravel(),
                      solver.velocity[b].ravel()))  # fmt: skip
    for other in found[1:]:
        for x, y in zip(found[0], other, strict=True):
            np.testing.assert_allclose(x, y, rtol=0.0, atol=1e-9 * abs(x).max())


def test_dense_bed_in_steps_a_thousand_times_its_relaxation():
    solver = bed()
    drag = tuple(np.full(s, 1e6) for s in solver.grid.face_shapes)
    for _ in range(5):
        report = solver.step(0.005, void_fraction=0.4, drag=drag)
    assert report.parts == 1
    assert abs(solver.velocity[2][1:] - 1.0).max() < 1e-3


def test_a_saved_gas_goes_on_with_the_same_bits():
    first, second = bed(), bed()
    for k in range(3):
        first.step(0.005, **particles(first.grid, k))
    second.restore(first.save())
    for solver in (first, second):
        for k in range(3):
            solver.step(0.003, **particles(solver.grid, k))
    for a, b in zip(first.velocity, second.velocity, strict=True):
        np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(first.pressure, second.pressure)
    assert first.time == second.time


@pytest.mark.parametrize("periodic", [(True, True, True), (True, False, False),
                                      (False, False, True), (False, True, False)])  # fmt: skip
def test_transforms_and_multigrid_agree(periodic):
    grid = Grid(cells=(10, 8, 9), upper=(1.0, 1.2, 0.9), periodic=periodic)
    found = []
    for method in ("transform", "multigrid"):
        solver = GasSolver(grid, {}, AIR, void_fraction=0.8, pressure_solver=method,
                           tolerance=1e-12)  # fmt: skip
        source = particles(grid, 2)["source"]
        report = solver.step(0.01, source=source)
        assert (report.iterations > 0) == (method == "multigrid")
        assert report.divergence < 1e-11
        found.append(solver)
    for a, b in zip(found[0].velocity, found[1].velocity, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-11)
    np.testing.assert_allclose(found[0].pressure, found[1].pressure, atol=1e-9)


def test_backflow_through_an_outlet_stays_calm():
    grid = Grid(cells=(16, 1, 16), upper=(1.0, 0.1, 1.0))
    solver = GasSolver(grid, {"z+": Outlet(), "x+": Outlet()}, Fluid(density=1.0, viscosity=1e-3))
    rng = np.random.default_rng(0)
    solver.set_velocity(*(rng.standard_normal(s) for s in grid.face_shapes))
    energy = []
    for _ in range(60):
        solver.step(0.02)
        energy.append(sum(float((u**2).sum()) for u in solver.velocity))
    assert energy[-1] < 0.5 * energy[0]
    assert max(energy) < 1.05 * energy[0]


GRID = Grid(cells=(4, 1, 6), upper=(0.4, 0.1, 0.6), periodic=(True, False, False))


@pytest.mark.parametrize(
    ("boundaries", "message"),
    [
        ({"z-": Inflow(1.0)}, "Outlet"),
        ({"z-": Inflow(1.0), "z+": Inflow(-0.5)}, "more flow in than out"),
        ({"x-": Wall()}, "repeats"),
        ({"y-": Wall()}, "one cell"),
        ({"z-": Wall(velocity=(0.0, 0.0, 1.0))}, "along itself"),
        ({"top": Wall()}, "must be one of"),
        ({"z-": Inflow(np.ones(3)), "z+": Outlet()}, "shape"),
    ],
)
def test_sides_that_cannot_be_are_refused(boundaries, message):
    with pytest.raises(InputError, match=message):
        GasSolver(GRID, boundaries, AIR)


def test_what_comes_in_may_be_drawn_off():
    solver = GasSolver(GRID, {"z-": Inflow(0.5), "z+": Inflow(-0.5)}, AIR)
    solver.step(0.05)
    assert solver.velocity[2] == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"gradient": (0.0, 0.0, 1.0)}, "repeats"),
        ({"gradient": (1.0, 0.0, 0.0), "mean_flow": (1.0, None, None)}, "not both"),
        ({"model": "C"}, "'A' or 'B'"),
        ({"void_fraction": 0.0}, "void_fraction"),
        ({"tolerance": 2.0}, "tolerance"),
        ({"pressure_solver": "magic"}, "pressure_solver"),
    ],
)
def test_settings_that_cannot_be_are_refused(settings, message):
    with pytest.raises(InputError, match=message):
        GasSolver(GRID, {}, AIR, **settings)


def test_steps_that_cannot_be_are_refused_and_leave_the_gas_as_it_was():
    solver = bed()
    with pytest.raises(InputError, match="dt"):
        solver.step(0.0)
    with pytest.raises(InputError, match="drag must be"):
        solver.step(0.01, drag=tuple(np.full(s, -1.0) for s in solver.grid.face_shapes))
    with pytest.raises(InputError, match="void_fraction"):
        solver.step(0.01, void_fraction=1.5)
    with pytest.raises(InputError, match="temperature"):
        solver.step(0.01, heat_source=1.0)
    solver.set_velocity(0.0, 0.0, 1e9)
    before = solver.save()
    with pytest.raises(SolverError, match=r"crosses .* face .* across z"):
        solver.step(0.01)
    np.testing.assert_array_equal(solver.velocity[2], before["w"])
