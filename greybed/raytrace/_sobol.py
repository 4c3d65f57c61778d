"""Compiled quasi-random rays: scrambled Sobol points and the rays of a sphere made from them.

Sobol's sequence in base 2 with the direction numbers of Joe and Kuo 2008 (doi 10.1137/070709359),
first four dimensions. Owen's nested scrambling is done by hashing (Laine and Karras 2011, doi
10.1111/j.1467-8659.2011.01985.x; Burley 2020, jcgt.org/published/0009/04/01): bit k is flipped
by a hash of the bits above it. The hash works on reversed bits, so the sequence is kept reversed.
"""

import math

import numpy as np

from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}

DIMENSIONS = 4
# Primitive polynomials (degree, inner coefficients) and first direction numbers, dimension 2 on.
_POLYNOMIALS = ((1, 0, (1,)), (2, 1, (1, 3)), (3, 1, (1, 3, 1)))

_u32 = np.uint32
_S1, _S2, _S4, _S8, _S16 = _u32(1), _u32(2), _u32(4), _u32(8), _u32(16)
_M1, _M2, _M4, _M8 = _u32(0x55555555), _u32(0x33333333), _u32(0x0F0F0F0F), _u32(0x00FF00FF)
_H1, _H2, _H3 = _u32(0x3D20ADEA), _u32(0x05526C56), _u32(0x53A22864)
_ONE = _u32(1)
_CELL = 2.0**-32


def _reversed(x: int) -> int:
    return int(f"{x:032b}"[::-1], 2)


def direction_numbers() -> np.ndarray:
    """Direction numbers with reversed bits, shape (4, 32) uint32."""
    table = np.zeros((DIMENSIONS, 32), np.uint32)
    table[0] = [_reversed(1 << (31 - k)) for k in range(32)]
    for row, (degree, inner, first) in enumerate(_POLYNOMIALS, start=1):
        m = list(first)
        for k in range(degree, 32):
            value = m[k - degree] ^ (m[k - degree] << degree)
            for q in range(1, degree):
                if (inner >> (degree - 1 - q)) & 1:
                    value ^= m[k - q] << q
            m.append(value)
        table[row] = [_reversed(m[k] << (31 - k)) for k in range(32)]
    return table


@njit(**_OPTIONS)
def scrambled(x, seed):
    """Point in (0, 1) of a reversed number, nested bits flipped by a hash of ``seed``."""
    # Vegdahl's constants (psychopath.io/post/2021_01_30_building_a_better_lk_hash), which leave
    # less pattern than those of the paper.
    x = _u32(x ^ (x * _H1))
    x = _u32(x + seed)
    x = _u32(x * ((seed >> _S16) | _ONE))
    x = _u32(x ^ (x * _H2))
    x = _u32(x ^ (x * _H3))
    x = _u32(((x >> _S1) & _M1) | ((x & _M1) << _S1))
    x = _u32(((x >> _S2) & _M2) | ((x & _M2) << _S2))
    x = _u32(((x >> _S4) & _M4) | ((x & _M4) << _S4))
    x = _u32(((x >> _S8) & _M8) | ((x & _M8) << _S8))
    x = _u32((x >> _S16) | (x << _S16))
    # The middle of the cell: never 0, never 1.
    return (np.float64(x) + 0.5) * _CELL


@njit(**_OPTIONS)
def sequence(n, table, out):
    """First ``n`` points of the sequence, reversed and not scrambled, into ``out`` (4, n)."""
    a, b, c, d = _u32(0), _u32(0), _u32(0), _u32(0)
    for k in range(n):
        out[0, k], out[1, k], out[2, k], out[3, k] = a, b, c, d
        rest, bit = k + 1, 0
        while rest & 1 == 0:
            rest >>= 1
            bit += 1
        a ^= table[0, bit]
        b ^= table[1, bit]
        c ^= table[2, bit]
        d ^= table[3, bit]


@njit(**_OPTIONS)
def turn(u):
    """Cosine and sine of 2 pi u for u in [0, 1), to 1e-14; unlike libm's it vectorises."""
    quarter = math.floor(4.0 * u + 0.5)
    x = (u - 0.25 * quarter) * (2.0 * math.pi)
    z = x * x
    s = x * (1.0 + z * (-1.0 / 6.0 + z * (1.0 / 120.0 + z * (-1.0 / 5040.0 + z * (
        1.0 / 362880.0 + z * (-1.0 / 39916800.0 + z / 6227020800.0))))))  # fmt: skip
    c = 1.0 + z * (-0.5 + z * (1.0 / 24.0 + z * (-1.0 / 720.0 + z * (1.0 / 40320.0 + z * (
        -1.0 / 3628800.0 + z * (1.0 / 479001600.0 - z / 87178291200.0))))))  # fmt: skip
    k = np.int64(quarter) & 3
    odd = (k & 1) == 1
    cosine = s if odd else c
    sine = c if odd else s
    return (-cosine if (k == 1) | (k == 2) else cosine), (-sine if k >= 2 else sine)


@njit(**_OPTIONS)
def sphere_rays(points, n, seeds, rays, at):
    """Cosine-law rays of the unit sphere from the first ``n`` points of a sequence.

    Fills columns ``at`` to ``at + n`` of ``rays`` (6, m): direction, then place on the sphere.
    From afar a Lambertian sphere is an evenly bright disc: a direction from two numbers, a place
    of the disc across it from the other two.
    """
    # Rows of their own: one index a row is what the compiler can turn into vectors.
    p0, p1, p2, p3 = points[0, :n], points[1, :n], points[2, :n], points[3, :n]
    s0, s1, s2, s3 = seeds[0], seeds[1], seeds[2], seeds[3]
    r0, r1, r2 = rays[0, at : at + n], rays[1, at : at + n], rays[2, at : at + n]
    r3, r4, r5 = rays[3, at : at + n], rays[4, at : at + n], rays[5, at : at + n]
    for k in range(n):
        u = scrambled(p0[k], s0)
        v = scrambled(p1[k], s1)
        w = scrambled(p2[k], s2)
        h = scrambled(p3[k], s3)
        dz = 1.0 - 2.0 * u
        flat = math.sqrt(1.0 - dz * dz)
        cosine, sine = turn(v)
        dx, dy = flat * cosine, flat * sine
        lift, reach = math.sqrt(1.0 - w), math.sqrt(w)
        cosine, sine = turn(h)
        x, y = reach * cosine, reach * sine
        # Orthonormal basis without branches: Duff et al. 2017, jcgt.org/published/0006/01/01
        sign = math.copysign(1.0, dz)
        a = -1.0 / (sign + dz)
        b = dx * dy * a
        r0[k], r1[k], r2[k] = dx, dy, dz
        r3[k] = x * (1.0 + sign * dx * dx * a) + y * b + lift * dx
        r4[k] = x * (sign * b) + y * (sign + dy * dy * a) + lift * dy
        r5[k] = x * (-sign * dx) - y * dy + lift * dz


@njit(**_OPTIONS)
def cube(points, n, seeds, numbers):
    """First ``n`` points of a sequence, scrambled, into ``numbers`` (n, 4)."""
    for k in range(n):
        for d in range(4):
            numbers[k, d] = scrambled(points[d, k], seeds[d])
