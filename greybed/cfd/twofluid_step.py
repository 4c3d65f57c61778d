"""One step of the two-fluid equations: what happens between two times."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from greybed.cfd import _kinetic, _twofluid
from greybed.cfd.grid import AXES
from greybed.cfd.kinetic import Granular
from greybed.cfd.poisson import Poisson
from greybed.cfd.rims import Inflow, Outlet, Rims, Wall
from greybed.core.errors import GreybedError, InputError

Array = NDArray[np.float64]

# Solid fraction below which a face keeps its velocity.
TINY = 1e-10


class StepError(GreybedError, RuntimeError):
    """A time step that cannot be made; the message says why."""


@dataclass
class State:
    """Everything that a step starts from: flat padded arrays."""

    phi: Array
    us: list[Array]
    ug: list[Array]
    volume: list[Array]
    p: Array
    p_before: Array
    time: float = 0.0
    steps: int = 0
    dt: float = 0.0


def not_finite(state: State, rims: Rims) -> str:
    """The first number of a state that is none, and its place, for a message; or nothing."""
    parts: list[tuple[str, Array, int | None]] = [
        ("solid fraction", state.phi, None), ("pressure", state.p, None),
    ]  # fmt: skip
    for name, flat in (("solids velocity", state.us), ("gas velocity", state.ug)):
        parts += [(f"{name} along {AXES[a]}", flat[a], a) for a in rims.axes]
    for name, flat_one, face in parts:
        good = np.isfinite(rims.inside(flat_one, face))
        if not good.all():
            z, y, x = np.unravel_index(int(np.argmin(good)), good.shape)
            what = "cell" if face is None else "face"
            return f" The {name} at {what} ({x}, {y}, {z}) is not finite."
    return ""


@dataclass(frozen=True)
class Fluids:
    """Numbers of both phases, SI."""

    density: float
    diameter: float
    gas_density: float
    viscosity: float
    gravity: tuple[float, float, float]
    granular: Granular


@dataclass
class DragCell:
    """What a correction of the drag sees, in the cells of the grid [z, y, x].

    Attributes
    ----------
    solid_fraction : ndarray
    slip : list of three ndarrays
        Gas less solids velocity along x, y, z [m s-1].
    speed : ndarray
        Its magnitude [m s-1].
    pressure_gradient : list of three ndarrays
        With its mean in a periodic box [Pa m-1].
    size : float
        Cube root of the volume of a cell, or the square root of its area [m].
    """

    solid_fraction: Array
    slip: list[Array]
    speed: Array
    pressure_gradient: list[Array]
    size: float


Drag = Callable[[Array, Array], Array]
# One with a method ``linearised(DragCell)`` gives drag over phi and eps as three coefficients times
# the new slip and three pushes instead, law included.
Correction = Callable[[DragCell], Array | Sequence[Array]]


@dataclass
class Report:
    """What a step has met."""

    iterations: int = 0
    sweeps: int = 0
    limited: int = 0
    pressure_error: float = 0.0
    times: dict[str, float] = field(default_factory=dict)


class Stepper:
    """Scratch arrays and the parts of a step."""

    def __init__(
        self, rims: Rims, fluids: Fluids, drag: Drag, correction: Correction | None,
        tolerance: float,
    ) -> None:  # fmt: skip
        self.rims, self.fluids, self.drag, self.correction = rims, fluids, drag, correction
        self.tolerance = tolerance
        self.axes = rims.axes
        self.h = rims.grid.spacing
        self.mean_gradient = (0.0, 0.0, 0.0)
        self.pairs = [(a, b) for a in self.axes for b in self.axes if a < b]
        self.solver: Poisson | None = None
        self.report = Report()
        # Drag that does not vanish with the slip, over phi and eps [N m-3]: see linearised.
        self.pushes: list[Array] | None = None
        self._scratch: dict[str, Array] = {}
        wide = [self.h[a] for a in self.axes]
        self.size = math.prod(wide) ** (1.0 / len(wide))
        self._closed = all(not isinstance(s, Inflow | Outlet) for s in rims.sides.values())
        self._rough = [k for k, s in rims.sides.items() if isinstance(s, Wall) and s.specularity]

    def array(self, name: str) -> Array:
        """A scratch array of that name."""
        if name not in self._scratch:
            self._scratch[name] = self.rims.zeros()
        return self._scratch[name]

    # -- rims ---------------------------------------------------------------------------------

    def slips(self, phi: Array) -> dict[tuple[int, int], Array]:
        """What partly rough walls leave of the solids' tangential velocity behind them."""
        found = {}
        for a, end in self._rough:
            n = self.rims.grid.cells[a]
            x = self.rims.along(phi, a)[2 if end == 0 else n + 1]
            side = self.rims.sides[a, end]
            gran = self.fluids.granular
            # Wall stress pi / (2 sqrt(3)) specularity rho phi / packing g sqrt(theta) v against
            # the viscosity: the temperature drops out.
            rough = getattr(side, "specularity", 0.0)
            g = 1.0 / (1.0 - np.cbrt(np.minimum(x / gran.packing, 0.98)))
            shear, _, _ = _kinetic.factors.py_func(x, g, gran.restitution)
            pull = math.pi / (2.0 * math.sqrt(3.0)) * rough / gran.packing * g
            ratio = 0.5 * self.h[a] * pull / (shear * self.fluids.diameter)
            found[a, end] = (1.0 - ratio) / (1.0 + ratio)
        return found

    def fill(self, state: State) -> None:
        """Rims of a state."""
        self.rims.cells(state.phi)
        slips = self.slips(state.phi)
        for a in self.axes:
            self.rims.inflow(state.ug[a], state.volume[a], state.phi, a)
            self.rims.velocity(state.us[a], a, False, slips)
            self.rims.velocity(state.ug[a], a, True, {})
        self.rims.cells(state.p, outlet=-1.0)

    # -- closures -----------------------------------------------------------------------------

    def strain(self, velocities: list[Array], which: str) -> tuple[Array, Array]:
        """Dilation and twice the squared strain of a phase; shear rates are kept by name."""
        dilation, square = self.array("dilation"), self.array("square")
        for k, a in enumerate(self.axes):
            s = self.rims.strides[a]
            _twofluid.stretch(velocities[a], s, self.h[a], k == 0, dilation, square)
        for a, b in self.pairs:
            sa, sb = self.rims.strides[a], self.rims.strides[b]
            e = self.array(f"edge{a}{b}")
            _twofluid.edges(velocities[a], velocities[b], sa, sb, self.h[a], self.h[b], e)
            if which == "solids":
                _twofluid.shear_square(e, sa, sb, square)
        return dilation, square

    def exchange(self, state: State) -> list[Array]:
        """Drag over phi and eps [kg m-3 s-1] in the cells: one array, or one for each axis."""
        rims, f = self.rims, self.fluids
        square = self.array("slip_square")
        parts = [self.array(f"slip{a}") for a in range(3)]
        for k, a in enumerate(self.axes):
            _twofluid.slip(state.ug[a], state.us[a], rims.strides[a], k == 0, parts[a], square)
        phi = np.ascontiguousarray(rims.inside(state.phi))
        speed = np.sqrt(rims.inside(square))
        linearised = getattr(self.correction, "linearised", None)
        if linearised is not None:
            coefficients, pushes = linearised(self._drag_cell(state, phi, parts, speed))
            self.pushes = [self._spread(f"push{a}", one) for a, one in enumerate(pushes)]
            return [self._spread(f"gamma{a}", one) for a, one in enumerate(coefficients)]
        reynolds = (1.0 - phi) * speed
        reynolds *= f.gas_density * f.diameter / f.viscosity
        force = np.asarray(self.drag(phi, reynolds), dtype=np.float64)
        force = force * (18.0 * f.viscosity / f.diameter**2)
        factors: list[Array] = [force]
        if self.correction is not None:
            found = self.correction(self._drag_cell(state, phi, parts, speed))
            each = [found] if isinstance(found, np.ndarray) else list(found)
            factors = [force * np.asarray(one) for one in each]
            if len(factors) not in (1, 3):
                raise InputError(
                    f"correction: {len(factors)} arrays must be one, or one for x, y and z."
                )
        return [self._spread(f"gamma{k}", one) for k, one in enumerate(factors)]

    def _spread(self, name: str, cells: Array) -> Array:
        """Values of the cells in a padded array of that name."""
        padded = self.array(name)
        self.rims.inside(padded)[...] = cells
        self.rims.cells(padded)
        return padded

    def _drag_cell(self, state: State, phi: Array, parts: list[Array], speed: Array) -> DragCell:
        gradients = []
        for a in range(3):
            mean = self.mean_gradient[a]
            if a not in self.axes:
                gradients.append(np.full(phi.shape, mean))
                continue
            s = self.rims.strides[a]
            full = np.zeros(self.rims.size)
            full[s:-s] = (state.p[2 * s :] - state.p[: -2 * s]) / (2.0 * self.h[a]) + mean
            gradients.append(self.rims.inside(full).copy())
        slip = [self.rims.inside(part).copy() for part in parts]
        return DragCell(phi, slip, speed, gradients, self.size)

    def stresses(self, state: State, gamma: Array) -> None:
        """Granular temperature and kinematic viscosities of the solids."""
        f, g = self.fluids, self.fluids.granular
        dilation, square = self.strain(state.us, "solids")
        _kinetic.closures(
            state.phi, square, dilation, gamma, f.density, f.diameter, *g.pressure_numbers,
            math.sin(math.radians(g.friction_angle)),
            -1.0 if g.temperature is None else g.temperature, g.drag_dissipation,
            g.highest_temperature, self.size, self.array("theta"), self.array("shear"),
            self.array("second"), self.array("friction"),
        )  # fmt: skip
        for name in ("theta", "shear", "second", "friction"):
            self.rims.cells(self.array(name))

    def longest_step(self, state: State, courant: float) -> float:
        """Largest time step for that Courant number and stable viscosities [s]."""
        rate = self.array("rate")
        fastest = 0.0
        for velocities in (state.us, state.ug):
            for k, a in enumerate(self.axes):
                s = self.rims.strides[a]
                _twofluid.fastest(velocities[a], s, 1.0 / self.h[a], k == 0, rate)
            fastest = max(fastest, _twofluid.largest(self.rims.inside(rate)))
        shear, second = self.array("shear"), self.array("second")
        # Twice: a dilute face may stand beside a dense cell.
        solid = 2.0 * _twofluid.largest(
            self.rims.inside(2.0 * shear + np.maximum(second, 0.0))
        )  # fmt: skip
        gas = 2.0 * self.fluids.viscosity / self.fluids.gas_density
        wave = 2.0 * sum(1.0 / self.h[a] ** 2 for a in self.axes) * max(solid, gas)
        total = fastest / courant + wave
        return 1.0 / total if total > 0.0 else math.inf
