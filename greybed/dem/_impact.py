"""Compiled impact of two spheres, head on."""

import math

from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def returned_speed(exponent, damping, viscous, cut, step):
    """Speed after over before an impact with force x^a + 2 c x^b x' + d sqrt(x) x' [-].

    In units in which mass, stiffness and the first speed are one. b = (a - 1) / 2 makes what c =
    ``damping`` does independent of the speed; d = ``viscous`` grows with it. With ``cut`` the
    force is never attractive, and once it is cut off it stays so: the bodies part.
    """
    x, v = 0.0, 1.0
    while True:
        # Fourth-order Runge-Kutta.
        sum_x, sum_v = 0.0, 0.0
        at_x, at_v = x, v
        for stage in range(4):
            force = _force(exponent, damping, viscous, cut, at_x, at_v)
            weight = 1.0 if stage == 0 or stage == 3 else 2.0
            sum_x, sum_v = sum_x + weight * at_v, sum_v - weight * force
            h = step if stage == 2 else 0.5 * step
            at_x, at_v = x + h * at_v, v - h * force
        x, v = x + step * sum_x / 6.0, v + step * sum_v / 6.0
        gone = cut and _force(exponent, damping, viscous, cut, x, v) <= 0.0
        if v < 0.0 and (x <= 0.0 or gone):
            return -v


@njit(**_OPTIONS)
def _force(exponent, damping, viscous, cut, x, v):
    depth = max(x, 0.0)
    drag = (2.0 * damping * depth ** (0.5 * (exponent - 1.0)) + viscous * math.sqrt(depth)) * v
    force = depth**exponent + drag
    return max(force, 0.0) if cut else force
