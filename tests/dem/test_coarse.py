"""Coarse graining: collisions and whole cases are the same in units of the radius."""

from __future__ import annotations

import numpy as np
import pytest

from greybed.core import InputError
from greybed.core.config import build
from greybed.core.sizes import parse_sizes
from greybed.dem import Contact, ContactLaw, Material, Simulation
from greybed.dem.case import ParticleCase
from greybed.dem.coarse import coarse_case, coarse_grained, coarse_sizes
from greybed.dem.runner import ParticleRun

R, SPEED = 1e-3, 0.4
STUFF = Material(2500.0, 5e6, 0.3)


def flight(law, contact, factor):
    """Two spheres that meet obliquely: places over the radius, velocities, time over radius."""
    law = ContactLaw(**law)
    r = factor * R
    sim = Simulation(
        np.array([[0, 0, 0], [1.7, 0.2, 1.1]]) * r, r, STUFF,
        coarse_grained(contact, law, factor), law=law, gravity=(0, 0, 0), time_step=2e-6 * factor,
        velocities=[[SPEED, 0, 0], [0, 0, -SPEED]], skin=2.0 * r,
    )  # fmt: skip
    rows = []
    for _ in range(30):
        sim.run(40)
        rows.append(np.concatenate([sim.centres / r, sim.velocities, sim.spins * r], axis=1))
    return np.array(rows)


@pytest.mark.parametrize(
    ("law", "numbers"),
    [
        ({"rolling": "epsd"}, {"rolling_friction": 0.2, "rolling_damping": 0.3}),
        ({"normal": "linear", "rolling": "constant-torque"}, {"stiffness": 2e3}),
        ({"normal": "hysteresis"}, {"stiffness": 2e3}),
        (
            {"normal": "viscoelastic", "rolling": "viscous"},
            {"reference_speed": 0.3, "reference_radius": 2e-3, "rolling_time": 1e-4},
        ),
        ({"cohesion": "sjkr"}, {"cohesion": 3e4}),
        ({"cohesion": "dmt"}, {"cohesion": 0.4}),
        ({"cohesion": "jkr"}, {"cohesion": 0.4}),
        ({"cohesion": "van-der-waals"}, {"cohesion": 5e-13, "nearest": 1e-6, "reach": 3e-5}),
        (
            {"cohesion": "liquid-bridge"},
            {"cohesion": 0.5, "bridge_volume": 1e-11, "contact_angle": 0.3},
        ),
    ],
)  # fmt: skip
def test_a_collision_is_the_same_in_units_of_the_radius(law, numbers):
    contact = Contact(0.6, 0.4, **numbers)
    small, large = flight(law, contact, 1.0), flight(law, contact, 2.0)
    np.testing.assert_allclose(large, small, rtol=1e-9, atol=1e-9 * SPEED)
    # They did meet, and it is the number that does it: without the rule it is another collision.
    assert abs(small[-1, 0, 3] - SPEED) > 0.1 * SPEED
    if "cohesion" in law or law.get("normal", "hertz") != "hertz":
        wrong = Contact(0.6, 0.4, **{k: 1.5 * v for k, v in numbers.items()})
        assert np.abs(flight(law, wrong, 1.0) - small).max() > 1e-4 * SPEED


def case(scale, **more):
    """A small heap under a lid; all lengths of the apparatus times ``scale``."""

    def at(*place):
        return [scale * 1e-3 * x for x in place]

    table = {
        "kind": "particles", "duration": 2e-3 * scale, "gravity": [0, 0, -100.0 / scale],
        "seed": 2, "output": {"samples": 1e-3 * scale}, "look": 1e-4 * scale,
        "law": {"cohesion": "dmt", "rolling": "epsd-modified"},
        "material": [
            {"name": "p", "density": 2500, "youngs_modulus": 5e6, "poissons_ratio": 0.3}
        ],
        "contact": [
            {"between": ["p", "p"], "restitution": 0.4, "friction": 0.5, "cohesion": 0.2,
             "rolling_friction": 0.2}
        ],
        "wall": [
            {"name": "side", "kind": "cylinder", "radius": scale * 5e-3},
            {"name": "floor", "kind": "plane", "normal": [0, 0, 1]},
            {"name": "lid", "kind": "plane", "point": at(0, 0, 10), "normal": [0, 0, -1],
             "velocity": [0, 0, -1.5]},
        ],
        "particles": [
            {"kind": "pack", "material": "p", "sizes": "uniform:0.9mm,1.1mm", "round": True,
             "count": round(40 * scale**3), "lower": at(-5, -5, 0), "upper": at(5, 5, 10)}
        ],
        **more,
    }  # fmt: skip
    return build(ParticleCase, table, "case.toml")


def test_a_case_of_twice_the_size_with_coarse_particles_is_the_same_case():
    runs = [ParticleRun(c, {}, threads=1) for c in (case(1.0), case(2.0, coarse_graining=2.0))]
    for run in runs:
        for _ in run.go_on():
            pass
    small, large = (run.simulation for run in runs)
    assert runs[0].steps == runs[1].steps
    np.testing.assert_allclose(large.centres / 2.0, small.centres, atol=1e-9)
    # The same stress: forces grow by the area.
    force = small.wall_forces
    assert np.abs(force).max() > 1e-3
    np.testing.assert_allclose(large.wall_forces / 4.0, force, rtol=1e-4, atol=1e-6)


def test_counts_masses_and_sizes_of_a_coarse_case():
    coarse = coarse_case(case(2.0, coarse_graining=2.0))
    assert coarse.particles[0].count == 40
    assert coarse.coarse_graining == 1.0
    assert coarse.contact[0].cohesion == pytest.approx(0.4)
    assert coarse.contact[0].friction == 0.5
    same = case(1.0)
    assert coarse_case(same) is same
    for text in (
        "mono:2mm", "uniform:1mm,2mm", "lognormal:2mm,1.2", "rosin-rammler:2mm,3",
        "quantiles:D10=2mm,D50=3mm,D90=4mm",
        "discrete:1mm=0.3,2mm=0.7",
    ):  # fmt: skip
        np.testing.assert_allclose(
            parse_sizes(coarse_sizes(text, 3.0)).radii(50), 3.0 * parse_sizes(text).radii(50)
        )


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ({"coarse_graining": 0.5}, "coarse_graining = 0.5"),
        ({"coarse_graining": 9.0}, "leaves none of 40 particles"),
        (
            {
                "coarse_graining": 2.0,
                "particles": [{"kind": "file", "material": "p", "file": "bed.csv"}],
            },
            "cannot enlarge particles of a file",
        ),
    ],
)
def test_refusals(more, says):
    with pytest.raises(InputError, match=says):
        coarse_case(case(1.0, **more))
    with pytest.raises(InputError, match=r"factor = 0.5 \[-\] must be"):
        coarse_grained(Contact(0.5, 0.3), ContactLaw(), 0.5)
