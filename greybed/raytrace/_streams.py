"""Compiled random streams: a hash of counters, and rays of a sphere drawn from it."""

import math

import numpy as np

from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}

GOLDEN = np.uint64(0x9E3779B97F4A7C15)
MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
MIX_2 = np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31, S32 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(32)
_LOW = np.uint64(0xFFFFFFFF)
_TO_UNIT = 2.0**-31


@njit(**_OPTIONS)
def mix(z):
    """Finaliser of SplitMix64 (Steele, Lea & Flood 2014, doi 10.1145/2660193.2660195)."""
    z = (z ^ (z >> _S30)) * MIX_1
    z = (z ^ (z >> _S27)) * MIX_2
    return z ^ (z >> _S31)


@njit(**_OPTIONS)
def in_disc(state):
    """Uniform point of the unit disc: x, y, x^2 + y^2 and the advanced state."""
    # Rejection costs 1.27 draws on average, less than a sine and a cosine; one draw gives both
    # coordinates, on a grid of 2^-31 that no tally can resolve.
    while True:
        state += GOLDEN
        bits = mix(state)
        x = np.float64(np.int32(bits >> S32)) * _TO_UNIT
        y = np.float64(np.int32(bits & _LOW)) * _TO_UNIT
        s = x * x + y * y
        if s < 1.0:
            return x, y, s, state


@njit(**_OPTIONS)
def emit(state):
    """Ray leaving the unit sphere with a cosine law: direction, surface point, state.

    Seen from far away a Lambertian sphere is a uniformly bright disc whatever the direction.
    So the direction is isotropic and the point uniform on the disc across it: the same law as
    a uniform surface point with a cosine-weighted direction, without trigonometry.
    """
    x, y, s, state = in_disc(state)
    w = 2.0 * math.sqrt(1.0 - s)
    dx, dy, dz = x * w, y * w, 1.0 - 2.0 * s
    u, v, s, state = in_disc(state)
    # Orthonormal basis without branches: Duff et al. 2017, jcgt.org/published/0006/01/01
    sign = math.copysign(1.0, dz)
    a = -1.0 / (sign + dz)
    b = dx * dy * a
    lift = math.sqrt(1.0 - s)
    px = u * (1.0 + sign * dx * dx * a) + v * b + lift * dx
    py = u * (sign * b) + v * (sign + dy * dy * a) + lift * dy
    pz = u * (-sign * dx) - v * dy + lift * dz
    return dx, dy, dz, px, py, pz, state


@njit(**_OPTIONS)
def stream_of(sphere, seed):
    """Stream of a sphere, from which those of its rays and replicates are made."""
    return mix(np.uint64(seed) * MIX_1 + mix(np.uint64(sphere) + GOLDEN))


@njit(**_OPTIONS)
def replicate_seeds(stream, r, seeds):
    """Seeds (4,) of the scramblings of a sphere's replicate ``r``."""
    state = mix(stream ^ mix(np.uint64(r) + MIX_2))
    for k in range(4):
        state += GOLDEN
        seeds[k] = np.uint32(mix(state) >> S32)


@njit(**_OPTIONS)
def draw(state, rays, k):
    """Next ray of a stream into column ``k`` of ``rays``; returns the advanced state."""
    dx, dy, dz, px, py, pz, state = emit(state)
    rays[0, k], rays[1, k], rays[2, k] = dx, dy, dz
    rays[3, k], rays[4, k], rays[5, k] = px, py, pz
    return state
