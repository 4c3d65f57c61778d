"""Thermal bed: temperatures of spheres between hot and cold walls, steady or in time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import partial
from importlib import import_module

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError
from greybed.core.packing import Packing
from greybed.coupling.conduction import contact_conductances, per_sphere
from greybed.coupling.network import HeatNetwork, State, newton
from greybed.coupling.radiation import Exchange, boundary_temperatures
from greybed.coupling.results import SolverError, Status, ThermalResult
from greybed.coupling.rows import Rows
from greybed.coupling.transient import integrate

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Material:
    """What the spheres are made of; every value is one number or one per sphere.

    Parameters
    ----------
    conductivity : array_like
        Above zero [W/m/K].
    density : array_like
        Above zero [kg/m3].
    heat_capacity : array_like
        Above zero [J/kg/K].
    emissivity : array_like
        Grey, diffuse, in (0, 1] [-].
    stiffness_ratio : float
        Real over simulated Young's modulus, above zero [-]; see ``contact_conductances``.
    touching_gap : float
        Tolerance for rounded coordinates, at least zero [m]; see ``contact_conductances``.
    """

    conductivity: ArrayLike  # [W/m/K]
    density: ArrayLike  # [kg/m3]
    heat_capacity: ArrayLike  # [J/kg/K]
    emissivity: ArrayLike = 1.0  # [-]
    stiffness_ratio: float = 1.0  # [-]
    touching_gap: float = 0.0  # [m]


def _one_blas_thread() -> AbstractContextManager[object]:
    """Keep BLAS on one thread: on vectors this short its threads cost up to ten times the work."""
    try:
        limits = import_module("threadpoolctl").threadpool_limits
    except ImportError:  # comes with scikit-learn; without it the solve is only slower
        return nullcontext()
    return limits(limits=1, user_api="blas")


class ThermalBed:
    """A bed of spheres that conducts through contacts and radiates between surfaces.

    Parameters
    ----------
    packing : Packing
        The bed with its walls.
    rows : Rows, object or None
        View factors of this packing, traced or from a closure, or exchange factors (anything
        ``Rows.of`` takes); balanced here. None switches radiation off.
    material : Material
        Properties of the spheres.
    wall_temperatures : sequence of n_walls floats or None
        Temperature of each wall of the packing [K]; None for an adiabatic wall.
    environment_temperature : float or None
        What the opening looks at [K]; None for adiabatic.
    conduction : bool
        Whether contacts conduct.
    wall_conductivity : float
        Of the walls' material [W/m/K]; infinite by default.
    sources : array_like, shape () or (n,)
        Heat made inside each sphere [W].

    Raises
    ------
    InputError
        For values out of range, rows of another packing, or rows that cannot be balanced.

    Notes
    -----
    Each sphere has one temperature (conductance of a contact well below k r: true for stiff
    spheres) and constant properties; gas in the gaps is left out. Walls exchange heat with the
    bed only: what a wall sends straight through the opening or to another wall is not counted.
    From view factors, radiation below emissivity 1 has the bias that ``net_radiation`` states;
    from exchange factors it has none.

    Examples
    --------
    >>> from greybed.core import Packing, Plane
    >>> floor = Plane((0, 0, 0), (0, 0, 1))
    >>> lid = Plane((0, 0, 3.99e-3), (0, 0, -1))
    >>> z = [0.9975e-3, 2.9925e-3]
    >>> bed = Packing([[0, 0, zi] for zi in z], 1e-3, walls=[floor, lid])
    >>> steel = Material(conductivity=15.0, density=7900.0, heat_capacity=500.0)
    >>> result = ThermalBed(bed, None, material=steel, wall_temperatures=(400.0, 300.0)).steady()
    >>> bool(abs(result.temperatures.mean() - 350.0) < 1e-9)
    True
    """

    def __init__(
        self,
        packing: Packing,
        rows: object | None,
        *,
        material: Material,
        wall_temperatures: Sequence[float | None] = (),
        environment_temperature: float | None = None,
        conduction: bool = True,
        wall_conductivity: float = math.inf,
        sources: ArrayLike = 0.0,
    ) -> None:
        n = len(packing)
        self.packing, self.material = packing, material
        bounds = boundary_temperatures(wall_temperatures, environment_temperature, packing.n_walls)
        density = per_sphere(material.density, n, "density", "kg/m3", at_most=math.inf)
        specific = per_sphere(
            material.heat_capacity, n, "heat_capacity", "J/kg/K", at_most=math.inf
        )
        self.capacity: Array = 4.0 / 3.0 * np.pi * packing.radii**3 * density * specific  # [J/K]
        source = np.asarray(sources, dtype=np.float64)
        if source.shape not in ((), (n,)) or not np.isfinite(source).all():
            raise InputError(
                f"sources with shape {source.shape} must be one finite number or ({n},) of them "
                "[W]; mend them."
            )
        self.contacts = contact_conductances(
            packing,
            material.conductivity,
            stiffness_ratio=material.stiffness_ratio,
            touching_gap=material.touching_gap,
            wall_conductivity=wall_conductivity,
        )
        exchange = None
        if rows is not None:
            exchange = Exchange(Rows.of(rows, packing), material.emissivity, bounds)
        self.imbalance = 0.0 if exchange is None else exchange.imbalance
        on = float(conduction)
        self.network = HeatNetwork(
            self.contacts.matrix * on,
            self.contacts.walls * on,
            exchange,
            bounds,
            np.array(np.broadcast_to(source, (n,))),
        )

    def _initial(self, initial: ArrayLike | None) -> Array:
        bounds = self.network.bounds
        if initial is None:
            known = bounds[~np.isnan(bounds)]
            if len(known) == 0:
                raise InputError("initial_temperature is missing; give one or (n,) of them [K].")
            initial = float(known.mean())
        name = "initial_temperature"
        return per_sphere(initial, len(self.packing), name, "K", at_most=math.inf)

    def _result(
        self,
        state: State,
        time: float,
        energy_error: float,
        isolated: NDArray[np.int64],
        status: Status,
        history: dict[str, Array],
    ) -> ThermalResult:
        conduction, radiation = self.network.boundary_heat(state)
        return ThermalResult(
            temperatures=state.temperatures,
            wall_conduction=conduction,
            wall_radiation=radiation[:-1],
            opening_heat=float(radiation[-1]),
            time=time,
            energy_error=energy_error,
            isolated=isolated,
            status=status,
            history=history,
        )

    def steady(
        self,
        *,
        initial_temperature: ArrayLike | None = None,
        tolerance: float = 1e-11,
        max_iterations: int = 50,
        raise_on_failure: bool = True,
    ) -> ThermalResult:
        """Temperatures at which every sphere loses what it gains.

        Parameters
        ----------
        initial_temperature : array_like, shape () or (n,), optional
            First guess, above zero [K]; by default the mean of walls and opening. Isolated
            spheres keep it.
        tolerance : float
            Sum of the heat not balanced over the heat exchanged, above zero [-].
        max_iterations : int
            Bound on the Newton iterations [-].
        raise_on_failure : bool
            Whether to raise instead of returning a result whose status says no.

        Returns
        -------
        ThermalResult
            With the residual of every iteration in ``history``.

        Raises
        ------
        InputError
            If nothing ties the bed to a temperature, or a source heats isolated spheres.
        SolverError
            If it does not converge and ``raise_on_failure``.
        """
        network, start = self.network, self._initial(initial_temperature)
        label = network.isolated()
        isolated = np.flatnonzero(label >= 0)
        if len(isolated) == len(label):
            raise InputError(
                "no sphere has a path to a wall or opening with a temperature, so there is no one "
                "steady state; give a temperature to a wall or opening that the bed touches or "
                "sees, or run in time."
            )
        network.pin[:] = 0.0
        for group in np.unique(label[isolated]):
            members = label == group
            if network.sources[members].any():
                i = int(np.flatnonzero(members)[0])
                raise InputError(
                    f"sphere {i} is isolated but has a heat source, so it has no steady state; "
                    "turn radiation on, raise touching_gap, or run in time."
                )
            c = self.capacity[members]
            start[members] = (c @ start[members]) / c.sum()
            # Any conductance serves: at the pinned temperature it carries nothing.
            network.pin[members] = network.conduction_diagonal[members].max() or 1.0
        network.pin_temperatures[:] = start
        solve = partial(newton, tolerance=tolerance, max_iterations=max_iterations)
        try:
            with _one_blas_thread():
                state, status, residuals = solve(network, network.settle(start), None)
        finally:
            network.pin[:] = 0.0
        if raise_on_failure and not status.converged:
            raise SolverError(status)
        conduction, radiation = network.boundary_heat(state)
        supplied = np.concatenate([conduction, radiation, network.sources])
        gross = float(np.abs(supplied).sum())
        # A bed in equilibrium exchanges round-off: a ratio of two of those means nothing.
        floor = network.residual(state, None)[3]
        error = abs(float(supplied.sum())) / gross if gross > 1e3 * floor else 0.0
        history = {"residual": np.array(residuals)}
        return self._result(state, math.inf, error, isolated, status, history)

    def run(
        self,
        duration: float,
        *,
        initial_temperature: ArrayLike,
        dt: float | None = None,
        temperature_tolerance: float = 0.05,
        tolerance: float = 1e-11,
        max_steps: int = 100_000,
        raise_on_failure: bool = True,
        on_progress: Callable[[float], object] | None = None,
    ) -> ThermalResult:
        """Advance the temperatures in time (TR-BDF2, second order, L-stable).

        Parameters
        ----------
        duration : float
            Above zero [s].
        initial_temperature : array_like, shape () or (n,)
            Above zero [K].
        dt : float, optional
            Fixed step, shortened to divide the duration [s]; by default the step adapts.
        temperature_tolerance : float
            Error of each adaptive step in any sphere, above zero [K].
        tolerance : float
            Residual of each stage over the heat exchanged, above zero [-].
        max_steps : int
            Bound on the steps [-].
        raise_on_failure : bool
            Whether to raise instead of returning a result whose status says no.
        on_progress : callable, optional
            Called after every step with the fraction of the duration that it covered [-].

        Returns
        -------
        ThermalResult
            At the end, or at the last good step; one row of ``history`` per step.

        Raises
        ------
        InputError
            For a value out of range.
        SolverError
            If it does not converge and ``raise_on_failure``.
        """
        for name, value in (("duration", duration), ("dt", dt)):
            if value is not None and not (math.isfinite(value) and value > 0.0):
                raise InputError(f"{name} = {value:g} [s] must be finite and above 0; mend it.")
        if not temperature_tolerance > 0.0:
            raise InputError(
                f"temperature_tolerance = {temperature_tolerance:g} [K] must be above 0; mend it."
            )
        with _one_blas_thread():
            state, energy_error, status, history = integrate(
                self.network,
                self.capacity,
                self._initial(initial_temperature),
                duration,
                dt=dt,
                temperature_tolerance=temperature_tolerance,
                tolerance=tolerance,
                max_steps=max_steps,
                on_progress=on_progress,
            )
        if raise_on_failure and not status.converged:
            raise SolverError(status)
        isolated = np.flatnonzero(self.network.isolated() >= 0)
        reached = float(history["time"][-1]) if len(history["time"]) else 0.0
        return self._result(state, reached, energy_error, isolated, status, history)
