"""Compiled rigid bodies: loads of their spheres, half kicks, free rotation, new places."""

import math
from typing import NamedTuple

import numpy as np

from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


class Rigid(NamedTuple):
    """Bodies, each in the frame of its principal axes, and the spheres that they consist of."""

    pose: np.ndarray  # (b, 7): centre of mass [m], quaternion from the body to space, scalar first
    swing: np.ndarray  # (b, 6): velocity [m/s], angular momentum in the body's frame [kg m2/s]
    bulk: np.ndarray  # (b, 4): mass [kg], principal moments of inertia [kg m2]
    first: np.ndarray  # (b + 1,) int64, first sphere of each body
    member: np.ndarray  # (m,) int64, number of the sphere in the present order
    offset: np.ndarray  # (m, 3): from the centre of mass, in the body's frame [m]
    image: np.ndarray  # (m, 3): sphere less body, in edges of the periodic box


@njit(**_OPTIONS)
def _quarter_sines(momentum, inertia, dt):
    """Sines and cosines of half the angle and of the angle by which a momentum turns in a time.

    It is 4 atan(angle / 4): still a function of this momentum alone, so that nothing is lost of
    what the angle itself would keep, and it needs no series.
    """
    quarter = 0.25 * dt * momentum / inertia
    square = quarter * quarter
    inverse = 1.0 / (1.0 + square)
    cos, sin = (1.0 - square) * inverse, 2.0 * quarter * inverse
    return cos, sin, cos * cos - sin * sin, 2.0 * sin * cos


@njit(**_OPTIONS)
def rotate_freely(qw, qx, qy, qz, lx, ly, lz, ix, iy, iz, dt):
    """Turn and angular momentum of a free body after a time.

    A symmetric product of turns about its axes, each the exact way of a part of the energy:
    reversible, without drift (Dullweber, Leimkuhler & McLachlan, J. Chem. Phys. 107 (1997) 5840).
    """
    half = 0.5 * dt
    hc, hs, c, s = _quarter_sines(lx, ix, half)
    ly, lz = c * ly + s * lz, c * lz - s * ly
    qw, qx, qy, qz = hc * qw - hs * qx, hc * qx + hs * qw, hc * qy + hs * qz, hc * qz - hs * qy
    hc, hs, c, s = _quarter_sines(ly, iy, half)
    lz, lx = c * lz + s * lx, c * lx - s * lz
    qw, qy, qz, qx = hc * qw - hs * qy, hc * qy + hs * qw, hc * qz + hs * qx, hc * qx - hs * qz
    hc, hs, c, s = _quarter_sines(lz, iz, dt)
    lx, ly = c * lx + s * ly, c * ly - s * lx
    qw, qz, qx, qy = hc * qw - hs * qz, hc * qz + hs * qw, hc * qx + hs * qy, hc * qy - hs * qx
    hc, hs, c, s = _quarter_sines(ly, iy, half)
    lz, lx = c * lz + s * lx, c * lx - s * lz
    qw, qy, qz, qx = hc * qw - hs * qy, hc * qy + hs * qw, hc * qz + hs * qx, hc * qx - hs * qz
    hc, hs, c, s = _quarter_sines(lx, ix, half)
    ly, lz = c * ly + s * lz, c * lz - s * ly
    qw, qx, qy, qz = hc * qw - hs * qx, hc * qx + hs * qw, hc * qy + hs * qz, hc * qz - hs * qy
    scale = 1.0 / math.sqrt(qw * qw + qx * qx + qy * qy + qz * qz)
    return qw * scale, qx * scale, qy * scale, qz * scale, lx, ly, lz


@njit(**_OPTIONS)
def _matrix(w, x, y, z):
    return (
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y),
    )  # fmt: skip


@njit(**_OPTIONS)
def kick_some(begin, end, rigid, state, near, push, edge, dt, finish, start):
    """Half kicks of bodies, their way where a step starts, and then their spheres.

    All bodies before the spheres: what waits in the loads is still there then.
    """
    # Flat, and numbers instead of slices: each slice counts references.
    pose, swing, bulk = rigid.pose.reshape(-1), rigid.swing.reshape(-1), rigid.bulk.reshape(-1)
    offset, image, first, member = (
        rigid.offset.reshape(-1),
        rigid.image.reshape(-1),
        rigid.first,
        rigid.member,
    )
    place, motion, load = state.place.reshape(-1), state.motion.reshape(-1), state.load.reshape(-1)
    into, slots, crossing = near.into, near.slots, near.crossing.reshape(-1)
    half, halves = 0.5 * dt, finish + start
    gx, gy, gz = half * push[0], half * push[1], half * push[2]
    ex, ey, ez = edge[0], edge[1], edge[2]
    for b in range(begin, end):
        p, g, h = 7 * b, 6 * b, 4 * b
        qw, qx, qy, qz = pose[p + 3], pose[p + 4], pose[p + 5], pose[p + 6]
        mass, ix, iy, iz = bulk[h], bulk[h + 1], bulk[h + 2], bulk[h + 3]
        a, bb, c, d, e, f, u, v, w = _matrix(qw, qx, qy, qz)
        fx, fy, fz, tx, ty, tz = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(first[b], first[b + 1]):
            i = member[k]
            m = 8 * i
            sx, sy, sz = load[m], load[m + 1], load[m + 2]
            rx, ry, rz = load[m + 3], load[m + 4], load[m + 5]
            if finish:
                for n in range(into[i], into[i + 1]):
                    o = 6 * np.int64(slots[n])
                    sx, sy, sz = sx + crossing[o], sy + crossing[o + 1], sz + crossing[o + 2]
                    rx, ry, rz = rx + crossing[o + 3], ry + crossing[o + 4], rz + crossing[o + 5]
            ox, oy, oz = offset[3 * k], offset[3 * k + 1], offset[3 * k + 2]
            x, y, z = a * ox + bb * oy + c * oz, d * ox + e * oy + f * oz, u * ox + v * oy + w * oz
            fx, fy, fz = fx + sx, fy + sy, fz + sz
            tx += rx + y * sz - z * sy
            ty += ry + z * sx - x * sz
            tz += rz + x * sy - y * sx
        share = half / mass
        kx, ky, kz = share * fx + gx, share * fy + gy, share * fz + gz
        # Into the frame of the body.
        nx, ny, nz = (
            half * (a * tx + d * ty + u * tz),
            half * (bb * tx + e * ty + v * tz),
            half * (c * tx + f * ty + w * tz),
        )
        vx, vy, vz, lx, ly, lz = (
            swing[g], swing[g + 1], swing[g + 2], swing[g + 3], swing[g + 4], swing[g + 5],
        )  # fmt: skip
        # Twice half a kick, as for spheres.
        for _ in range(halves):
            vx, vy, vz, lx, ly, lz = vx + kx, vy + ky, vz + kz, lx + nx, ly + ny, lz + nz
        cx, cy, cz = pose[p], pose[p + 1], pose[p + 2]
        if start:
            cx, cy, cz = cx + dt * vx, cy + dt * vy, cz + dt * vz
            qw, qx, qy, qz, lx, ly, lz = rotate_freely(qw, qx, qy, qz, lx, ly, lz, ix, iy, iz, dt)
            a, bb, c, d, e, f, u, v, w = _matrix(qw, qx, qy, qz)
            pose[p], pose[p + 1], pose[p + 2] = cx, cy, cz
            pose[p + 3], pose[p + 4], pose[p + 5], pose[p + 6] = qw, qx, qy, qz
        swing[g], swing[g + 1], swing[g + 2] = vx, vy, vz
        swing[g + 3], swing[g + 4], swing[g + 5] = lx, ly, lz
        bx, by, bz = lx / ix, ly / iy, lz / iz
        wx, wy, wz = a * bx + bb * by + c * bz, d * bx + e * by + f * bz, u * bx + v * by + w * bz
        for k in range(first[b], first[b + 1]):
            i = member[k]
            ox, oy, oz = offset[3 * k], offset[3 * k + 1], offset[3 * k + 2]
            x, y, z = a * ox + bb * oy + c * oz, d * ox + e * oy + f * oz, u * ox + v * oy + w * oz
            if start:
                place[4 * i] = cx + x + image[3 * k] * ex
                place[4 * i + 1] = cy + y + image[3 * k + 1] * ey
                place[4 * i + 2] = cz + z + image[3 * k + 2] * ez
            m = 8 * i
            motion[m], motion[m + 1], motion[m + 2] = (
                vx + wy * z - wz * y,
                vy + wz * x - wx * z,
                vz + wx * y - wy * x,
            )
            motion[m + 3], motion[m + 4], motion[m + 5] = wx, wy, wz


@njit(**_OPTIONS)
def images_of(rigid, place, edge):
    """Where the spheres of each body are, in edges, since they were put back into the box."""
    for b in range(rigid.first.size - 1):
        p = rigid.pose[b]
        turn = _matrix(p[3], p[4], p[5], p[6])
        for k in range(rigid.first[b], rigid.first[b + 1]):
            for c in range(3):
                at = p[c]
                for d in range(3):
                    at += turn[3 * c + d] * rigid.offset[k, d]
                away = place[rigid.member[k], c] - at
                rigid.image[k, c] = round(away / edge[c]) if edge[c] > 0.0 else 0.0
