"""Effects between particles: closed forms for a ``python`` model, and what only cases switch.

``CLOSED`` holds the effects that have a closed form; the three in ``NEEDS_ENGINE`` have none and
need a case that resolves contacts.
"""

from __future__ import annotations

import numpy as np

from greybed.residual.effect import Array, Columns, Effect


def _impact(c: Columns, amplitude: float) -> Array:
    return 1.0 / (1.0 + amplitude * c["impact_velocity"] ** 0.2)


def _janssen(c: Columns, amplitude: float) -> Array:
    depth = 4.0 * amplitude * c["fill_height"] / c["silo_diameter"]
    return -np.expm1(-depth) / depth


CLOSED = (
    Effect(
        name="velocity-dependent-restitution",
        law="restitution / (1 + A v^(1/5)), A in (s/m)^(1/5)",
        source="viscoelastic spheres lose C v^(1/5) at first order (Ramirez et al., Phys. Rev. E "
        "60 (1999) 4465); the quotient keeps it between 0 and 1",
        group="impact velocity over that of dissipation",
        theory=None,
        low=0.005,
        high=5.0,
        columns=("impact_velocity",),
        stage="factor",
        change=_impact,
    ),
    Effect(
        name="wall-friction",
        law="pressure * (1 - exp(-x)) / x, x = 4 A z / D, A = wall friction * stress ratio",
        source="Janssen (1895)",
        group="friction * fill height / silo diameter",
        theory=None,
        low=0.005,
        high=1.0,
        columns=("fill_height", "silo_diameter"),
        stage="factor",
        change=_janssen,
    ),
)
NEEDS_ENGINE = {
    "rolling-resistance": "raises the angle of repose and hardly touches fast flow",
    "cohesion": "goes with d^-2 (Bond number); stops small openings altogether",
    "particle-shape": "shifts solid fraction and discharge together",
}
