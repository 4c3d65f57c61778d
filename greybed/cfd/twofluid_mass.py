"""Mass of the solids over one step: fluxes through faces that leave 0 <= phi <= packing."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from greybed.cfd import _kinetic, _twofluid
from greybed.cfd.twofluid_step import State, Stepper

Array = NDArray[np.float64]

# Cells are filled up to this share of the packing, and emptied to it.
_FULL, _SAFE = 1.0 - 1e-12, 1.0 - 1e-10
# Reduction of the error of the solids pressure in its sweeps, and the most of them.
_SETTLED, _MOST_SWEEPS = 1e-9, 400
_MOST_PASSES = 200


def move_solids(st: Stepper, state: State, dt: float, gammas: list[Array], phi1: Array) -> None:
    """Fill ``phi1``; the fluxes stay in the scratch arrays ``flux0`` to ``flux2``.

    Fluxes are those of the velocities of the old time, corrected by what the pressure of the
    solids changes in the step, which is found implicitly.
    """
    rims = st.rims
    for a in st.axes:
        flux = st.array(f"flux{a}")
        s = rims.strides[a]
        _twofluid.carried(state.phi, state.us[a], 0, s, dt / st.h[a], flux)
        rims.fluxes(flux, a, False)
    excess = st.array("excess")
    _net(st, dt, excess)
    _press(st, state, dt, gammas, excess)
    _net(st, dt, excess)
    np.add(state.phi, excess, out=phi1)
    inside = rims.inside(phi1)
    full = _FULL * st.fluids.granular.packing
    if inside.min() < 0.0 or inside.max() > full:
        _limit(st, state, dt, full)
        _net(st, dt, excess)
        np.add(state.phi, excess, out=phi1)
    rims.cells(phi1)


def _net(st: Stepper, dt: float, excess: Array) -> None:
    """What flows into the cells in the step."""
    for k, a in enumerate(st.axes):
        _twofluid.gather(
            st.array(f"flux{a}"), st.rims.strides[a], -dt / st.h[a], k == 0, excess
        )  # fmt: skip


def _press(st: Stepper, state: State, dt: float, gammas: list[Array], excess: Array) -> None:
    """Fluxes that the change of the solids pressure drives; sets the report's sweeps."""
    rims, f = st.rims, st.fluids
    slope, total, nearby = st.array("slope"), st.array("total"), st.array("nearby")
    np.add(state.phi, excess, out=nearby)
    _kinetic.chord(
        state.phi, nearby, st.array("theta"), f.density, *f.granular.pressure_numbers, slope
    )
    for k, a in enumerate(st.axes):
        give, s = st.array(f"give{a}"), rims.strides[a]
        gamma = gammas[a if len(gammas) == 3 else 0]
        _twofluid.yielding(gamma, state.phi, s, dt, f.density, give)
        rims.fluxes(give, a, True)
        _twofluid.around(give, s, dt / st.h[a] ** 2, k == 0, total)
    np.multiply(slope, total, out=nearby)
    stiff = float(_twofluid.largest(rims.inside(nearby)))
    st.report.sweeps = 0
    if not stiff > 0.0:
        return
    radius = stiff / (1.0 + stiff)
    rate = radius / (1.0 + math.sqrt(1.0 - radius**2))
    sweeps = min(_MOST_SWEEPS, 1 + math.ceil(math.log(0.5 * _SETTLED) / math.log(rate)))
    x, old = st.array("pressed"), st.array("pressed2")
    x[:] = 0.0
    old[:] = 0.0
    omega = 1.0
    for sweep in range(sweeps):
        for k, a in enumerate(st.axes):
            scale = dt / st.h[a] ** 2
            _twofluid.neighbours(st.array(f"give{a}"), x, rims.strides[a], scale, k == 0, nearby)
        _twofluid.relax(slope, excess, total, nearby, omega, old)
        x, old = old, x
        rims.repeat_cells(x)
        omega = (
            1.0 / (1.0 - 0.5 * radius**2) if sweep == 0 else 1.0 / (1.0 - 0.25 * radius**2 * omega)
        )
    st.report.sweeps = sweeps
    for a in st.axes:
        _twofluid.push(st.array(f"give{a}"), x, rims.strides[a], st.h[a], st.array(f"flux{a}"))
        rims.fluxes(st.array(f"flux{a}"), a, False)


def _limit(st: Stepper, state: State, dt: float, full: float) -> None:
    """Shrink fluxes until no cell gives more than it has or takes more than it can hold.

    Each cell first gives at most what it holds. Then it takes what there is room for, given what
    surely leaves it: nothing in the first pass, in later ones what neighbours have room for. Every
    pass is admissible and lets more through (after Zalesak, J. Comput. Phys. 31 (1979) 335).
    """
    rims = st.rims
    out, come, share = st.array("out"), st.array("come"), st.array("share")
    _exchanged(st, dt, "flux", out, come)
    _twofluid.shares(_SAFE * state.phi, out, share)
    rims.cells(share)
    for a in st.axes:
        _twofluid.by_donor(st.array(f"flux{a}"), share, rims.strides[a])
        rims.fluxes(st.array(f"flux{a}"), a, False)
    _exchanged(st, dt, "flux", out, come)
    room, wanted = st.array("room"), st.array("wanted")
    np.subtract(full, state.phi, out=room)
    wanted[:] = come
    _twofluid.shares(_SAFE * room, wanted, share)
    before = share.copy()
    for _ in range(_MOST_PASSES):
        rims.cells(share)
        for a in st.axes:
            to = st.array(f"through{a}")
            _twofluid.by_receiver(st.array(f"flux{a}"), share, rims.strides[a], to)
            rims.fluxes(to, a, False)
        _exchanged(st, dt, "through", out, come)
        before[:] = share
        _twofluid.shares(_SAFE * (room + out), wanted, share)
        if np.abs(rims.inside(share) - rims.inside(before)).max() < 1e-6:
            break
    for a in st.axes:
        st.array(f"flux{a}")[:] = st.array(f"through{a}")
    st.report.limited = int((rims.inside(before) < 1.0 - 1e-6).sum())


def _exchanged(st: Stepper, dt: float, name: str, out: Array, come: Array) -> None:
    for k, a in enumerate(st.axes):
        _twofluid.leaving(
            st.array(f"{name}{a}"), st.rims.strides[a], dt / st.h[a], k == 0, out, come
        )
