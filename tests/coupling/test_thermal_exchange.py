"""A thermal bed on exchange factors: the same temperatures as the radiative network, case key."""

import numpy as np
import pytest

from greybed.core import InputError, Packing, Plane
from greybed.core.writers import write_packing
from greybed.coupling import Material, Rows, ThermalBed, net_radiation, radiative_network
from greybed.coupling.case import load_case, run_case, view_factors
from greybed.datasets.lattices import lattice
from greybed.raytrace import exchange_factors

GREY = Material(conductivity=1.0, density=2000.0, heat_capacity=800.0, emissivity=0.5)


@pytest.fixture(scope="module")
def bed():
    free = lattice("sc", 3, 0.01, 0.45, periodic=False)
    walls = [
        Plane((0, 0, -0.011), (0, 0, 1), "hot"),
        Plane((0, 0, 0.055), (0, 0, -1), "cold"),
        Plane((-0.012, 0, 0), (1, 0, 0), "side"),
    ]
    return Packing(free.centres, free.radii, walls=walls)


@pytest.fixture(scope="module")
def grey(bed):
    (rows,) = exchange_factors(bed, 0.5, rays=2_000, wall_emissivity=[1.0, 1.0, 0.0])
    return rows


def test_a_bed_without_conduction_is_a_radiative_network(bed, grey):
    ask = {"wall_temperatures": (900.0, 300.0, None), "environment_temperature": 350.0}
    thermal = ThermalBed(bed, grey, material=GREY, conduction=False, **ask).steady()
    network = radiative_network(grey, **ask)
    np.testing.assert_allclose(thermal.temperatures, network.temperatures, rtol=1e-8)
    np.testing.assert_allclose(thermal.wall_radiation, network.wall_heats[:-1], atol=1e-8)
    assert thermal.opening_heat == pytest.approx(network.wall_heats[-1], rel=1e-8)


def test_net_radiation_takes_them(bed, grey):
    t = np.linspace(400.0, 800.0, len(bed))
    ask = {"wall_temperatures": (900.0, 300.0, None), "environment_temperature": 350.0}
    net = net_radiation(Rows.of(grey, bed), t, emissivity=0.5, **ask)
    network = radiative_network(grey, temperatures=t, **ask)
    np.testing.assert_allclose(net.absorbed, -network.heats, rtol=1e-9, atol=1e-12)
    with pytest.raises(InputError, match=r"traced with 0\.5"):
        net_radiation(Rows.of(grey, bed), t, emissivity=0.6, **ask)


def test_reflections_are_a_word_in_the_case(bed, grey, tmp_path):
    write_packing(Packing(bed.centres, bed.radii), tmp_path / "bed.csv")
    text = """
kind = "thermal-bed"
packing.file = "bed.csv"
opening.temperature = 350.0
material = { conductivity = 1.0, density = 2000.0, heat_capacity = 800.0, emissivity = 0.5 }
radiation = { source = "traced", rays = 2000, reflections = true }
solve.conduction = false
[[wall]]
name = "hot"
kind = "plane"
point = [0.0, 0.0, -0.011]
normal = [0.0, 0.0, 1.0]
temperature = 900.0
[[wall]]
name = "cold"
kind = "plane"
point = [0.0, 0.0, 0.055]
normal = [0.0, 0.0, -1.0]
temperature = 300.0
[[wall]]
name = "side"
kind = "plane"
point = [-0.012, 0.0, 0.0]
normal = [1.0, 0.0, 0.0]
heat = "adiabatic"
"""
    (tmp_path / "case.toml").write_text(text)
    case = load_case(tmp_path / "case.toml")
    rows = view_factors(case, bed)
    np.testing.assert_array_equal(rows.factors.toarray(), grey.factors.toarray())
    np.testing.assert_array_equal(rows.areas, grey.emission_areas)
    _, result = run_case(case, bed, rows)
    ask = {"wall_temperatures": (900.0, 300.0, None), "environment_temperature": 350.0}
    np.testing.assert_allclose(
        result.temperatures, radiative_network(grey, **ask).temperatures, rtol=1e-8
    )
    dull = text.replace("temperature = 900.0", "temperature = 900.0\nemissivity = 0.4")
    (tmp_path / "dull.toml").write_text(dull)
    less = view_factors(load_case(tmp_path / "dull.toml"), bed)
    (direct,) = exchange_factors(bed, 0.5, rays=2000, wall_emissivity=[0.4, 1.0, 0.0])
    np.testing.assert_array_equal(less.wall_factors, direct.wall_factors)
    (tmp_path / "odd.toml").write_text(dull.replace(", reflections = true", ""))
    with pytest.raises(InputError, match=r"'hot': emissivity = 0.4 .*radiation.reflections = true"):
        load_case(tmp_path / "odd.toml")
    (tmp_path / "odd.toml").write_text(
        text.replace('source = "traced", rays = 2000', 'source = "off"')
    )
    with pytest.raises(InputError, match=r"reflections = true needs source"):
        load_case(tmp_path / "odd.toml")
