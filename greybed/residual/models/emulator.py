"""A quadratic emulator of one output about the base case, exact at the base."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from greybed.residual.effect import Effect

Array = NDArray[np.float64]
Point = tuple[dict[str, float], dict[str, float]]

SHARES = (0.25, 0.5, 1.0, 1.5, 2.0)  # of the typical amplitude at which an effect is run
TESTS = (0.75, 1.25)  # and where the emulator is tested


@dataclass(frozen=True)
class Knob:
    """A parameter of the case: where it stands and how far it is moved."""

    name: str
    value: float
    step: float


class Emulator:
    """Output at one condition as a function of parameters and amplitudes.

    Parameters
    ----------
    knobs : list of Knob
        Parameters.
    effects : list of Effect
        Switches.
    run : callable (parameters, amplitudes) -> float
        The case.

    Attributes
    ----------
    base : float
        Output without any effect, parameters at their centre.
    error : float
        Root mean square error at runs that the fit did not see.
    """

    def __init__(
        self,
        knobs: list[Knob],
        effects: list[Effect],
        run: Callable[[Mapping[str, float], Mapping[str, float]], float],
    ) -> None:
        self._knobs, self._effects = knobs, effects
        points = self._design()
        self.base = run(self.centre(), {})
        outputs = np.array([run(*self._settings(point)) for point in points])
        matrix = np.array([self._features(point) for point in points])
        # columns of very different size would make the least squares lose digits
        scale = np.maximum(np.abs(matrix).max(axis=0), 1e-300) if len(matrix) else np.ones(0)
        solved = np.linalg.lstsq(matrix / scale, outputs - self.base, rcond=None)[0]
        self._weights = solved / scale
        misses = [run(*self._settings(point)) - self._at(point) for point in self._tests()]
        self.error = float(np.sqrt(np.mean(np.square(misses)))) if misses else 0.0

    def centre(self) -> dict[str, float]:
        """Parameters at their centre."""
        return {knob.name: knob.value for knob in self._knobs}

    def _settings(self, point: Point) -> tuple[dict[str, float], dict[str, float]]:
        knobs, effects = point
        moved = {k.name: k.value + knobs.get(k.name, 0.0) * k.step for k in self._knobs}
        typical = {
            e.name: share * e.typical
            for e in self._effects
            if (share := effects.get(e.name, 0.0)) != 0.0
        }
        return moved, typical

    def _design(self) -> list[Point]:
        points: list[Point] = []
        for effect in self._effects:
            points += [({}, {effect.name: share}) for share in SHARES]
        for first, second in combinations(self._effects, 2):
            for share in (0.5, 1.0, 2.0):
                points.append(({}, {first.name: share, second.name: 1.0}))
                points.append(({}, {first.name: 1.0, second.name: share}))
        for knob in self._knobs:
            points += [({knob.name: side}, {}) for side in (-1.0, 1.0)]
            points += [({knob.name: 1.0}, {e.name: 1.0}) for e in self._effects]
            points += [({knob.name: -1.0}, {e.name: 2.0}) for e in self._effects]
        return points

    def _tests(self) -> list[Point]:
        return [({}, {e.name: share}) for e in self._effects for share in TESTS]

    def _features(self, point: Point) -> list[float]:
        """Polynomial without a constant: cubic in each effect, quadratic in the rest."""
        knobs, effects = point
        t = [knobs.get(knob.name, 0.0) for knob in self._knobs]
        a = [effects.get(effect.name, 0.0) for effect in self._effects]
        found = [*a, *(x**2 for x in a), *(x**3 for x in a), *t, *(x**2 for x in t)]
        for x, y in combinations(a, 2):
            found += [x * y, x**2 * y, x * y**2]
        found += [x * y for x in t for y in a]
        found += [x * y for x, y in combinations(t, 2)]
        return found

    def _at(self, point: Point) -> float:
        return self.base + float(np.dot(self._features(point), self._weights))

    def value(self, parameters: Mapping[str, float], amplitudes: Mapping[str, float]) -> float:
        """Output between the runs; the base exactly where nothing differs from it.

        Amplitudes beyond those of the runs count as the last one: a cubic through scattered runs
        would go anywhere there, and explain anything.
        """
        knobs = {
            k.name: (parameters[k.name] - k.value) / k.step
            for k in self._knobs
            if k.name in parameters
        }
        effects = {
            e.name: min(amplitudes.get(e.name, 0.0) / e.typical, SHARES[-1]) for e in self._effects
        }
        return self._at((knobs, effects))
