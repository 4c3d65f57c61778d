"""Momentum of both phases over one step: fluxes, drag and pressure."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from greybed.cfd import _kinetic, _twofluid
from greybed.cfd.poisson import Poisson
from greybed.cfd.rims import Outlet
from greybed.cfd.twofluid_step import TINY, State, StepError, Stepper
from greybed.core.errors import InputError

Array = NDArray[np.float64]

# Volume that is created, over what flows through a face, below which it is round-off.
_NOTHING = 1e-14


def move_momentum(st: Stepper, state: State, new: State, dt: float, gammas: list[Array]) -> None:
    """Velocities and pressure of the new state, whose solid fraction is known."""
    _leave(st, state, new.phi, dt)
    f = st.fluids
    for a in st.axes:
        push = -st.mean_gradient[a]
        s = st.rims.strides[a]
        if st.pushes is not None:
            _push(st, new.phi, dt, a)
        _twofluid.predict(
            s, dt, f.density, f.gas_density,
            f.gravity[a] + push / f.density, f.gravity[a] + push / f.gas_density, TINY,
            state.phi, new.phi, gammas[a if len(gammas) == 3 else 0], state.us[a], state.ug[a],
            st.array(f"outs{a}"), st.array(f"outg{a}"), st.array(f"hats{a}"),
            st.array(f"hatg{a}"), st.array(f"yields{a}"), st.array(f"yieldg{a}"),
            st.array(f"hatq{a}"), st.array(f"mobility{a}"),
        )  # fmt: skip
        for name in ("hatq", "mobility"):
            st.rims.fluxes(st.array(f"{name}{a}"), a, False)
        st.rims.inflow(st.array(f"hatg{a}"), st.array(f"hatq{a}"), new.phi, a)
    _project(st, state, new, dt)
    for a in st.axes:
        _twofluid.yielded(
            new.p, st.rims.strides[a], st.h[a], new.phi, st.array(f"hats{a}"),
            st.array(f"hatg{a}"), st.array(f"yields{a}"), st.array(f"yieldg{a}"), new.us[a],
            new.ug[a], new.volume[a],
        )  # fmt: skip
        st.rims.fluxes(new.volume[a], a, False)


def _push(st: Stepper, phi: Array, dt: float, a: int) -> None:
    """Add drag that does not depend on the new slip to the momentum that comes in."""
    assert st.pushes is not None  # checked by the caller
    s, f = st.rims.strides[a], st.fluids
    solid = 0.5 * (phi[s:] + phi[:-s])
    force = 0.5 * (st.pushes[a][s:] + st.pushes[a][:-s]) * solid * (1.0 - solid) * dt
    st.array(f"outs{a}")[s:] -= force / f.density
    st.array(f"outg{a}")[s:] += force / f.gas_density


def _leave(st: Stepper, state: State, phi: Array, dt: float) -> None:
    """Momentum per density that leaves each face's control volume in the step, both phases."""
    f = st.fluids
    shear, second, pressure = st.array("shear"), st.array("second"), st.array("pressure")
    # Friction may ask for any viscosity; steps that are explicit carry this much.
    most = 0.25 / (dt * sum(2.0 / st.h[a] ** 2 for a in st.axes))
    whole = np.minimum(shear + st.array("friction"), most)
    second -= 2.0 / 3.0 * (whole - shear)
    np.minimum(second, most, out=second)
    shear[:] = whole
    _kinetic.solids_pressure(
        phi, st.array("theta"), f.density, *f.granular.pressure_numbers, pressure
    )
    fluxes = [st.array(f"flux{a}") for a in range(3)]
    _phase(st, state.us, fluxes, phi, shear, second, pressure, "outs", dt)

    void = st.array("void")
    np.subtract(1.0, phi, out=void)
    for a in st.axes:
        gas = st.array(f"gasflux{a}")
        np.subtract(state.volume[a], fluxes[a], out=gas)
    flow = [st.array(f"gasflux{a}") for a in range(3)]
    nu = f.viscosity / f.gas_density
    shear[:] = nu
    second[:] = -2.0 / 3.0 * nu
    pressure[:] = 0.0
    st.strain(state.ug, "gas")
    _phase(st, state.ug, flow, void, shear, second, pressure, "outg", dt)


def _phase(
    st: Stepper, velocities: list[Array], fluxes: list[Array], content: Array, shear: Array,
    second: Array, pressure: Array, name: str, dt: float,
) -> None:  # fmt: skip
    stress, flux, strides = {}, st.array("momentum"), st.rims.strides
    for a, b in st.pairs:
        stress[a, b] = stress[b, a] = st.array(f"stress{a}{b}")
        _twofluid.shear_stress(
            st.array(f"edge{a}{b}"), content, shear, strides[a], strides[b], stress[a, b]
        )
    for a in st.axes:
        q, out = velocities[a], st.array(f"{name}{a}")
        for k, b in enumerate(st.axes):
            sa, sb = strides[a], strides[b]
            _twofluid.carried_by(q, fluxes[b], velocities[b], sa, sb, dt / st.h[b], flux)
            if a == b:
                _twofluid.normal_stress(
                    q, st.array("dilation"), content, shear, second, pressure, sa, st.h[a], flux
                )
            else:
                _twofluid.take(stress[a, b], flux)
            _twofluid.gather(flux, sb, dt / st.h[b], k == 0, out)


def _project(st: Stepper, state: State, new: State, dt: float) -> None:
    """Pressure that lets no volume be created."""
    rims, volume = st.rims, st.rims.grid.cell_volume
    faces, net, size = [], st.array("net"), 0.0
    for a in range(3):
        shape = rims.grid.face_shapes[a]
        if a not in st.axes:
            faces.append(np.zeros(shape))
            continue
        t = rims.inside(st.array(f"mobility{a}"), a) * (volume / st.h[a] ** 2)
        ends = np.moveaxis(t, 2 - a, 0)
        for end in (0, 1):
            if isinstance(rims.sides.get((a, end)), Outlet):
                ends[-end] *= 2.0
        faces.append(t)
        hat = st.array(f"hatq{a}")
        _twofluid.gather(hat, rims.strides[a], -volume / st.h[a], a == st.axes[0], net)
        size += _twofluid.greatest(rims.inside(hat, a)) * volume / st.h[a]
    created = np.ascontiguousarray(rims.inside(net))
    new.p_before[:] = state.p
    start = rims.inside(state.p).copy()
    if state.dt > 0.0:
        start += (start - rims.inside(state.p_before)) * (dt / state.dt)
    # Round-off of the fluxes cannot be solved away.
    norm = float(np.sqrt((created**2).sum()))
    noise = max(1e-8 * st.tolerance, _NOTHING) * size * math.sqrt(created.size)
    st.report.iterations = 0
    try:
        if st.solver is None:
            st.solver = Poisson(faces[0], faces[1], faces[2], rims.grid.periodic)
        else:
            st.solver.update(faces[0], faces[1], faces[2])
        if norm <= noise:
            found = np.zeros_like(created)
        else:
            found, st.report.iterations = st.solver.solve(
                created, start, tolerance=max(st.tolerance, noise / norm)
            )
    except InputError as error:
        raise StepError(str(error)) from error
    if not math.isfinite(float(found.sum())):
        raise StepError("pressure: not a number.")
    rims.inside(new.p)[...] = found
    rims.cells(new.p, outlet=-1.0)
