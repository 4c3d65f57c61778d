"""What the source papers find, on the engine, in boxes of a few hundred grains.

Larger runs with their numbers are in examples/papers.
"""

from pathlib import Path

import numpy as np
import pytest

from greybed.calibration.experiments import LIBRARY
from greybed.core.config import build
from greybed.dem.case import ParticleCase

# Table 1 of paper 000.
RECYCLATE = {
    "radius": 4e-3, "spread": 0.0, "density": 3400.0, "youngs_modulus": 1e8, "poissons_ratio": 0.3,
    "restitution": 0.3, "friction": 0.71, "wall_friction": 0.41, "rolling_friction": 0.8,
    "cohesion_law": "sjkr", "limit_force": True, "time_step": 5e-5,
}  # fmt: skip


def draw_down(shape, count, cohesion):
    """A flap of 70 mm in a slice of 345 mm: nine diameters of spheres, two of tetrapods."""
    d = LIBRARY["draw-down-box"](name="box", shape=shape, radius=4e-3).d
    box = LIBRARY["draw-down-box"](
        name="box", shape=shape, count=count, cohesion=cohesion, repeats=True, width=0.345 / d,
        depth=0.041 / d, opening=0.07 / d, fall=0.1 / d, lasts=0.35, **RECYCLATE,
    )  # fmt: skip
    return box.run({}, 1)


def test_paper_000_tetrapods_arch_where_stickier_spheres_do_not():
    tetrapods = draw_down("tetrapod", 180, 3.1e5)
    assert tetrapods["arch"] == 1.0
    assert tetrapods["mass_share"] < 0.1  # what it fell from the arch
    spheres = draw_down("sphere", 800, 4e5)
    assert spheres["arch"] == 0.0
    # All that stands over the opening comes down, and more of it from the sides.
    assert spheres["over_share"] == 0.0
    assert spheres["mass_share"] > 0.07 / 0.345


def test_paper_000_walls_hide_conductivity():
    box = LIBRARY["heated-box"](
        name="box", count=100, width=4.0, stress_ratio=1e-3, conductivity=4.0, cohesion=3.1e5,
        **RECYCLATE | {"time_step": 2e-5},
    )  # fmt: skip
    found = box.run({}, 1)
    # The resistance between bed and walls counts as the bed's where walls tell the gradient.
    assert 0.0 < found["wall_conductivity"] < 0.97 * found["conductivity"]
    assert found["conductivity"] < 0.5 * 4.0


def test_paper_003_heaps_are_higher_with_more_friction():
    """From the first to the last pair of its grid; angles of so small heaps scatter too much."""
    heights = []
    for friction, rolling in ((0.5, 0.07), (0.9, 0.21)):
        heap = LIBRARY["lifting-cylinder"](
            name="heap", count=200, wall_friction=0.7, wall_rolling_friction=0.14,
            rolling_law="constant-torque", time_step=6e-5, speed=0.08,
        )  # fmt: skip
        values = {"friction": friction, "rolling_friction": rolling}
        heights.append(heap.run(values, 1)["height"])
    assert heights[1] > 1.1 * heights[0]


@pytest.mark.parametrize(
    ("shape", "volume"),
    [
        ("sphere", 4.0 / 3.0 * np.pi),
        ("tetrapod", 16.0 / 3.0 * np.pi),
        ("spherocylinder", 4.0 / 3.0 * np.pi + np.pi * 2.0 * (1.9 - 1.0)),
    ],
)
def test_shapes_go_into_boxes_and_tubes(shape, volume):
    """Mass of the grains, and vessels that grow with them."""
    for kind in ("draw-down-box", "drop", "hopper"):
        test = LIBRARY[kind](name=kind, shape=shape, radius=2e-3, length=1.9)
        assert test.solid == pytest.approx(volume * 8e-9)
        case = build(ParticleCase, test.case({}) | {"seed": 1}, Path("study"))
        if shape == "sphere":
            assert not case.shape
            continue
        clump = case.shape[0].clump()
        assert clump.volume == pytest.approx(test.solid, rel=1e-9)
        assert 2.0 * clump.reach == pytest.approx(test.d, rel=1e-9)
        assert case.particles[0].shape == "grain"
