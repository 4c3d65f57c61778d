"""Settled beds of both engines over seeds: as alike as beds of one engine.

Skipped where no ``liggghts`` is installed (Debian: apt-get install liggghts). The larger run is
recorded in examples/verification/results by the same script.
"""

import importlib.util
import shutil
from pathlib import Path

import pytest

SCRIPT = Path(__file__).parents[2] / "examples" / "verification" / "settled_beds.py"
SEEDS = (1, 2, 3, 4, 5)


@pytest.mark.skipif(
    shutil.which("liggghts") is None, reason="liggghts is not installed (apt-get install liggghts)"
)
def test_height_coordination_and_decay_agree_within_the_spread_over_seeds():
    spec = importlib.util.spec_from_file_location("settled_beds", SCRIPT)
    beds = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(beds)
    found = {
        engine: [beds.figures(beds.settle(500, seed, 0.3, engine)) for seed in SEEDS]
        for engine in beds.ENGINES
    }
    for name, row in beds.compared(found).items():
        # Student's t of eight degrees of freedom passes 3.36 in one of a hundred comparisons.
        assert abs(row["difference_over_error"]) < 3.36, (name, row)
    # The spread is small enough to see a difference: 2 % of the height, 3 % of the contacts.
    row = beds.compared(found)
    for engine in beds.ENGINES:
        assert row["height_m"][f"{engine}_sd"] < 0.02 * row["height_m"][engine]
        assert row["coordination"][f"{engine}_sd"] < 0.03 * row["coordination"][engine]
        assert row["energy_gone_s"][f"{engine}_sd"] < 0.15 * row["energy_gone_s"][engine]
