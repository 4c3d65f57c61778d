"""Fixes in LAMMPS and LIGGGHTS: forces and heat flows of greybed itself, on one rank and on two."""

import json

import numpy as np
import pytest
from host_cases import CELL, EDGE, GAS, HOSTS, WIND, built, grains, run_deck, start

from greybed.cli.main import main
from greybed.closures import content_hash, load_any, model_path
from greybed.closures.drag.filtered import Material, filtered_force
from greybed.closures.drag.laws import drag_law
from greybed.closures.viewfactor.markers import pair_markers
from greybed.closures.viewfactor.neighbourhood import neighbourhood
from greybed.core import Packing
from greybed.core.exact import pair_factor
from greybed.hosts import lammps, liggghts

DRAG = "shipped:filtered_drag_mlp_plain"
PENCIL = "shipped:viewfactor_mlp_pencil"
SIGMA = 5.670374419e-8
REACH = 2.5e-4


@pytest.fixture(params=sorted(HOSTS))
def engine(request):
    if reason := HOSTS[request.param].missing():
        pytest.skip(f"{request.param}: {reason}")
    return request.param


@pytest.fixture(scope="session")
def adapters(tmp_path_factory):
    """Adapters by engine and model; each one is built once."""
    made = {}

    def of(engine, model):
        if (engine, model) not in made:
            folder = tmp_path_factory.mktemp(f"{engine}_{model.rpartition(':')[2]}")
            made[engine, model] = built(engine, model, folder)
        return made[engine, model]

    return of


def drag_deck(engine, folder, wind=WIND, steps=100, ranks=1, dt=1e-6):
    centres, radii = grains()
    # They meet within the run: 0.1 m/s over 1e-4 s is a tenth of a diameter, ten times the gaps.
    velocities = 0.1 * np.sin(12.9898 * np.arange(3 * len(radii))).reshape(-1, 3)
    start(folder, centres, radii, velocities)
    gas = f"gas {GAS['density']} {GAS['viscosity']} velocity {wind[0]} {wind[1]} {wind[2]}"
    lines = [*HOSTS[engine].head(dt, heat=False), f"fix drag all greybed/drag {gas} cell {CELL}"]
    columns = "x y z vx vy vz fx fy fz"
    return centres, radii, velocities, run_deck(engine, folder, lines, steps, columns, ranks)


def own_drag(centres, radii, velocities, wind=WIND):
    """Force on each grain by greybed itself, every size a material of its own; and how many of
    them are outside the training data, where the law stays."""
    closure = load_any(model_path(DRAG))
    cells = np.floor(centres / CELL).astype(int)
    phi = np.zeros((2, 2, 2))
    np.add.at(phi, tuple(cells.T), 4.0 / 3.0 * np.pi * radii**3 / CELL**3)
    found, outside = np.empty((len(radii), 3)), 0
    for i, r in enumerate(radii):
        here = phi[tuple(cells[i])]
        material = Material(2.0 * r, 1500.0, GAS["density"], GAS["viscosity"], 9.81)
        slip = np.array([wind]) - velocities[i]
        force = filtered_force(
            closure, material, drag_law("wen-yu"), (0.0, 0.0, -9.81), here, slip, CELL
        )
        stays = bool(force.prediction.extrapolates[0])
        outside += stays
        each = force.unfiltered[0] if stays else force.force[0]
        found[i] = each * (4.0 / 3.0 * np.pi * r**3) / here
    return found, outside


def test_drag_is_that_of_greybed(engine, adapters):
    made = drag_deck(engine, adapters(engine, DRAG), steps=1)
    centres, radii, velocities, (first, _, said) = made
    expected, outside = own_drag(centres, radii, velocities)
    # Densities have single precision in the fix, which moves u_t by 1e-7.
    error = np.abs(first[:, 6:] - expected).max() / np.abs(expected).max()
    assert error < 1e-6
    assert 0 < outside < len(radii)
    assert f"{2 * len(radii)} evaluations" in said


def test_two_ranks_move_grains_as_one_does(engine, adapters):
    folder = adapters(engine, DRAG)
    *_, (first, alone, _) = drag_deck(engine, folder)
    *_, (_, both, _) = drag_deck(engine, folder, ranks=2)
    moved = np.abs(alone[:, :3] - first[:, :3]).max()
    away = alone[:, :3] - both[:, :3]
    away -= EDGE * np.round(away / EDGE)  # wrapped at another step
    # Sums of contact forces round in another order; a hundred steps amplify that a little.
    assert np.abs(away).max() < 1e-9 * moved
    assert np.abs(alone[:, 3:6] - both[:, 3:6]).max() < 1e-9


def test_outside_the_training_data_drag_is_the_law_to_the_last_bit(engine, adapters):
    if engine == "liggghts" and not HOSTS["lammps"].missing():
        pytest.skip("one engine is enough for the part that both share; builds take time")
    storm = (0.0, 0.0, 60.0)  # far above all slips of the training data
    *_, (first, _, said) = drag_deck(engine, adapters(engine, DRAG), storm, steps=1)
    *_, (law, _, _) = drag_deck(engine, adapters(engine, "law:wen-yu"), storm, steps=1)
    assert np.array_equal(first[:, 6:], law[:, 6:])
    n = len(first)
    assert f"{2 * n} evaluations, {2 * n} outside the training data" in said
    assert "there exactly the law wen-yu" in said


def heat_deck(engine, folder, steps=20, ranks=1):
    centres, radii = grains(mean=1e-4, spread=0.3, edge=8e-4)
    start(folder, centres, radii, np.zeros_like(centres), edge=8e-4)
    lines = [
        *HOSTS[engine].head(1e-6, heat=True),
        *HOSTS[engine].warm("300+1200*sin(1000*x)*sin(1000*x)"),
        f"fix shine all greybed/radiation reach {REACH} every 1 emissivity 0.7 surroundings 400",
    ]
    columns = f"x y z {HOSTS[engine].heat_columns}"
    return centres, radii, run_deck(engine, folder, lines, steps, columns, ranks)


def own_heat(centres, radii, temperatures, model):
    """Heat flow into each grain by greybed's own markers and closure."""
    packing = Packing(centres, radii, box=(8e-4,) * 3, periodic=(True,) * 3)
    hood = neighbourhood(packing, REACH)
    i, j = hood.owner[hood.within], hood.sphere[hood.within]
    if model == PENCIL:
        closure = load_any(model_path(PENCIL))
        markers = pair_markers(packing, hood)
        factor = closure.evaluate(**markers.of(closure.marker_names))
    else:
        d = np.maximum(hood.distance[hood.within], radii[i] + radii[j])
        factor = pair_factor(radii[j] / d, radii[j] / radii[i])
    back = factor * radii[i] ** 2 / radii[j] ** 2
    pair = 4.0 * np.pi * radii[i] ** 2 * factor * 0.7**2 / (1.0 - 0.3**2 * factor * back)
    flow = SIGMA * pair * (temperatures[j] ** 4 - temperatures[i] ** 4)
    rest = np.maximum(0.0, 1.0 - np.bincount(i, factor, len(radii)))
    beyond = SIGMA * 0.7 * 4.0 * np.pi * radii**2 * rest * (400.0**4 - temperatures**4)
    return np.bincount(i, flow, len(radii)) + beyond


@pytest.mark.parametrize("model", ["law:exact", PENCIL])
def test_radiation_is_that_of_greybed(engine, adapters, model):
    if (engine, model) == ("liggghts", "law:exact"):
        pytest.skip("one engine is enough for the part that both share; builds take time")
    centres, radii, (first, _, said) = heat_deck(engine, adapters(engine, model), steps=1)
    expected = own_heat(centres, radii, first[:, 3], model)
    # The closure agrees to 1e-12; sums over a hundred neighbours of either sign lose some digits.
    assert np.abs(first[:, 4] - expected).max() < 1e-10 * np.abs(expected).max()
    assert "0 outside the training data" in said


def test_two_ranks_heat_grains_as_one_does(engine, adapters):
    folder = adapters(engine, PENCIL)
    *_, (first, alone, _) = heat_deck(engine, folder)
    *_, (_, both, _) = heat_deck(engine, folder, ranks=2)
    assert np.abs(alone[:, 3] - first[:, 3]).max() > 1e-6  # they have been heated [K]
    assert np.abs(alone[:, 3] - both[:, 3]).max() < 1e-11 * alone[:, 3].max()


def test_the_example_runs_on_two_ranks_and_says_what_it_did(engine, adapters):
    folder = adapters(engine, PENCIL)
    HOSTS[engine].host.run(folder, ranks=2)
    (said,) = HOSTS[engine].host.said(folder)
    assert load_hash(PENCIL) in said
    assert "0 outside the training data" in said


def load_hash(model):
    return content_hash(load_any(model_path(model)))


def test_the_policy_abort_stops_the_run(engine, adapters):
    folder = adapters(engine, DRAG)
    centres, radii = grains()
    start(folder, centres, radii, np.zeros_like(centres))
    gas = f"gas {GAS['density']} {GAS['viscosity']} velocity 0 0 60 cell {CELL} policy abort"
    lines = [*HOSTS[engine].head(1e-6, heat=False), f"fix drag all greybed/drag {gas}"]
    with pytest.raises(AssertionError, match="outside the training data"):
        run_deck(engine, folder, lines, 1, "x y z")


CASE = """
kind = "particles"
duration = 0.2
[output]
samples = 0.1
[[material]]
name = "glass"
density = 2500
youngs_modulus = "50 kPa"
poissons_ratio = 0.3
[[contact]]
between = ["glass", "glass"]
restitution = 0.6
friction = 0.3
[[particles]]
kind = "file"
material = "glass"
file = "start.csv"
"""


def test_a_case_takes_a_plugin_along(engine, adapters, tmp_path):
    """A sphere of 0.1 mm that falls in air has its terminal velocity after 0.2 s."""
    # LIGGGHTS: where its only build is that of the closure, a filter of no size is the law alone.
    model = "law:wen-yu" if engine == "lammps" else DRAG
    file = {"lammps": lammps.PLUGIN, "liggghts": liggghts.PROGRAM}[engine]
    plugin = adapters(engine, model) / file
    (tmp_path / "start.csv").write_text("x [mm],y [mm],z [mm],radius [mm]\n0,0,0,0.05\n")
    (tmp_path / "case.toml").write_text(CASE)
    fix = "greybed/drag gas 1.2 1.8e-5 velocity 0 0 0 fraction 0 filter 0"
    words = ["--engine", engine, "--quiet", "--plugin", str(plugin), "--fix", fix]
    case, out = str(tmp_path / "case.toml"), str(tmp_path / "out")
    assert main(["simulate", case, "--out", out, *words]) == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    mass = 2500.0 * np.pi / 6.0 * 1e-4**3
    speed = np.sqrt(2.0 * summary["kinetic_energy_J"] / mass)
    law = drag_law("wen-yu")(0.0, 1.2 * 1e-4 * speed / 1.8e-5)
    # exp(-0.2 s / 0.07 s) of the way is left, and less as drag grows with speed.
    assert 3.0 * np.pi * 1.8e-5 * 1e-4 * law * speed == pytest.approx(mass * 9.81, rel=0.05)
    assert "evaluations" in (tmp_path / "out" / engine / f"log.{engine}").read_text()
