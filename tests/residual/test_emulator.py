"""The emulator of a case: exact at the base, right between runs, flat beyond them."""

from __future__ import annotations

import numpy as np
import pytest

from greybed.residual.effect import Effect
from greybed.residual.models.emulator import Emulator, Knob


def effect(name):
    return Effect(
        name=name, law="", source="", group="", theory=None, low=0.1, high=10.0, stage="outcome",
        change=lambda columns, amplitude: np.ones(1),
    )  # fmt: skip


def test_an_emulator_follows_the_runs_and_invents_nothing_beyond_them():
    rng = np.random.default_rng(3)

    def run(knobs, effects):
        first, second = effects.get("first", 0.0), effects.get("second", 0.0)
        value = 5.0 + 0.3 * knobs["k"] + 2.0 * first - 0.3 * first**2 + 0.0 * second
        return value if not effects else value + 0.05 * rng.normal()

    made = Emulator([Knob("k", 1.0, 0.1)], [effect("first"), effect("second")], run)
    assert made.base == run({"k": 1.0}, {})
    assert made.value({}, {}) == made.base
    assert made.value({"k": 1.05}, {"first": 1.2}) == pytest.approx(5.315 + 2.4 - 0.432, abs=0.1)
    assert 0.02 < made.error < 0.15
    most = made.value({}, {"second": 2.0})
    assert most == pytest.approx(made.base, abs=0.3)
    assert made.value({}, {"second": 10.0}) == most
