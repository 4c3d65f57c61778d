r"""Where a filter can change drag at all: a fixed function, exactly 0 in three limits.

.. math:: G = \frac{D^2}{D^2 + a^2}\;\frac{\phi}{\phi + \phi_0}\;
          \max\bigl(0,\,1 - (\phi/\phi_m)^n\bigr)^2

D is the filter size over L_c. A filter of size 0 sees the flow as it is; its first effect is of
order D^2, for a filter is even. One particle has no neighbours to hide among, and particles that
are packed cannot cluster. The last power is 2 so that the slope is 0 where the packing is reached.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError

Array = NDArray[np.float64]
MOST_POWER = 100  # of a file that may hold any; it is a number of multiplications


@dataclass(frozen=True)
class Gate:
    """Numbers of the gate.

    Attributes
    ----------
    filter_scale : float
        a: filter size over L_c at which half is open [-].
    dilute_scale : float
        phi_0: solid fraction at which half is open [-].
    packing : float
        phi_m: solid fraction from which on it is shut [-].
    power : int
        n [-].
    """

    filter_scale: float = 1.0
    dilute_scale: float = 0.01
    packing: float = 0.63
    power: int = 8

    def __post_init__(self) -> None:
        scales = (self.filter_scale, self.dilute_scale, self.packing)
        if not (all(np.isfinite(s) and s > 0.0 for s in scales) and self.packing <= 1.0):
            raise InputError(
                f"gate: scales {scales} [-] must be above 0 and the packing at most 1; mend them."
            )

    def __call__(self, solid_fraction: Array, filter_size: Array) -> Array:
        """G [-], 0 to 1, of solid fractions and filter sizes over L_c."""
        square = filter_size * filter_size
        size = square / (square + self.filter_scale * self.filter_scale)
        dilute = solid_fraction / (solid_fraction + self.dilute_scale)
        ratio = solid_fraction / self.packing
        # Products instead of a power: the same bits in every exported language.
        dense = np.maximum(0.0, 1.0 - power_of(ratio, self.power))
        return size * dilute * (dense * dense)

    def arrays(self) -> dict[str, NDArray]:
        """Arrays to store, by name."""
        numbers = [self.filter_scale, self.dilute_scale, self.packing, float(self.power)]
        return {"gate": np.array(numbers)}

    @classmethod
    def from_arrays(cls, arrays: dict[str, NDArray]) -> Gate:
        """Rebuild from :meth:`arrays`."""
        a, dilute, packing, power = arrays["gate"].tolist()
        if not 1 <= power <= MOST_POWER:
            raise ValueError(f"gate: its power is {power:g}")
        return cls(a, dilute, packing, int(power))


def power_of(x: Array, n: int) -> Array:
    """x^n by repeated multiplication, n at least 1."""
    result = x
    for _ in range(n - 1):
        result = result * x
    return result
