"""Filtered drag in the solvers: what it carries, what it conserves, its derivative, refusals."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from greybed.cfd.grid import Grid
from greybed.cfd.twofluid import TwoFluid
from greybed.closures import save
from greybed.closures.drag import drag_law
from greybed.closures.drag.filtered import BASELINES, FilteredDragClosure, filtered_force
from greybed.closures.drag.filtered.limits import FCC
from greybed.core.errors import InputError
from greybed.coupling.drag_exchange import Settings, drag_terms
from greybed.coupling.filtered_drag import FilteredDrag, filtered_drag
from greybed.coupling.gas_particles_case import load_gas_particles_case
from greybed.coupling.two_fluid_case import TwoFluidRun, load_two_fluid_case
from tests.coupling.test_gas_particles import cloud

LAW = drag_law("wen-yu")
DOWN = (0.0, -9.81, 0.0)
PHASES = {
    "particle_density": FCC.particle_density, "diameter": FCC.diameter,
    "gas_density": FCC.gas_density, "gas_viscosity": FCC.gas_viscosity,
}  # fmt: skip


def closures():
    """One of each form: published, with slip, learnt, with the gradient, with its force."""
    made = {name: BASELINES[name] for name in ("radl-sundaresan", "igci")}
    for markers in ("plain", "gradient", "linear", "full"):
        made[markers] = FilteredDragClosure.untrained("mlp", markers, seed=4)
    made["forest"] = FilteredDragClosure.untrained("forest", "plain", seed=4)
    return made


@pytest.mark.parametrize("name", closures())
def test_even_suspension_slips_where_the_filtered_drag_carries_the_weight(name):
    phi, n = 0.15, 4
    h = 8.0 * FCC.length
    grid = Grid(cells=(1, n, 1), upper=(h, n * h, h), periodic=(False, True, False))
    correction = FilteredDrag(closures()[name], FCC, LAW, DOWN, filter_ratio=2.0)
    sim = TwoFluid(grid, phi, drag=LAW, correction=correction, longest_step=5e-3, **PHASES)
    sim.run(1.5)
    slip = sim.means.slip[1]
    weight = phi * FCC.particle_density + (1.0 - phi) * FCC.gas_density
    # The cells of a column are one axis: their size is its height.
    f = filtered_force(
        correction.closure, FCC, LAW, DOWN, [phi], [[0.0, slip, 0.0]], 2.0 * h,
        [[0.0, -9.81 * weight, 0.0]],
    )  # fmt: skip
    assert f.force[0, 1] == pytest.approx(phi * (1.0 - phi) * FCC.weight, rel=1e-6)
    assert abs(slip / FCC.terminal_velocity) > 0.01


@pytest.mark.parametrize("name", ["plain", "full"])
def test_clusters_keep_mass_and_momentum(name):
    h = 4e-4
    grid = Grid(cells=(12, 20, 1), upper=(12 * h, 20 * h, h), periodic=(True, True, False))
    start = 0.1 * (0.7 + 0.6 * np.random.default_rng(1).random(grid.shape))
    correction = FilteredDrag(closures()[name], FCC, LAW, DOWN)
    sim = TwoFluid(grid, start, drag=LAW, correction=correction, longest_step=2e-4, **PHASES)
    mass = sim.solids_mass
    sim.run(0.02)
    assert sim.solids_mass == pytest.approx(mass, rel=1e-13)
    assert np.isfinite(sim.pressure).all()
    # The mean gradient carries both weights: the box as a whole stays at rest.
    phi = sim.solid_fraction
    total, size = 0.0, 0.0
    for u, density, share in (
        (sim.solids_velocity[1], FCC.particle_density, phi),
        (sim.gas_velocity[1], FCC.gas_density, 1.0 - phi),
    ):
        faces = 0.5 * (share + np.roll(share, 1, axis=1)) * density * u[:, :-1]
        total += faces.sum()
        size += np.abs(faces).sum()
    assert size > 0.0
    assert abs(total) < 1e-12 * size  # round-off


def test_steep_corrections_need_their_derivative_not_more_steps():
    # A closure whose drag falls with the slip: the implicit step stays finite at any length.
    h = 8.0 * FCC.length
    grid = Grid(cells=(1, 4, 1), upper=(h, 4 * h, h), periodic=(False, True, False))
    ends = []
    for step in (1e-3, 2e-2):
        correction = FilteredDrag(closures()["full"], FCC, LAW, DOWN)
        sim = TwoFluid(grid, 0.2, drag=LAW, correction=correction, time_step=step, **PHASES)
        sim.run(2.0)
        ends.append(sim.means.slip[1])
    assert ends[0] == pytest.approx(ends[1], rel=1e-5)


def particles_terms(correction, treatment="implicit", gradient=None):
    rng = np.random.default_rng(3)
    n = 40
    slip = FCC.terminal_velocity * rng.normal(0.0, 1.5, (n, 3))
    void, d = 1.0 - rng.uniform(0.02, 0.5, n), np.full(n, FCC.diameter)
    settings = Settings(drag="wen-yu", treatment=treatment, correction=correction)
    found = drag_terms(
        settings, slip, void, d, FCC.gas_density, FCC.gas_viscosity, 2e-3, gradient
    )  # fmt: skip
    return found, slip, void


@pytest.mark.parametrize("name", ["radl-sundaresan", "plain", "gradient", "full"])
def test_drag_of_particles_is_their_share_of_the_filtered_force(name):
    gradient = FCC.weight * np.random.default_rng(5).normal(0.0, 0.3, (40, 3))
    correction = FilteredDrag(closures()[name], FCC, LAW, DOWN)
    found, slip, void = particles_terms(correction, gradient=gradient)
    phi = 1.0 - void
    f = filtered_force(correction.closure, FCC, LAW, DOWN, phi, slip, 2e-3, gradient)
    share = np.pi / 6.0 * FCC.diameter**3 / phi
    force = found.coefficient * slip + (0.0 if found.push is None else found.push)
    scale = np.abs(f.force).max() * share[:, None]
    assert (np.abs(force - f.force * share[:, None]) < 1e-12 * scale).all()
    steep = found.coefficient * found.steepness / share[:, None]
    wanted = np.stack([f.derivative[:, a, a] for a in range(3)], axis=1)
    secant = found.coefficient / share[:, None]
    inside = (wanted > 0.5 * secant) & (wanted < 3.0 * secant)
    assert inside.mean() > 0.2
    np.testing.assert_allclose(steep[inside], wanted[inside], rtol=1e-10)


def test_a_scalar_hook_and_a_published_model_agree():
    model = BASELINES["radl-sundaresan"]

    def hook(phi, slip, size):
        return model.predict(solid_fraction=phi, filter_size=size / FCC.length).kept_along

    named, slip, _ = particles_terms(FilteredDrag(model, FCC, LAW, DOWN))
    given, _, _ = particles_terms(hook)
    np.testing.assert_allclose(named.coefficient, np.repeat(given.coefficient[:, None], 3, axis=1))
    assert named.push is None
    # Nothing depends on the slip but the law: the slope along the slip is the law's own.
    along = (slip**2 * named.steepness).sum(axis=1) / (slip**2).sum(axis=1)
    assert (along <= given.steepness + 1e-12).all()


@pytest.mark.parametrize("treatment", ["explicit", "semi-implicit", "implicit"])
@pytest.mark.parametrize("name", ["plain", "full"])
def test_particles_get_what_the_gas_loses(name, treatment):
    down = (0.0, 0.0, -9.81)
    glass = dataclasses.replace(FCC, diameter=1e-3, particle_density=2500.0, gas_density=1.2)
    correction = FilteredDrag(closures()[name], glass, LAW, down)
    both, _, _ = cloud(
        Settings(drag="wen-yu", treatment=treatment, correction=correction), gravity=down
    )
    moved = 0.0
    for _ in range(3):
        report = both.step(5)
        assert report.defect < 1e-12
        moved += np.abs(report.given).max()
    assert moved > 0.0


CASE = """
kind = "two-fluid"
duration = "2 ms"
drag = "wen-yu"
correction = "{name}"
{more}
[grid]
cells = [8, 16, 1]
upper = ["4.8 mm", "9.6 mm", "0.6 mm"]
periodic = "xy"
[gas]
density = 1.3
viscosity = 1.8e-5
[solids]
density = 1500.0
diameter = "75 um"
fraction = 0.1
perturbation = 0.2
[output]
samples = "1 ms"
"""


def written(tmp_path, name, more=""):
    path = tmp_path / "case.toml"
    path.write_text(CASE.format(name=name, more=more))
    return path


@pytest.mark.parametrize("name", ["igci", "mine.closure"])
def test_a_case_names_its_correction(name, tmp_path):
    save(FilteredDragClosure.untrained("mlp", "gradient", seed=1), tmp_path / "mine.closure")
    case = load_two_fluid_case(written(tmp_path, name, "filter_ratio = 2.0"))
    run = TwoFluidRun(case)
    run.run(case.duration, lambda: None)
    assert np.isfinite(run.solver.means.slip).all()
    assert run.results()["drag_correction"] == name
    assert 0.0 <= run.results()["drag_correction_extrapolated"] <= 1.0


@pytest.mark.parametrize(
    ("name", "more", "match"),
    [
        ("rdal", "", "'rdal' is not a known model; known are none, radl-sundaresan"),
        ("shipped:nothing", "", "shipped:nothing is not a closure that comes with greybed"),
        ("missing.closure", "", "cannot read this artifact .* check the path"),
        ("igci", "filter_ratio = 0.5", r"filter_ratio = 0.5 \[-\]: a filter smaller than a cell"),
        ("igci", "gravity = [1.0, -9.0, 0.0]", "must be along one axis"),
        ("igci", "gravity = [0.0, 0.0, 0.0]", r"gravity = 0 \[m s-2\] must be above 0"),
    ],
)
def test_what_a_case_cannot_have_is_refused(name, more, match, tmp_path):
    with pytest.raises(InputError, match=match):
        load_two_fluid_case(written(tmp_path, name, more))


def test_particles_too_name_their_correction(tmp_path):
    case = tmp_path / "bed.toml"
    case.write_text("""
kind = "gas-particles"
duration = "1 ms"
[grid]
cells = [2, 2, 4]
upper = ["4 mm", "4 mm", "8 mm"]
[gas]
density = 1.2
viscosity = 1.8e-5
[coupling]
correction = "nothing-like-it"
[[material]]
name = "glass"
density = 2500.0
youngs_modulus = "5 MPa"
poissons_ratio = 0.3
[[contact]]
between = ["glass", "glass"]
restitution = 0.9
friction = 0.3
[[particles]]
kind = "pack"
material = "glass"
count = 10
sizes = "mono:0.5 mm"
lower = ["0 mm", "0 mm", "0 mm"]
upper = ["4 mm", "4 mm", "8 mm"]
[output]
samples = "1 ms"
""")
    with pytest.raises(InputError, match="'nothing-like-it' is not a known model"):
        load_gas_particles_case(case)


def test_a_name_gives_a_model():
    found = filtered_drag("milioli", FCC, LAW, DOWN)
    assert found.closure is BASELINES["milioli"]
    assert not found.needs_gradient
