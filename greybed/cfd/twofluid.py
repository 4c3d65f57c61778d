"""Gas and particles as two fluids that share the space: the door to the two-fluid solver."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.cfd import _twofluid
from greybed.cfd.grid import AXES, Grid
from greybed.cfd.kinetic import Granular
from greybed.cfd.rims import Rims, Side
from greybed.cfd.twofluid_mass import move_solids
from greybed.cfd.twofluid_means import Means, averages
from greybed.cfd.twofluid_momentum import move_momentum
from greybed.cfd.twofluid_step import (
    Correction,
    Drag,
    DragCell,
    Fluids,
    State,
    StepError,
    Stepper,
    not_finite,
)
from greybed.core.errors import InputError, RangeError

__all__ = ["Correction", "Drag", "DragCell", "Means", "StepError", "TwoFluid"]

Array = NDArray[np.float64]

# A step whose new velocities pass more than a cell in it is made again with half of it.
_OUTRUN = 1.0
_MOST_HALVINGS = 8


class TwoFluid:
    """Two-fluid (Euler-Euler) equations on a staggered grid, model A, incompressible gas.

    Parameters
    ----------
    grid : Grid
    solid_fraction : array_like
        At the start, broadcast to the cells (nz, ny, nx), 0 to the packing [-].
    particle_density, diameter : float
        [kg m-3], [m].
    gas_density, gas_viscosity : float
        [kg m-3], [Pa s].
    drag : callable (phi, re) -> F
        Drag over Stokes' for solid fraction and ``Re = eps rho d |u - v| / mu``; the force on the
        particles in a unit of volume is ``18 mu eps phi F / d^2 (u - v)``. Arrays [z, y, x].
    granular : Granular, optional
        Stress of the solids.
    gravity : three floats
        [m s-2].
    sides : mapping, optional
        ``{"y-": Inflow(0.3), "y+": Outlet()}``: sides of axes that do not repeat, walls where
        nothing is said.
    pressure_gradient : ``"balance"`` or three floats
        Mean pressure gradient along axes that repeat [Pa m-1]; by default it carries the weight
        of both phases.
    correction : callable (DragCell) -> H, optional
        Factor of the drag in each cell, one array, or three for x, y and z.
    gas_velocity, solids_velocity : three array_like, optional
        At the start, each broadcast to the faces of its axis [m s-1]; 0 by default.
    time_step : float, optional
        Fixed time step [s]; by default as long as ``courant`` lets it be.
    courant : float
        Largest sum of the Courant numbers of a cell, above 0 to 0.5 [-].
    longest_step : float
        Bound of the step that is chosen [s].
    tolerance : float
        Of the pressure: largest norm of the volume that is created, over that before its solve.

    Raises
    ------
    InputError
        For numbers out of range, a solid fraction above the packing, sides that do not exist.

    Notes
    -----
    ``docs/twofluid.md`` has equations, sources and discretisation.
    """

    def __init__(
        self, grid: Grid, solid_fraction: ArrayLike, *, particle_density: float, diameter: float,
        gas_density: float, gas_viscosity: float, drag: Drag, granular: Granular | None = None,
        gravity: Sequence[float] = (0.0, -9.81, 0.0), sides: Mapping[str, Side] | None = None,
        pressure_gradient: str | Sequence[float] = "balance", correction: Correction | None = None,
        gas_velocity: Sequence[ArrayLike] | None = None,
        solids_velocity: Sequence[ArrayLike] | None = None, time_step: float | None = None,
        courant: float = 0.3, longest_step: float = math.inf, tolerance: float = 1e-6,
    ) -> None:  # fmt: skip
        for name, value, unit in (
            ("particle_density", particle_density, "kg m-3"), ("diameter", diameter, "m"),
            ("gas_density", gas_density, "kg m-3"), ("gas_viscosity", gas_viscosity, "Pa s"),
            ("time_step", 1.0 if time_step is None else time_step, "s"),
            ("longest_step", longest_step, "s"),
        ):  # fmt: skip
            if not value > 0.0:
                raise InputError(f"two-fluid: {name} = {value:g} [{unit}] must be above 0.")
        if not 0.0 < courant <= 0.5:
            raise InputError(f"two-fluid: courant = {courant:g} [-] must be above 0, to 0.5.")
        if not 0.0 < tolerance < 0.1:
            raise InputError(f"two-fluid: tolerance = {tolerance:g} [-] must be from 0 to 0.1.")
        self.grid = grid
        self.granular = granular or Granular()
        self.courant, self.longest_step, self.time_step = courant, longest_step, time_step
        self._rims = Rims(grid, sides or {})
        gx, gy, gz = (float(g) for g in gravity)
        self._fluids = Fluids(
            particle_density, diameter, gas_density, gas_viscosity, (gx, gy, gz), self.granular
        )
        self._stepper = Stepper(self._rims, self._fluids, drag, correction, tolerance)
        self._state, self._spare = self._blank(), self._blank()
        phi = np.asarray(solid_fraction, dtype=np.float64)
        self._check_fraction(phi)
        self._rims.inside(self._state.phi)[...] = phi
        for target, given in ((self._state.us, solids_velocity), (self._state.ug, gas_velocity)):
            for a in self._rims.axes:
                if given is not None:
                    self._rims.inside(target[a], a)[...] = given[a]
        self._stepper.mean_gradient = self._balance(pressure_gradient)
        self._check_step()
        self._begin()

    def _blank(self) -> State:
        zeros = self._rims.zeros
        us, ug, volume = ([zeros() for _ in range(3)] for _ in range(3))
        return State(zeros(), us, ug, volume, zeros(), zeros())

    def _check_fraction(self, phi: Array) -> None:
        most = self.granular.packing
        if not (np.isfinite(phi).all() and phi.min() >= 0.0 and phi.max() < most):
            bad = float(phi.max()) if phi.max() >= most else float(phi.min())
            raise InputError(
                f"two-fluid: a solid fraction of {bad:g} must be from 0 to below the packing "
                f"{most:g}; take fewer particles or raise granular.packing."
            )

    def _check_step(self) -> None:
        wave = sum(1.0 / self.grid.spacing[a] ** 2 for a in self._rims.axes)
        most = 0.25 * self._fluids.gas_density / (self._fluids.viscosity * wave)
        if self.time_step is not None and self.time_step > most:
            raise InputError(
                f"two-fluid: time_step = {self.time_step:g} [s] is longer than the viscosity of "
                f"the gas allows on this grid, {most:.3g} [s]; leave it out or take a shorter one."
            )

    def _balance(self, wanted: str | Sequence[float]) -> tuple[float, float, float]:
        f = self._fluids
        if isinstance(wanted, str):
            if wanted != "balance":
                raise InputError(
                    f"two-fluid: pressure_gradient = {wanted!r} must be 'balance' or three numbers."
                )
            phi = float(self._rims.inside(self._state.phi).mean())
            weight = phi * f.density + (1.0 - phi) * f.gas_density
            wanted = [weight * g for g in f.gravity]
        along = [
            float(w) if self.grid.periodic[a] else 0.0 for a, w in enumerate(wanted)
        ]  # fmt: skip
        return along[0], along[1], along[2]

    def _begin(self) -> None:
        """Volume fluxes of the state that is given."""
        state = self._state
        self._rims.cells(state.phi)
        for a in self._rims.axes:
            s = self._rims.strides[a]
            solid = 0.5 * (state.phi[s:] + state.phi[:-s])
            state.volume[a][s:] = (1.0 - solid) * state.ug[a][s:] + solid * state.us[a][s:]
            self._rims.fluxes(state.volume[a], a, False)
        self._stepper.fill(state)

    # -- time -----------------------------------------------------------------------------------

    def step(self, longest: float | None = None) -> float:
        """One step; returns its length [s].

        Parameters
        ----------
        longest : float, optional
            Bound of this one [s].

        Raises
        ------
        StepError
            If it fails with 1/256 of its length too; says why.
        """
        st, state = self._stepper, self._state
        gammas = st.exchange(state)
        st.stresses(state, gammas[0])
        dt = self.time_step
        if dt is None:
            dt = min(st.longest_step(state, self.courant), self.longest_step)
            if not math.isfinite(dt):
                why = not_finite(state, self._rims) or " Nothing moves, give longest_step."
                raise StepError(f"two-fluid: there is no length for a step.{why}")
        if longest is not None:
            dt = min(dt, longest)
        reason = ""
        for _ in range(_MOST_HALVINGS + 1):
            try:
                self._advance(dt, gammas)
            except StepError as error:
                reason = str(error)
                dt *= 0.5
                # The step has changed viscosities.
                st.stresses(state, gammas[0])
                continue
            return dt
        raise StepError(
            f"two-fluid: the step at {state.time:.6g} s fails even with {2 * dt:.3g} s: {reason}"
            f"{not_finite(state, self._rims) or not_finite(self._spare, self._rims)}"
        )

    def _advance(self, dt: float, gammas: list[Array]) -> None:
        st, state, new = self._stepper, self._state, self._spare
        move_solids(st, state, dt, gammas, new.phi)
        move_momentum(st, state, new, dt, gammas)
        st.fill(new)
        fastest = 0.0
        for velocities in (new.us, new.ug):
            for k, a in enumerate(self._rims.axes):
                s = self._rims.strides[a]
                _twofluid.fastest(
                    velocities[a], s, dt / self.grid.spacing[a], k == 0, st.array("rate")
                )
            speed = float(_twofluid.largest(self._rims.inside(st.array("rate"))))
            fastest = speed if math.isnan(speed) else max(fastest, speed)
        if not fastest <= _OUTRUN:
            raise StepError(
                f"velocities would pass {fastest:.3g} cells in one step; take a shorter one."
            )
        new.time, new.steps, new.dt = state.time + dt, state.steps + 1, dt
        self._state, self._spare = new, state

    def run(self, duration: float, each: Callable[[TwoFluid], object] | None = None) -> int:
        """Steps until ``duration`` [s] has passed; returns how many.

        Parameters
        ----------
        duration : float
            At least 0; the last steps are shortened to end there.
        each : callable (TwoFluid), optional
            Called after each step.
        """
        if not duration >= 0.0:
            raise RangeError(f"two-fluid: a duration of {duration:g} [s] must be at least 0.")
        end, count = self.time + duration, 0
        while end - self.time > 1e-12 * max(abs(end), duration):
            left = end - self.time
            # Two equal steps rather than a long one and a sliver.
            usual = self._state.dt
            self.step(left if left <= usual or left > 2.0 * usual else 0.5 * left)
            count += 1
            if each is not None:
                each(self)
        return count

    # -- fields ---------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Time since the start [s]."""
        return self._state.time

    @property
    def steps(self) -> int:
        """Steps since the start."""
        return self._state.steps

    @property
    def solid_fraction(self) -> Array:
        """Solid fraction of the cells [z, y, x], a copy [-]."""
        return self._rims.inside(self._state.phi).copy()

    @property
    def pressure(self) -> Array:
        """Pressure less its mean gradient [Pa], a copy; mean 0 where no outlet fixes it."""
        return self._rims.inside(self._state.p).copy()

    @property
    def pressure_gradient(self) -> tuple[float, float, float]:
        """Mean pressure gradient along axes that repeat [Pa m-1]."""
        return self._stepper.mean_gradient

    def _faces(self, flat: list[Array]) -> tuple[Array, Array, Array]:
        found = [
            self._rims.inside(flat[a], a).copy()
            if a in self._rims.axes
            else np.zeros(self.grid.face_shapes[a])
            for a in range(3)
        ]
        return found[0], found[1], found[2]

    @property
    def gas_velocity(self) -> tuple[Array, Array, Array]:
        """Interstitial velocities of the gas on the faces across x, y, z, copies [m s-1]."""
        return self._faces(self._state.ug)

    @property
    def solids_velocity(self) -> tuple[Array, Array, Array]:
        """Velocities of the solids on the faces across x, y, z, copies [m s-1]."""
        return self._faces(self._state.us)

    @property
    def volume_flux(self) -> tuple[Array, Array, Array]:
        """Volume flux of both phases through the faces, copies [m s-1]."""
        return self._faces(self._state.volume)

    @property
    def granular_temperature(self) -> Array:
        """Granular temperature of the cells [z, y, x], a copy [m2 s-2]."""
        st = self._stepper
        st.stresses(self._state, st.exchange(self._state)[0])
        return self._rims.inside(st.array("theta")).copy()

    @property
    def limited(self) -> int:
        """Cells whose inflow the last step had to limit so that none holds too much."""
        return self._stepper.report.limited

    @property
    def pressure_iterations(self) -> int:
        """Iterations of the pressure in the last step."""
        return self._stepper.report.iterations

    @property
    def solids_mass(self) -> float:
        """Mass of the particles [kg]."""
        total = math.fsum(self._rims.inside(self._state.phi).ravel())
        return self._fluids.density * total * self.grid.cell_volume

    @property
    def means(self) -> Means:
        """Averages over the grid."""
        return averages(self._rims, self._fluids, self._state)

    # -- restart --------------------------------------------------------------------------------

    def save(self) -> dict[str, Array]:
        """The whole state as arrays; :meth:`restore` goes on from it with the same bits."""
        s, inside = self._state, self._rims.inside
        found = {
            "solid_fraction": inside(s.phi).copy(), "pressure": inside(s.p).copy(),
            "pressure_before": inside(s.p_before).copy(),
            "clock": np.array([s.time, float(s.steps), s.dt]),
            "mean_gradient": np.array(self._stepper.mean_gradient),
        }  # fmt: skip
        for name, flat in (("solids", s.us), ("gas", s.ug), ("volume", s.volume)):
            for a in self._rims.axes:
                found[f"{name}_{AXES[a]}"] = inside(flat[a], a).copy()
        return found

    def restore(self, saved: Mapping[str, ArrayLike]) -> None:
        """Take the state that :meth:`save` has given.

        Raises
        ------
        InputError
            For an array that is missing or of another shape.
        """
        s, inside = self._state, self._rims.inside
        targets = {
            "solid_fraction": inside(s.phi), "pressure": inside(s.p),
            "pressure_before": inside(s.p_before),
        }  # fmt: skip
        for name, flat in (("solids", s.us), ("gas", s.ug), ("volume", s.volume)):
            for a in self._rims.axes:
                targets[f"{name}_{AXES[a]}"] = inside(flat[a], a)
        arrays = {}
        for name in (*targets, "clock", "mean_gradient"):
            if name not in saved:
                raise InputError(f"restart: {name!r} is missing; take what save() has given.")
            arrays[name] = np.asarray(saved[name], dtype=np.float64)
            shape = targets[name].shape if name in targets else (3,)
            if arrays[name].shape != shape:
                raise InputError(
                    f"restart: {name} of shape {arrays[name].shape} must be {shape}, as this grid "
                    "has it."
                )
        self._check_fraction(arrays["solid_fraction"])
        for name, target in targets.items():
            target[...] = arrays[name]
        s.time, s.steps, s.dt = (
            float(arrays["clock"][0]),
            int(arrays["clock"][1]),
            float(arrays["clock"][2]),
        )
        gx, gy, gz = arrays["mean_gradient"].tolist()
        self._stepper.mean_gradient = (gx, gy, gz)
        self._stepper.fill(s)
        for a in self._rims.axes:
            self._rims.fluxes(s.volume[a], a, False)
            self._rims.inflow(s.ug[a], s.volume[a], s.phi, a)
