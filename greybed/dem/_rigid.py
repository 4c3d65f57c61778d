"""Compiled rigid bodies: loads of their spheres, half kicks, free rotation, new places."""

import math
from typing import NamedTuple

import numpy as np
from numba import njit, prange

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
def turn_matrix(q, m):
    """Rotation of a unit quaternion, from the body to space."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    m[0, 0], m[0, 1], m[0, 2] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
    m[1, 0], m[1, 1], m[1, 2] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
    m[2, 0], m[2, 1], m[2, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)


@njit(**_OPTIONS)
def _about_axis(q, momentum, axis, inertia, dt):
    """Free rotation by one part of the kinetic energy, about one axis.

    By 4 atan(angle / 4): still a rotation, still a function of this momentum alone, so that nothing
    is lost of what the exact angle keeps, and its sines need no series.
    """
    quarter = 0.25 * dt * momentum[axis] / inertia
    square = quarter * quarter
    inverse = 1.0 / (1.0 + square)
    half_cos, half_sin = (1.0 - square) * inverse, 2.0 * quarter * inverse
    b, c = (axis + 1) % 3, (axis + 2) % 3
    cos, sin = half_cos * half_cos - half_sin * half_sin, 2.0 * half_sin * half_cos
    pb, pc = momentum[b], momentum[c]
    momentum[b], momentum[c] = cos * pb + sin * pc, cos * pc - sin * pb
    w, a = q[0], q[1 + axis]
    x, y = q[1 + b], q[1 + c]
    q[0], q[1 + axis] = half_cos * w - half_sin * a, half_cos * a + half_sin * w
    q[1 + b], q[1 + c] = half_cos * x + half_sin * y, half_cos * y - half_sin * x


@njit(**_OPTIONS)
def rotate_freely(q, momentum, moments, dt):
    """Symmetric product of rotations about the axes: reversible, without drift of the energy.

    Dullweber, Leimkuhler & McLachlan, J. Chem. Phys. 107 (1997) 5840.
    """
    for axis in range(2):
        _about_axis(q, momentum, axis, moments[axis], 0.5 * dt)
    _about_axis(q, momentum, 2, moments[2], dt)
    for axis in range(1, -1, -1):
        _about_axis(q, momentum, axis, moments[axis], 0.5 * dt)
    scale = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    for c in range(4):
        q[c] *= scale


@njit(**_OPTIONS)
def _kick_body(b, turn, load, force, rigid, state, near, push, edge, dt, finish, start):
    """Half kicks of one body, its way where a step starts, and then its spheres."""
    pose, swing, bulk = rigid.pose[b], rigid.swing[b], rigid.bulk[b]
    q, momentum, moments = pose[3:7], swing[3:6], bulk[1:4]
    turn_matrix(q, turn)
    load[:] = 0.0
    for k in range(rigid.first[b], rigid.first[b + 1]):
        i = rigid.member[k]
        for c in range(6):
            force[c] = state.load[i, c]
        if finish:
            for m in range(near.into[i], near.into[i + 1]):
                for c in range(6):
                    force[c] += near.crossing[near.slots[m], c]
        ox, oy, oz = rigid.offset[k, 0], rigid.offset[k, 1], rigid.offset[k, 2]
        x = turn[0, 0] * ox + turn[0, 1] * oy + turn[0, 2] * oz
        y = turn[1, 0] * ox + turn[1, 1] * oy + turn[1, 2] * oz
        z = turn[2, 0] * ox + turn[2, 1] * oy + turn[2, 2] * oz
        load[0] += force[0]
        load[1] += force[1]
        load[2] += force[2]
        load[3] += force[3] + y * force[2] - z * force[1]
        load[4] += force[4] + z * force[0] - x * force[2]
        load[5] += force[5] + x * force[1] - y * force[0]
    half = 0.5 * dt
    for c in range(3):
        kick = half * load[c] / bulk[0] + half * push[c]
        about = turn[0, c] * load[3] + turn[1, c] * load[4] + turn[2, c] * load[5]
        # Twice half a kick, as for spheres.
        for _ in range(finish + start):
            swing[c] += kick
            momentum[c] += half * about
    if start:
        for c in range(3):
            pose[c] += dt * swing[c]
        rotate_freely(q, momentum, moments, dt)
        turn_matrix(q, turn)
    px, py, pz = momentum[0] / moments[0], momentum[1] / moments[1], momentum[2] / moments[2]
    wx = turn[0, 0] * px + turn[0, 1] * py + turn[0, 2] * pz
    wy = turn[1, 0] * px + turn[1, 1] * py + turn[1, 2] * pz
    wz = turn[2, 0] * px + turn[2, 1] * py + turn[2, 2] * pz
    for k in range(rigid.first[b], rigid.first[b + 1]):
        i = rigid.member[k]
        ox, oy, oz = rigid.offset[k, 0], rigid.offset[k, 1], rigid.offset[k, 2]
        x = turn[0, 0] * ox + turn[0, 1] * oy + turn[0, 2] * oz
        y = turn[1, 0] * ox + turn[1, 1] * oy + turn[1, 2] * oz
        z = turn[2, 0] * ox + turn[2, 1] * oy + turn[2, 2] * oz
        if start:
            state.place[i, 0] = pose[0] + x + rigid.image[k, 0] * edge[0]
            state.place[i, 1] = pose[1] + y + rigid.image[k, 1] * edge[1]
            state.place[i, 2] = pose[2] + z + rigid.image[k, 2] * edge[2]
        state.motion[i, 0] = swing[0] + wy * z - wz * y
        state.motion[i, 1] = swing[1] + wz * x - wx * z
        state.motion[i, 2] = swing[2] + wx * y - wy * x
        state.motion[i, 3], state.motion[i, 4], state.motion[i, 5] = wx, wy, wz


@njit(**_OPTIONS)
def _kick_some(begin, end, rigid, state, near, push, edge, dt, finish, start):
    turn, load, force = np.empty((3, 3)), np.empty(6), np.empty(6)
    for b in range(begin, end):
        _kick_body(b, turn, load, force, rigid, state, near, push, edge, dt, finish, start)


@njit(parallel=True, **_OPTIONS)
def _kick_parts(rigid, state, near, push, edge, dt, finish, start):
    bodies, parts = rigid.first.size - 1, near.block.size - 1
    for p in prange(parts):
        begin, end = np.int64(p * bodies // parts), np.int64((p + 1) * bodies // parts)
        _kick_some(begin, end, rigid, state, near, push, edge, dt, finish, start)


@njit(**_OPTIONS)
def kick_bodies(rigid, state, near, push, edge, dt, finish, start):
    """Of all bodies, before the spheres: what waits in the loads is still there then."""
    if near.block.size == 2:
        last = np.int64(rigid.first.size - 1)
        _kick_some(np.int64(0), last, rigid, state, near, push, edge, dt, finish, start)
    else:
        _kick_parts(rigid, state, near, push, edge, dt, finish, start)


@njit(**_OPTIONS)
def images_of(rigid, place, edge):
    """Where the spheres of each body are, in edges, since they were put back into the box."""
    turn = np.empty((3, 3))
    for b in range(rigid.first.size - 1):
        turn_matrix(rigid.pose[b, 3:7], turn)
        for k in range(rigid.first[b], rigid.first[b + 1]):
            for c in range(3):
                at = rigid.pose[b, c]
                for d in range(3):
                    at += turn[c, d] * rigid.offset[k, d]
                away = place[rigid.member[k], c] - at
                rigid.image[k, c] = round(away / edge[c]) if edge[c] > 0.0 else 0.0
