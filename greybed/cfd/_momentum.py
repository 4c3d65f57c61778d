"""Compiled parts of a step that work face by face; arrays are flat."""

from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def predict(u, rate, m, c, slope, drag, target, source, g, dt, out, gain):
    """Velocities before the pressure's correction, and what a unit of its slope takes off them."""
    for i in range(u.size):
        inertia = m[i] / dt
        whole = inertia + drag[i]
        force = rate[i] + m[i] * g + source[i] - c[i] * slope[i]
        out[i] = (inertia * u[i] + force + drag[i] * target[i]) / whole
        gain[i] = c[i] / whole
