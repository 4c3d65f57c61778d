"""Analytic stand-ins for simulations, with their trade-offs, replicate noise and crashes.

They cost nothing, so that a method can be tried on hundreds of studies whose truth is known. They
are no simulations: shapes and sizes of the responses follow what the papers show, the numbers are
made up.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from greybed.calibration.experiment import Experiment, Measure, RunFailed, Value, named

Array = NDArray[np.float64]


class DrawDownTwin(Experiment):
    """A draw-down box with four measures of sliding and rolling friction.

    Angles rise with both frictions and level off; the mass that stays and the mass flow fall with
    them, with other weights, so that the four isolines cross at one point.

    Parameters
    ----------
    name : str
        Of the experiment.
    noise : float
        Scatter of replicates, times 0.8 deg, 0.8 deg, 0.012 kg, 0.02 kg/s [-].
    crashes : float
        Share of runs that fail, whatever the parameters [-].
    """

    measures = named(
        Measure(name="shear_angle", unit="deg", what="slope above the opening"),
        Measure(name="repose_angle", unit="deg", what="slope of the heap below"),
        Measure(name="mass", unit="kg", what="mass in the lower box"),
        Measure(name="mass_flow", unit="kg/s", what="flow through the opening"),
    )
    takes = ("friction", "rolling_friction")

    def __init__(
        self, name: str = "draw-down", *, noise: float = 1.0, crashes: float = 0.0
    ) -> None:
        self.name, self.noise, self.crashes = name, noise, crashes

    def identity(self) -> object:
        """See :meth:`Experiment.identity`."""
        return ["twin of a draw-down box 1", self.noise, self.crashes]

    @staticmethod
    def exact(values: Mapping[str, float]) -> dict[str, float]:
        """Measures without scatter."""
        s, r = values["friction"], values["rolling_friction"]
        heap = (s + 0.1) ** 0.45 * (r + 0.03) ** 0.5
        return {
            "shear_angle": 40.0 + 36.0 * (1.0 - np.exp(-2.4 * s)) + 6.0 * np.tanh(1.3 * r),
            "repose_angle": 13.0 + 34.0 * np.tanh(1.5 * heap),
            "mass": 1.32 - 0.42 * np.tanh(1.1 * s) - 0.30 * r / (0.3 + r),
            "mass_flow": 2.1 - 0.85 * (1.0 - np.exp(-1.9 * s)) - 0.12 * r,
        }

    def run(self, values: Mapping[str, float], seed: int) -> dict[str, Value]:
        """See :meth:`Experiment.run`."""
        rng = np.random.default_rng([seed, 51])
        if rng.random() < self.crashes:
            raise RunFailed("the twin crashed, as it was told to")
        scatter = self.noise * np.array([0.8, 0.8, 0.012, 0.02]) * rng.standard_normal(4)
        exact = self.exact(values)
        return {k: float(v + e) for (k, v), e in zip(exact.items(), scatter, strict=True)}


class HeapTwin(Experiment):
    """One angle of repose: the two frictions trade off along a curve."""

    measures = named(Measure(name="angle", unit="deg", what="angle of repose"))
    takes = ("friction", "rolling_friction")

    def __init__(self, name: str = "heap", *, noise: float = 1.0) -> None:
        self.name, self.noise = name, noise

    def identity(self) -> object:
        """See :meth:`Experiment.identity`."""
        return ["twin of a heap 1", self.noise]

    @staticmethod
    def exact(values: Mapping[str, float]) -> float:
        """Angle without scatter [deg]."""
        s, r = values["friction"], values["rolling_friction"]
        return float(15.0 + 26.0 * np.tanh(1.5 * s**0.6 * (r + 0.05) ** 0.5 * 1.4))

    def run(self, values: Mapping[str, float], seed: int) -> dict[str, Value]:
        """See :meth:`Experiment.run`."""
        scatter = 0.5 * self.noise * np.random.default_rng([seed, 52]).standard_normal()
        return {"angle": self.exact(values) + float(scatter)}


class HopperTwin(Experiment):
    """Discharge of a hopper: sliding friction, and little of the rolling one."""

    measures = named(Measure(name="flow", unit="kg/s", what="mass flow"))
    takes = ("friction", "rolling_friction")

    def __init__(self, name: str = "hopper", *, noise: float = 1.0) -> None:
        self.name, self.noise = name, noise

    def identity(self) -> object:
        """See :meth:`Experiment.identity`."""
        return ["twin of a hopper 1", self.noise]

    def run(self, values: Mapping[str, float], seed: int) -> dict[str, Value]:
        """See :meth:`Experiment.run`."""
        s, r = values["friction"], values["rolling_friction"]
        flow = 0.55 - 0.21 * (1.0 - np.exp(-2.2 * s)) - 0.01 * r
        return {
            "flow": float(
                flow + 0.004 * self.noise * np.random.default_rng([seed, 53]).standard_normal()
            )
        }


BEANS = (
    "static_friction", "dynamic_friction", "wall_static_friction", "wall_dynamic_friction",
    "restitution", "wall_restitution", "rolling_friction",
)  # fmt: skip


class DropTwin(Experiment):
    """A portion that falls through a tube, seen as time signals; seven parameters.

    The portion's centre falls with gravity less the walls' friction, its length grows with the
    speed of its parts against each other; visible area, front and tail follow. Which parameter
    moves which signal how much is of the order of the correlations in the paper's table 5.

    Parameters
    ----------
    name : str
        Of the experiment.
    noise : float
        Scatter of replicates, in units of the default [-].
    """

    measures = named(
        Measure(name="area", kind="signal", what="visible area, of the frame"),
        Measure(name="centre", unit="m", kind="signal", what="centre of mass below the gate"),
        Measure(name="front", unit="m", kind="signal", what="front below the gate"),
        Measure(name="tail", unit="m", kind="signal", what="tail below the gate"),
        Measure(name="residence", unit="s", what="time between first and last particle"),
    )
    takes = BEANS
    times = np.linspace(0.05, 0.61, 29)  # [s]

    def __init__(self, name: str = "drop", *, noise: float = 1.0) -> None:
        self.name, self.noise = name, noise

    def identity(self) -> object:
        """See :meth:`Experiment.identity`."""
        return ["twin of a drop test 1", self.noise]

    def curves(self, values: Mapping[str, float], draws: Array | None = None) -> dict[str, Array]:
        """Signals; ``draws`` are the four accidents of a replicate."""
        s, d, ws, wd, e, we, rr = (values[name] for name in BEANS)
        a = np.zeros(4) if draws is None else 0.01 * self.noise * draws
        t = self.times
        brake = 0.10 + 0.75 * wd + 0.18 * ws * wd + 0.06 * rr + 0.03 * (1.0 - we) + a[0]
        inner = 0.16 + 0.62 * d / (0.35 + d) + 0.16 * s * d + 0.12 * rr - 0.10 * e * (1.0 - d)
        stretch = 0.45 - 0.32 * inner + 0.25 * wd + a[1]
        fall = 9.81 * (1.0 - 0.55 * brake) * 0.5 * t**2
        length = 0.06 + stretch * t * (0.4 + t) * 2.2
        front = fall * (1.0 + 0.08 * (1.0 - inner)) + 0.30 * length + 0.03 * a[2]
        tail = fall * (1.0 - 0.32 * brake) - 0.55 * length * (0.5 + 0.9 * wd) + 0.03 * a[3]
        spread = length * (0.7 + 0.5 * (1.0 - inner) + 0.15 * e * (1.0 - wd))
        visible = np.clip(1.4 - fall, 0.0, None) / 1.4
        return {
            "area": np.asarray(spread / (0.12 + spread) * (0.35 + 0.65 * visible)),
            "centre": np.asarray(0.55 * front + 0.45 * tail * (0.7 + 0.6 * inner)),
            "front": np.asarray(front),
            "tail": np.asarray(tail),
        }

    def run(self, values: Mapping[str, float], seed: int) -> dict[str, Value]:
        """See :meth:`Experiment.run`."""
        draws = np.random.default_rng([seed, 54]).standard_normal(5)
        curves = self.curves(values, draws[:4])
        results: dict[str, Value] = {
            name: [self.times.tolist(), curve.tolist()] for name, curve in curves.items()
        }
        results["residence"] = residence_time(values) + 0.004 * self.noise * float(draws[4])
        return results


def residence_time(values: Mapping[str, float]) -> float:
    """The process of the drop twin: time between its first and last particle [s]."""
    s, d, ws, wd, e, we, rr = (values[name] for name in BEANS)
    slow = 0.42 * wd + 0.16 * d + 0.08 * ws * (0.4 + wd) + 0.07 * rr + 0.03 * s * d + 0.004 * we
    return float(0.09 + 0.30 * slow + 0.22 * slow**2 - 0.0 * e)


class FunnelTwin(Experiment):
    """Discharge of a funnel by the drop twin's particles: most of all their dynamic friction."""

    measures = named(Measure(name="time", unit="s", what="time of discharge"))
    takes = BEANS

    def __init__(self, name: str = "funnel", *, noise: float = 1.0) -> None:
        self.name, self.noise = name, noise

    def identity(self) -> object:
        """See :meth:`Experiment.identity`."""
        return ["twin of a funnel 1", self.noise]

    def run(self, values: Mapping[str, float], seed: int) -> dict[str, Value]:
        """See :meth:`Experiment.run`."""
        s, d, ws, wd, _, _, rr = (values[name] for name in BEANS)
        time = 2.2 + 1.9 * d / (0.6 + d) * 1.6 + 0.7 * wd + 0.45 * s * d + 0.2 * ws + 0.5 * rr
        scatter = np.random.default_rng([seed, 55]).standard_normal()
        return {"time": float(time + 0.03 * self.noise * scatter)}


class DrumTwin(Experiment):
    """A slow drum: energies and period of avalanches; three of six parameters are active."""

    measures = named(
        Measure(name="break_energy", unit="mJ/kg", what="potential energy before avalanches"),
        Measure(name="rest_energy", unit="mJ/kg", what="potential energy after avalanches"),
        Measure(name="avalanche_energy", unit="mJ/kg", what="their difference"),
        Measure(name="period", unit="s", what="time between avalanches"),
    )
    takes = (
        "friction", "rolling_friction", "cohesion",
        "wall_friction", "wall_rolling_friction", "wall_cohesion",
    )  # fmt: skip

    def __init__(self, name: str = "drum", *, noise: float = 1.0) -> None:
        self.name, self.noise = name, noise

    def identity(self) -> object:
        """See :meth:`Experiment.identity`."""
        return ["twin of a drum 1", self.noise]

    @staticmethod
    def exact(values: Mapping[str, float]) -> dict[str, float]:
        """Measures without scatter; surface energies in mJ/m2."""
        f, r, c = (values[k] for k in ("friction", "rolling_friction", "cohesion"))
        w = values["wall_friction"]
        steep = 14.0 * f + 60.0 * r + 24.0 * c + 30.0 * f * c + 0.6 * w
        fall = 1.1 + 13.0 * c + 2.4 * f + 25.0 * c**2 - 4.0 * r
        return {
            "break_energy": 42.0 + steep,
            "rest_energy": 42.0 + steep - fall,
            "avalanche_energy": fall,
            "period": 0.35 + 0.10 * fall + 0.5 * c - 0.6 * f * c,
        }

    def run(self, values: Mapping[str, float], seed: int) -> dict[str, Value]:
        """See :meth:`Experiment.run`."""
        draws = np.random.default_rng([seed, 56]).standard_normal(3)
        exact = self.exact(values)
        high = exact["break_energy"] + 0.25 * self.noise * draws[0]
        fall = exact["avalanche_energy"] + 0.12 * self.noise * draws[1]
        period = exact["period"] + 0.012 * self.noise * draws[2]
        return {
            "break_energy": float(high), "rest_energy": float(high - fall),
            "avalanche_energy": float(fall), "period": float(period),
        }  # fmt: skip
