"""What surrogates are fitted to: scalars as they are, curves by the few shapes that runs show.

A curve is taken relative to the measured one, in units of its error. The runs' deviations from
their mean are spanned by few directions (principal components); along each of these a curve is a
scalar with a surrogate, and the measured curve has the value 0 there, with the covariance of its
errors. What of the measured curve no direction reaches is kept as a misfit that no parameter set
repairs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from greybed.calibration.experiment import Value
from greybed.calibration.study import Target

Array = NDArray[np.float64]

# Share of the runs' deviations that the directions of a curve must span, and their number at most.
SPANNED = 0.995
MOST_SHAPES = 6


@dataclass(frozen=True, kw_only=True)
class Response:
    """A measure as numbers that surrogates are fitted to.

    Attributes
    ----------
    experiment, measure : str
        Whose.
    value : ndarray (k,)
        Measured; zeros for a curve, NaN where nothing is measured.
    covariance : ndarray (k, k)
        Of the measurement.
    single : bool
        Whether the scatter of a single test comes on top.
    at, curve, sd : ndarray (m,) or None
        Places, measured values and errors of a curve.
    shapes : ndarray (k, m) or None
        Directions of a curve, in units of its errors.
    outside : float
        Chi-squared of the measured curve outside the directions [-].
    outside_freedom : int
        Its degrees of freedom [-].
    """

    experiment: str
    measure: str
    value: Array
    covariance: Array
    single: bool = False
    at: Array | None = None
    curve: Array | None = None
    sd: Array | None = None
    shapes: Array | None = None
    outside: float = 0.0
    outside_freedom: int = 0
    names: tuple[str, ...] = field(default=())

    @property
    def label(self) -> str:
        """Experiment and measure."""
        return f"{self.experiment}.{self.measure}"

    def numbers(self, value: Value) -> Array:
        """A result of a run as (k,) numbers."""
        if self.shapes is None:
            return np.array([float(value)])  # type: ignore[arg-type]
        return self.shapes @ self.whitened(value)

    def whitened(self, value: Value) -> Array:
        """A curve of a run relative to the measured one, in units of its errors, (m,)."""
        assert self.at is not None
        assert self.curve is not None
        assert self.sd is not None
        return (on_places(value, self.at) - self.curve) / self.sd

    def rmse(self, value: Value) -> float:
        """Root of the mean squared distance of a run's curve from the measured one."""
        assert self.sd is not None
        return float(np.sqrt(np.mean((self.whitened(value) * self.sd) ** 2)))


def on_places(value: Value, at: Array) -> Array:
    """A curve of a run at the places of the measured one (m,), by straight lines."""
    places, heights = np.asarray(value, float)
    return np.asarray(np.interp(at, places, heights))


def response_of(target: Target, results: Sequence[Value]) -> Response:
    """The response of a measured target; ``results`` are what runs gave so far."""
    if target.at is None:
        return Response(
            experiment=target.experiment, measure=target.measure, value=target.value,
            covariance=target.covariance, single=target.single, names=(target.measure,),
        )  # fmt: skip
    m = len(target.at)
    white = target.covariance / np.outer(target.sd, target.sd)
    curves = np.array([(on_places(v, target.at) - target.value) / target.sd for v in results])
    centre = curves.mean(axis=0)
    _, size, rows = np.linalg.svd(curves - centre, full_matrices=False)
    power = np.cumsum(size**2) / max(float((size**2).sum()), 1e-300)
    k = min(int(np.searchsorted(power, SPANNED)) + 1, MOST_SHAPES, len(rows))
    shapes = rows[:k]
    # The same signs whatever the library of linear algebra.
    shapes = shapes * np.sign(shapes[np.arange(k), np.abs(shapes).argmax(axis=1)])[:, None]
    left = np.eye(m) - shapes.T @ shapes
    rest = left @ centre
    outside = float(rest @ np.linalg.pinv(left @ white @ left, rcond=1e-8, hermitian=True) @ rest)
    return Response(
        experiment=target.experiment, measure=target.measure, value=np.zeros(k),
        covariance=shapes @ white @ shapes.T, single=target.single,
        at=target.at, curve=target.value, sd=target.sd, shapes=shapes,
        outside=outside, outside_freedom=m - k,
        names=tuple(f"{target.measure} shape {i + 1}" for i in range(k)),
    )  # fmt: skip


def unmeasured(experiment: str, measure: str, error: float) -> Response:
    """A scalar without data, which would have this error."""
    return Response(
        experiment=experiment, measure=measure, value=np.array([np.nan]),
        covariance=np.array([[error**2]]), names=(measure,),
    )  # fmt: skip
