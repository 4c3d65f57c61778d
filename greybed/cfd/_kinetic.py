"""Compiled closures of the solids stress: arrays in, arrays out, SI."""

import math

import numpy as np

from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}
_PI = math.pi
_ROOT = math.sqrt(math.pi)
# Collisions count as at this share of the packing beyond it, friction goes on along its tangent.
_DENSE = 0.98
# 2^52, whose last bits count ones, its bits, and what two thirds of an exponent's offset are.
_MAGIC, _MAGIC_BITS, _THIRDS = 4503599627370496.0, 0x4330000000000000, 715094163.0


@njit(**_OPTIONS)
def root3(x):
    """Cube root of a number from 0 to 1: the exponent by thirds, then Halley's steps twice."""
    # The upper half of the bits as a number, so that loops stay vector instructions.
    bits = np.float64(x + 1e-30).view(np.int64) >> 32 | _MAGIC_BITS
    third = (np.int64(bits).view(np.float64) - _MAGIC) / 3.0 + _THIRDS
    y = np.int64(np.float64(third + _MAGIC).view(np.int64) << 32).view(np.float64)
    for _ in range(2):
        cube = y * y * y
        y *= (cube + 2.0 * x) / (2.0 * cube + x)
    return y


@njit(**_OPTIONS)
def radial(phi, packing):
    """Contacts over those of points: 1 / (1 - (phi / packing)^(1/3))."""
    return 1.0 / (1.0 - root3(min(phi, _DENSE * packing) / packing))


@njit(**_OPTIONS)
def collisional(phi, e, packing):
    """K: pressure over density and temperature."""
    return phi * (1.0 + 2.0 * (1.0 + e) * phi * radial(phi, packing))


@njit(**_OPTIONS)
def frictional(phi, packing, onset, scale, growth, power):
    """Pressure of lasting contacts [Pa]."""
    if phi <= onset:
        return 0.0
    last = _DENSE * packing
    x = min(phi, last)
    p = scale * (x - onset) ** growth / (packing - x) ** power
    if phi > last:
        p += (phi - last) * p * (growth / (last - onset) + power / (packing - last))
    return p


@njit(**_OPTIONS)
def solids_pressure(phi, theta, density, e, packing, onset, scale, growth, power, out):
    """Collisional and frictional pressure over density."""
    for i in range(phi.size):
        out[i] = theta[i] * collisional(phi[i], e, packing)
    # Apart, since powers are no vector instructions and few cells are so dense.
    for i in range(phi.size):
        if phi[i] > onset:
            out[i] += frictional(phi[i], packing, onset, scale, growth, power) / density


@njit(**_OPTIONS)
def chord(phi, guess, theta, density, e, packing, onset, scale, growth, power, out):
    """Slope of the pressure [Pa] over the solid fraction between two: a bound of it.

    The tangent of collisions at the denser one, the chord of friction.
    """
    for i in range(phi.size):
        low = min(max(min(phi[i], guess[i]), 0.0), packing)
        high = max(max(phi[i], guess[i]), low + 1e-6)
        c = root3(min(high, _DENSE * packing) / packing)
        g = 1.0 / (1.0 - c)
        # phi^2 g', without a division by phi
        steep = packing * g * g * c**4 / 3.0
        out[i] = theta[i] * (1.0 + 2.0 * (1.0 + e) * (2.0 * high * g + steep)) * density
    for i in range(phi.size):
        if max(phi[i], guess[i]) + 1e-6 > onset:
            low = min(max(min(phi[i], guess[i]), 0.0), packing)
            high = max(max(phi[i], guess[i]), low + 1e-6)
            dp = frictional(high, packing, onset, scale, growth, power)
            dp -= frictional(low, packing, onset, scale, growth, power)
            out[i] += dp / (high - low)


@njit(**_OPTIONS)
def factors(phi, g, e):
    """Shear viscosity over density d sqrt(theta) phi, bulk viscosity alike, dissipation."""
    shear = (
        _ROOT / (6.0 * (3.0 - e)) * (1.0 + 0.4 * (1.0 + e) * (3.0 * e - 1.0) * phi * g)
        + 0.8 * phi * g * (1.0 + e) / _ROOT
    )
    bulk = 4.0 / 3.0 * phi * g * (1.0 + e) / _ROOT
    loss = 12.0 * (1.0 - e * e) * g / _ROOT
    return shear, bulk, loss


@njit(**_OPTIONS)
def closures(
    phi, square, dilation, gamma, density, d, e, packing, onset, scale, growth, power, sine,
    fixed, drag_loss, most, size, theta, shear, second, friction,
):  # fmt: skip
    """Granular temperature, kinematic viscosities of collisions, and that of friction.

    ``square`` is twice the squared rates of strain. Kinematic means over density and phi;
    ``second`` is bulk less two thirds of shear. ``fixed`` below 0: temperature from production =
    dissipation, J theta / d + (3 gamma eps / density + K dilation) sqrt(theta) = what viscosities
    make. K theta, the pressure over phi, does work where the flow expands; without it here, the
    pressure would push without drawing on the fluctuations and feed the flow without end. Where
    the flow is compressed the work is left out: it would heat dilute cells without end, and as a
    viscosity it would be stiffer than all others.
    """
    damped = 3.0 / density if drag_loss else 0.0
    for i in range(phi.size):
        x = min(max(phi[i], 0.0), packing)
        g = radial(x, packing)
        m, bulk, j = factors(x, g, e)
        trace = dilation[i]
        deviator = max(square[i] - 2.0 / 3.0 * trace * trace, 0.0)
        # Both over phi: finite where there are no particles.
        loss = j * (x + 1e-4) / d
        make = d * (m * deviator + bulk * trace * trace)
        middle = (1.0 + 2.0 * (1.0 + e) * x * g) * max(trace, 0.0) + damped * gamma[i] * (1.0 - x)
        root = math.sqrt(middle * middle + 4.0 * loss * make)
        speed = 2.0 * make / (middle + root + 1e-300)
        # No more than differs over a cell: free paths of dilute cells are longer than they.
        t = min(speed * speed, most, size * size * (deviator + trace * trace))
        t = fixed if fixed >= 0.0 else t
        theta[i] = t
        lively = d * math.sqrt(t)
        shear[i] = m * lively
        second[i] = (bulk - 2.0 / 3.0 * m) * lively
        friction[i] = 0.0
    for i in range(phi.size):
        x = min(max(phi[i], 0.0), packing)
        if x > onset:
            deviator = max(square[i] - 2.0 / 3.0 * dilation[i] * dilation[i], 0.0)
            p = frictional(x, packing, onset, scale, growth, power)
            friction[i] = p * sine / (math.sqrt(deviator) + 1e-12) / (density * x)
