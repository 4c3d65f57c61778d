"""Measures of stress in boxes, of a shear box, of slip on a plane."""

from __future__ import annotations

import math

import numpy as np
import pytest
from impacts import GLASS

from greybed.core import InputError
from greybed.core.config import build
from greybed.dem import Contact, Simulation
from greybed.dem.bulk_tests import filling_rate, shear_result
from greybed.dem.case import ParticleCase
from greybed.dem.measure_tables import ShearTable
from greybed.dem.results import results_of
from greybed.dem.runner import ParticleRun
from greybed.dem.stress import stress, stress_in


def test_boxes_share_out_the_stress_of_the_whole():
    rng = np.random.default_rng(3)
    at = np.stack(np.meshgrid(*[np.arange(5)] * 3, indexing="ij"), -1).reshape(-1, 3)
    edge = 5 * 1.95e-3
    sim = Simulation(
        (at + 0.5) * 1.95e-3 + rng.uniform(-2e-5, 2e-5, at.shape), 1e-3, GLASS, Contact(0.5, 0.3),
        gravity=(0, 0, 0), box=[[0, 0, 0], [edge] * 3], periodic=(True,) * 3,
    )  # fmt: skip
    whole = stress(sim, edge**3)
    assert whole.trace() > 0.0
    np.testing.assert_allclose(stress_in(sim, (0, 0, 0), (edge,) * 3), whole, rtol=1e-12)
    cut = (0.31 * edge, 0.5 * edge, 0.77 * edge)
    total = np.zeros((3, 3))
    for corner in np.ndindex(2, 2, 2):
        low = [0.0 if c == 0 else x for c, x in zip(corner, cut, strict=True)]
        high = [x if c == 0 else edge for c, x in zip(corner, cut, strict=True)]
        volume = np.prod(np.subtract(high, low))
        total += volume * stress_in(sim, low, high)
    np.testing.assert_allclose(total / edge**3, whole, rtol=1e-9, atol=1e-9 * whole.trace())
    with pytest.raises(InputError, match="upper above lower"):
        stress_in(sim, (0, 0, 0), (1, 1, 0))


def test_the_share_of_one_contact_in_a_box():
    sim = Simulation([[0, 0, 0], [1.9e-3, 0, 0]], 1e-3, GLASS, Contact(0.5, 0.3), gravity=(0, 0, 0))
    # A box about a quarter of the line between the centres.
    found = stress_in(sim, (-1e-3, -1e-3, -1e-3), (0.475e-3, 1e-3, 1e-3))
    whole = stress(sim, 1.475e-3 * 2e-3 * 2e-3)
    np.testing.assert_allclose(found, 0.25 * whole, rtol=1e-9)


@pytest.mark.parametrize("friction", [0.2, 0.4])
def test_spheres_slide_on_a_plane_at_the_angle_of_friction(friction):
    table = {
        "kind": "particles", "duration": 0.5, "output": {"samples": 2e-3},
        "law": {"rolling": "epsd-modified"},
        "material": [
            {"name": "p", "density": 2500, "youngs_modulus": 5e6, "poissons_ratio": 0.3}
        ],
        "contact": [
            {"between": ["p", "p"], "restitution": 0.3, "friction": friction,
             "rolling_friction": 0.8}
        ],
        "wall": [
            {"name": "plate", "kind": "plane", "normal": [0, 0, 1], "starts": 0.05,
             "spin": [0, "60 deg/s", 0]}
        ],
        "particles": [
            {"kind": "pack", "material": "p", "sizes": "mono:4mm", "count": 12,
             "lower": [-0.04, -0.04, 0], "upper": [0.04, 0.04, 0.0082]}
        ],
        "measure": [
            {"name": "slide", "kind": "slip", "wall": "plate", "speed": 0.01, "after": 0.1}
        ],
    }  # fmt: skip
    run = ParticleRun(build(ParticleCase, table, "case.toml"), {}, threads=1)
    for _ in run.go_on():
        pass
    found = results_of(run)["measures"]["slide"]["angle_deg"]
    # The plane turns on while they gain the speed that counts: v = g w t^2 / (2 cos).
    at = math.atan(friction)
    late = math.degrees(1.0) * math.sqrt(2.0 * 0.01 * math.cos(at) * math.radians(60.0) / 9.81)
    assert math.degrees(at) < found < math.degrees(at) + late + 60.0 * 4e-3
    assert run.tally.history[20]["slip on plate [m/s]"] < 1e-3


def test_the_rate_into_an_empty_box():
    rows = [
        {"time [s]": t, "mass in low [kg]": float(np.clip(2.0 * (t - 1.0), 0.0, 4.0))}
        for t in np.arange(0.0, 5.0, 0.05)
    ]
    assert filling_rate(rows, "low") == pytest.approx(2.0)
    assert filling_rate(rows[30:], "low") is None  # there was some before


def test_shear_over_load():
    table = ShearTable(name="s", walls=("a", "b"), load="lid", after=1.0, share=0.5)
    rows = [
        {
            "time [s]": t, "force x on a [N]": -3.0 if t > 2.9 else -4.0,
            "force x on b [N]": -2.0, "force z on lid [N]": 10.0,
        }
        for t in np.arange(0.0, 4.01, 0.1)
    ]  # fmt: skip
    found = shear_result(table, rows)
    assert found["peak"] == pytest.approx(0.6)
    late = 0.5 + 0.1 * 4 / 15  # of the 15 late samples four are before 2.9 s
    assert found["residual"] == pytest.approx(late, abs=0.01)
    assert shear_result(table, rows[:5])["residual"] is None
