"""The gas between particles: volume-averaged Navier-Stokes equations on a staggered grid."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from greybed.cfd import energy, forces
from greybed.cfd.boundaries import Inflow, Outlet, Side, Sides, Wall
from greybed.cfd.fluid import Fluid
from greybed.cfd.gas_state import Budget, Gas, Inputs, StepReport, Tally
from greybed.cfd.gas_step import Part, TooLong
from greybed.cfd.grid import AXES, Grid
from greybed.cfd.projection import Projection
from greybed.cfd.sealed import check_sealed, is_sealed
from greybed.core.errors import InputError

__all__ = [
    "Budget",
    "Fluid",
    "Gas",
    "GasSolver",
    "Grid",
    "Inflow",
    "Outlet",
    "SolverError",
    "StepReport",
    "Wall",
]

Array = NDArray[np.float64]
Faces = tuple[Array, Array, Array]


class SolverError(InputError):
    """A step that does not come to an end even when it is cut into small ones."""


class GasSolver:
    """Solver of the gas.

    Parameters
    ----------
    grid : Grid
        An axis of one cell that does not repeat is left out.
    boundaries : mapping from ``"x-"``, ``"x+"``, ... to Wall, Inflow or Outlet
        Walls that stick where nothing is said.
    fluid : Fluid
    model : {"A", "B"}
        A: the gas bears ``eps grad p``, the particles the rest. B: the gas bears all of it.
    gravity : three floats
        On the gas [m s-2]; 0 where the pressure leaves its weight out.
    gradient : three floats
        Imposed pressure gradient along axes that repeat [Pa m-1].
    mean_flow : three floats or None each
        Imposed mean superficial velocity along axes that repeat [m s-1].
    void_fraction : float or array
        At the start [-].
    temperature : float or array, optional
        At the start [K]; the energy equation is solved if it is given.
    tolerance : float
        Largest norm of what is left of continuity over that of the flow through cells [-].
    halvings : int
        How often a step may be halved.
    pressure_solver : {"auto", "multigrid", "transform"}
    budget : bool
        Whether reports hold momentum budgets.

    Raises
    ------
    InputError
        For settings out of range or that contradict each other.
    """

    def __init__(
        self,
        grid: Grid,
        boundaries: Mapping[str, Side],
        fluid: Fluid,
        *,
        model: str = "A",
        gravity: Sequence[float] = (0.0, 0.0, 0.0),
        gradient: Sequence[float] = (0.0, 0.0, 0.0),
        mean_flow: Sequence[float | None] = (None, None, None),
        void_fraction: float | Array = 1.0,
        temperature: float | Array | None = None,
        tolerance: float = 1e-8,
        halvings: int = 8,
        pressure_solver: str = "auto",
        budget: bool = False,
    ) -> None:
        if model not in ("A", "B"):
            raise InputError(f"model {model!r} must be 'A' or 'B'.")
        if pressure_solver not in ("auto", "multigrid", "transform"):
            raise InputError(
                f"pressure_solver {pressure_solver!r} must be auto, multigrid or transform."
            )
        if not 0.0 < tolerance < 1.0:
            raise InputError(f"tolerance = {tolerance:g} [-] must be between 0 and 1.")
        self.grid, self.fluid, self.model = grid, fluid, model
        self.sides = Sides(grid, boundaries)
        self.gravity = np.array(gravity, dtype=np.float64)
        self.mean_flow = tuple(mean_flow)
        self.tolerance, self.halvings, self.budget = tolerance, halvings, budget
        for axis, name in enumerate(AXES):
            imposed = gradient[axis] != 0.0, mean_flow[axis] is not None
            if any(imposed) and not grid.periodic[axis]:
                raise InputError(
                    f"a gradient or a mean flow along {name} needs an axis that repeats; give its "
                    "sides an Inflow and an Outlet instead."
                )
            if all(imposed):
                raise InputError(f"give a gradient or a mean flow along {name}, not both.")
        self._energy = temperature is not None
        t = np.full(grid.shape, fluid.temperature)
        if temperature is not None:
            t[...] = temperature
            if not (np.isfinite(t).all() and (t > 0.0).all()):
                raise InputError("temperature: all values [K] must be above 0.")
        if fluid.molar_mass is not None and temperature is None:
            raise InputError("an ideal gas needs a temperature at the start [K].")
        check_sealed(self.sides, fluid)
        if self._energy:
            for (axis, end), side in self.sides.of.items():
                if isinstance(side, Inflow) and side.temperature is None:
                    raise InputError(
                        f"side {AXES[axis]}{'-+'[end]}: an inflow into a gas whose temperature is "
                        "solved for needs its temperature [K]."
                    )
        eps = np.empty(grid.shape)
        eps[...] = void_fraction
        self._check_void(eps)
        zero = tuple(np.zeros(s) for s in grid.face_shapes)
        self._none: Faces = (zero[0], zero[1], zero[2])
        self._projection = Projection(self.sides, fluid, pressure_solver, tolerance)
        self._part = Part(self.sides, fluid, self._projection, model, self.mean_flow, budget)
        velocity = [z.copy() for z in zero]
        for axis in range(3):
            flow = mean_flow[axis]
            if flow is not None:
                velocity[axis] += flow / forces.on_faces(self.sides, self.sides.cells(eps), axis)
        self.state = Gas(
            (velocity[0], velocity[1], velocity[2]), np.zeros(grid.shape), eps,
            eps * fluid.density_at(t), t, 0.0, np.array(gradient, dtype=np.float64),
            mean_pressure=fluid.pressure,
        )  # fmt: skip
        self._projection.hold_rims(self.state.velocity, eps)

    # -- what others read -------------------------------------------------------------------

    @property
    def velocity(self) -> Faces:
        """Between the particles, of the faces across x, y and z [m s-1]."""
        return self.state.velocity

    @property
    def pressure(self) -> Array:
        """Of the cells, gauge [Pa]."""
        return self.state.pressure

    @property
    def temperature(self) -> Array:
        """Of the cells [K]."""
        return self.state.temperature

    @property
    def sealed(self) -> bool:
        """Whether an ideal gas has no outlet, so that its mean pressure changes."""
        return is_sealed(self.sides, self.fluid)

    @property
    def mean_pressure(self) -> float:
        """Of an ideal gas, absolute [Pa]; its density is that at this pressure."""
        return self.state.mean_pressure

    @property
    def time(self) -> float:
        """[s]."""
        return self.state.time

    def set_boundary(self, name: str, side: Side) -> None:
        """Put another side in place for the steps to come, such as an inflow that changes.

        Raises
        ------
        InputError
            For one that the box cannot have; an ideal gas is not sealed or let out meanwhile.
        """
        sides = Sides(self.grid, {f"{AXES[a]}{'-+'[e]}": s for (a, e), s in self.sides.of.items()
                                  if self.sides.wide[a]})  # fmt: skip
        sides.set(name, side)
        check_sealed(sides, self.fluid)
        if is_sealed(sides, self.fluid) != self.sealed:
            raise InputError(
                f"side {name}: an ideal gas cannot be sealed or let out during a run, for the mean "
                "pressure would jump; keep the outlets."
            )
        self.sides.set(name, side)

    def set_velocity(self, u: Array, v: Array, w: Array) -> None:
        """Begin with these velocities [m s-1]; the next step makes them free of divergence."""
        found = []
        for given, shape in zip((u, v, w), self.grid.face_shapes, strict=True):
            out = np.empty(shape)
            out[...] = given
            if not np.isfinite(out).all():
                raise InputError("velocity: all values [m/s] must be finite.")
            found.append(out)
        self.state = replace(self.state, velocity=(found[0], found[1], found[2]), convection=None)
        self._projection.hold_rims(self.state.velocity, self.state.void_fraction)

    def time_step(self, courant: float = 0.4, most: float = math.inf) -> float:
        """Longest step that crosses so many cells at most [s]."""
        rate = self._part.crossings(self.state.velocity)
        return min(most, courant / max(rate, 1e-300))

    def save(self) -> dict[str, Array]:
        """The state as arrays; :meth:`restore` goes on with the same bits."""
        s = self.state
        out = {
            "pressure": s.pressure, "void_fraction": s.void_fraction, "mass": s.mass,
            "temperature": s.temperature, "gradient": s.gradient,
            "times": np.array([s.time, s.before]), "spilled": s.spilled,
            "mean_pressure": np.array(s.mean_pressure),
        }  # fmt: skip
        for axis, name in enumerate("uvw"):
            out[name] = s.velocity[axis]
            if s.convection is not None and s.friction is not None:
                out[f"convection_{name}"] = s.convection[axis]
                out[f"friction_{name}"] = s.friction[axis]
        return {name: a.copy() for name, a in out.items()}

    def restore(self, saved: Mapping[str, Array]) -> None:
        """Take a state that :meth:`save` gave, of the same grid."""
        shapes = self.grid.face_shapes
        for name, shape in (*zip("uvw", shapes, strict=True), ("pressure", self.grid.shape)):
            if name not in saved or saved[name].shape != shape:
                raise InputError(f"saved gas: {name} of shape {shape} is missing.")
        u, v, w = (np.array(saved[n], dtype=np.float64) for n in "uvw")
        kept: list[Faces | None] = [None, None]
        if "convection_u" in saved:
            for k, name in enumerate(("convection", "friction")):
                a, b, c = (np.array(saved[f"{name}_{n}"], dtype=np.float64) for n in "uvw")
                kept[k] = (a, b, c)
        cells = [
            np.array(saved[n], dtype=np.float64)
            for n in ("pressure", "void_fraction", "mass", "temperature")
        ]
        time, before = (float(t) for t in saved["times"])
        gradient = np.array(saved["gradient"], dtype=np.float64)
        p, eps, mass, t = cells
        self.state = Gas(
            (u, v, w),
            p,
            eps,
            mass,
            t,
            time,
            gradient,
            kept[0],
            kept[1],
            before,
            np.array(saved["spilled"]),
            # Where it is absent, the checkpoint is of an outlet's pressure.
            float(saved.get("mean_pressure", self.fluid.pressure)),
        )

    # -- a step -----------------------------------------------------------------------------

    def step(
        self,
        dt: float,
        *,
        void_fraction: Array | float | None = None,
        void_rate: Array | None = None,
        drag: Faces | None = None,
        target: Faces | None = None,
        source: Faces | None = None,
        gravity: Sequence[float] | None = None,
        heat_coefficient: Array | float | None = None,
        heat_target: Array | float | None = None,
        heat_source: Array | float | None = None,
    ) -> StepReport:
        """Go on by ``dt``; cut into parts where that is too long.

        Parameters
        ----------
        dt : float
            [s].
        void_fraction : array, shape (nz, ny, nx), or float, optional
            At the end of the step [-]; as before by default.
        void_rate : array, optional
            Its rate [s-1]; by default the difference to the last one over ``dt``.
        drag : three arrays, shapes of the faces, optional
            Coefficient per volume of the force -drag (u - target), u at the end [kg m-3 s-1].
        target : three arrays, optional
            Velocity of the particles [m s-1]; 0 by default.
        source : three arrays, optional
            Other force on the gas per volume [N m-3].
        gravity : three floats, optional
            For this step [m s-2].
        heat_coefficient, heat_target, heat_source : array or float, optional
            Heat per volume and time: coefficient (target - T) + source, T at the end
            [W m-3 K-1], [K], [W m-3].

        Raises
        ------
        InputError
            For arrays of other shapes or numbers out of range.
        SolverError
            For a step that does not succeed in its smallest parts; the state stays as it was.
        """
        if not (math.isfinite(dt) and dt > 0.0):
            raise InputError(f"dt = {dt:g} [s] must be above 0.")
        state = self.state
        eps = state.void_fraction
        if void_fraction is not None:
            eps = np.empty(self.grid.shape)
            eps[...] = void_fraction
            self._check_void(eps)
        rate = (eps - state.void_fraction) / dt if void_rate is None else void_rate
        if rate.shape != self.grid.shape or not np.isfinite(rate).all():
            raise InputError(f"void_rate must be finite and of shape {self.grid.shape}.")
        heating = None
        if self._energy:
            heating = energy.Heating.of(self.grid.shape, heat_coefficient, heat_target, heat_source)
        elif heat_coefficient is not None or heat_source is not None:
            raise InputError("heat needs a gas with a temperature; give GasSolver one [K].")
        inputs = Inputs(
            eps, rate, self._faces("drag", drag, 0.0), self._faces("target", target),
            self._faces("source", source),
            self.gravity if gravity is None else np.array(gravity, dtype=np.float64), heating,
        )  # fmt: skip
        tally = Tally()
        left, depth = 1.0, 0
        part = 1.0
        while left > 0.0:
            part = min(part, left)
            late = left - part  # share of the step that comes after this part
            here = inputs
            if late > 0.0:
                here = replace(inputs, void=eps - rate * (late * dt))
            try:
                state = self._part.advance(state, part * dt, here, part, tally)
            except TooLong as reason:
                depth += 1
                if depth > self.halvings:
                    raise SolverError(
                        f"gas: the step of {dt:g} [s] at t = {self.state.time:g} s fails in parts "
                        f"of {part * dt:g} s as well: {reason} Take a shorter one, or look at what "
                        "acts there."
                    ) from None
                part *= 0.5
                continue
            left = late
        self.state = replace(state, time=self.state.time + dt)
        seen = tally.seen or list(state.velocity)
        return StepReport(
            self.state.time, dt, tally.parts, tally.iterations, tally.divergence, tally.courant,
            tally.imbalance, state.velocity if tally.parts == 1 else (seen[0], seen[1], seen[2]),
            tally.heat, Budget(*tally.budget) if self.budget else None, state.mean_pressure,
        )  # fmt: skip

    def _check_void(self, eps: Array) -> None:
        if not ((eps > 0.0) & (eps <= 1.0)).all():
            bad = int(np.argmin((eps > 0.0) & (eps <= 1.0)))
            k, j, i = (int(n) for n in np.unravel_index(bad, eps.shape))
            raise InputError(
                f"void_fraction = {eps.flat[bad]:g} [-] of cell x, y, z = {i}, {j}, {k} must be "
                "above 0 and at most 1."
            )

    def _faces(self, name: str, given: Faces | None, least: float = -math.inf) -> Faces:
        if given is None:
            return self._none
        for a, shape in zip(given, self.grid.face_shapes, strict=True):
            if a.shape != shape or not np.isfinite(a).all() or not (a >= least).all():
                raise InputError(
                    f"{name} must be three arrays of shapes {self.grid.face_shapes}, finite"
                    f"{' and at least 0' if least == 0.0 else ''}."
                )
        x, y, z = (np.ascontiguousarray(a, dtype=np.float64) for a in given)
        return x, y, z
