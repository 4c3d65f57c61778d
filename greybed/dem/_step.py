"""Compiled time steps: velocity Verlet over blocks of particles, until a list has to be renewed.

Threads share the blocks of each part of a step. One leads: it says which part comes next and waits
until all its blocks are done. Each thread begins with its own range of blocks, the same in every
step: what a core has written last is dear to read for another one. Whoever is done with that takes
blocks of the others, so a helper that comes late, or never, holds nobody up; sums have one order
whoever does them.
"""

from typing import NamedTuple

import numpy as np

from greybed.core.jit import njit
from greybed.dem._batch import empty_batch
from greybed.dem._pairs import block_forces
from greybed.dem._rigid import kick_some
from greybed.dem._share import add, look, put, rest
from greybed.dem._walls import move, wall_forces

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}

# What is asked for: steps, forces of the present places, the second half of the last step's kick.
STEPS, FORCES, FINISH = 0, 1, 2
# Why the steps ended.
DONE, RENEW, LOST, HELPED = 0, 1, 2, 3
# Parts of a step.
_BODIES, _KICKS, _PAIRS = 0, 1, 2
# What threads share. The number of the part that is under way, blocks done; written while nobody
# works, the part, how to do it and how many threads there are; then for each thread the next block
# of its range, counted from the range's begin. What threads wait for or count in has a line of the
# cache of its own.
GO, _READY, _PART, _ENDS, _STARTS, _LOOKS, THREADS, _NEXT, _LINE = 0, 8, 16, 17, 18, 19, 20, 24, 8
STOP, _NO_BLOCK = -1, 1 << 31
# Looks at a counter before a thread that waits lets other programs run.
_PATIENCE = 2000


class State(NamedTuple):
    """Particles in the order of their places."""

    place: np.ndarray  # (n, 4): centre and radius [m]
    motion: np.ndarray  # (n, 8): velocity [m/s], spin [1/s], mass [kg], moment of inertia [kg m2]
    # (n, 8): force [N], torque [N m], inverses of mass and moment of inertia: the kick needs them
    load: np.ndarray
    kind: np.ndarray  # (n,) int64, material
    listed: np.ndarray  # (n, 3): centre when the lists were made [m]
    fixed: np.ndarray  # (n,) bool: moves on as it does, whatever the force
    body: np.ndarray  # (n,) int64: rigid body that it belongs to, or -1
    # (n, 6): force [N], torque [N m] from without; no rows where there is none
    outer: np.ndarray = np.zeros((0, 6))


class Near(NamedTuple):
    """Pairs and their histories."""

    first: np.ndarray  # (n + 1,) int64
    owner: np.ndarray  # (m,) int32, the lower particle of each pair
    partner: np.ndarray  # (m,) int32
    shift: np.ndarray  # (m,) uint8, image of the partner
    touch: np.ndarray  # (m,) uint8, whether in contact
    history: np.ndarray  # (m, columns)
    slot: np.ndarray  # (m,) int32, row of ``crossing``, or -1
    crossing: np.ndarray  # (slots, 6): force and torque on particles of later blocks
    into: np.ndarray  # (n + 1,) int64
    slots: np.ndarray  # (slots,) int32, rows of ``crossing`` that act on each particle
    onto: np.ndarray  # (slots,) int32, the particle that each of ``slots`` acts on
    block: np.ndarray  # (blocks + 1,) int64, first particle of each block


class Surfaces(NamedTuple):
    """Walls, and the particles near them."""

    kinds: np.ndarray  # (s,) int64
    data: np.ndarray  # (s, 13)
    wall: np.ndarray  # (s,) int64, wall that a surface belongs to
    motion: np.ndarray  # (walls, 9): velocity [m/s], spin [1/s], centre [m]
    kind: np.ndarray  # (walls,) int64, material
    first: np.ndarray  # (n + 1,) int64
    surface: np.ndarray  # (m,) int32
    touch: np.ndarray  # (m,) uint8
    history: np.ndarray  # (m, columns)
    force: np.ndarray  # (blocks, walls, 6): force [N] and torque about the centre [N m]


class Law(NamedTuple):
    """Contact laws, as codes and tables."""

    normal: int
    rolling: int
    cohesion: int
    limit: bool
    row: np.ndarray  # (kinds, kinds) int64, row of ``table`` of two materials
    table: np.ndarray  # (pairs, COLUMNS)


def new_team(threads: int) -> np.ndarray:
    """What ``threads`` share, before the first part; it begins with a line of the cache."""
    size = _NEXT + threads * _LINE
    room = np.zeros(size + _LINE, np.int64)
    begin = -room.ctypes.data % (8 * _LINE) // 8
    team = room[begin : begin + size]
    team[_NEXT::_LINE] = _NO_BLOCK
    team[THREADS] = threads
    return team


@njit(**_OPTIONS)
def _kick_and_drift(begin, end, state, near, push, dt, finish, start, worst):
    """Second half of one step's kick and first half of the next one's, with the way between.

    ``worst`` takes the largest square of the way since the lists were made, and whose it is.
    """
    # Flat: numba multiplies by strides at each access of two indices.
    place, motion = state.place.reshape(-1), state.motion.reshape(-1)
    load, listed, fixed = state.load.reshape(-1), state.listed.reshape(-1), state.fixed
    body = state.body
    into, slots, onto, crossing = near.into, near.slots, near.onto, near.crossing.reshape(-1)
    outer, pushed = state.outer.reshape(-1), state.outer.shape[0] > 0
    halves = finish + start
    half = 0.5 * dt
    gx, gy, gz = half * push[0], half * push[1], half * push[2]
    largest, who = 0.0, -1
    if finish:
        for k in range(into[begin], into[end]):
            m, s = np.uint64(8 * onto[k]), np.uint64(6 * slots[k])
            for c in range(6):
                load[m + np.uint64(c)] += crossing[s + np.uint64(c)]
    for i in range(begin, end):
        p, m = np.uint64(4 * i), np.uint64(8 * i)
        vx, vy, vz = motion[m], motion[m + np.uint64(1)], motion[m + np.uint64(2)]
        if body[i] < 0 and not fixed[i]:
            kick, spin = half * load[m + np.uint64(6)], half * load[m + np.uint64(7)]
            ax = kick * load[m] + gx
            ay = kick * load[m + np.uint64(1)] + gy
            az = kick * load[m + np.uint64(2)] + gz
            bx = spin * load[m + np.uint64(3)]
            by = spin * load[m + np.uint64(4)]
            bz = spin * load[m + np.uint64(5)]
            wx, wy, wz = (
                motion[m + np.uint64(3)],
                motion[m + np.uint64(4)],
                motion[m + np.uint64(5)],
            )
            # Twice half a kick, not once a whole one: a run in two parts ends with the same bits.
            for _ in range(halves):
                vx, vy, vz = vx + ax, vy + ay, vz + az
                wx, wy, wz = wx + bx, wy + by, wz + bz
            motion[m], motion[m + np.uint64(1)], motion[m + np.uint64(2)] = vx, vy, vz
            motion[m + np.uint64(3)] = wx
            motion[m + np.uint64(4)] = wy
            motion[m + np.uint64(5)] = wz
        if start:
            x, y, z = place[p], place[p + np.uint64(1)], place[p + np.uint64(2)]
            if body[i] < 0:  # others have been moved with their body
                x, y, z = x + dt * vx, y + dt * vy, z + dt * vz
                place[p], place[p + np.uint64(1)], place[p + np.uint64(2)] = x, y, z
            dx = x - listed[3 * i]
            dy = y - listed[3 * i + 1]
            dz = z - listed[3 * i + 2]
            square = dx * dx + dy * dy + dz * dz
            for c in range(6):
                load[m + np.uint64(c)] = outer[6 * i + c] if pushed else 0.0
            if not square <= largest:  # also where it is not a number
                largest, who = square, i
                if square != square:
                    break
    worst[0], worst[1] = largest, who


@njit(**_OPTIONS)
def _forces_of_block(b, state, near, surfaces, law, edge, periodic, dt, looks, deepest):
    begin, end = near.block[b], near.block[b + 1]
    work = empty_batch(law.table)
    block_forces(
        begin, end, state.place, state.motion, state.load, state.kind,
        near.first, near.owner, near.partner, near.shift, near.touch, near.history, near.slot,
        near.crossing, edge, periodic, law.row, law.table, dt,
        law.normal, law.rolling, law.cohesion, law.limit, looks, deepest, work,
    )  # fmt: skip
    if surfaces.kinds.size:
        surfaces.force[b, :, :] = 0.0
        wall_forces(
            begin, end, state.place, state.motion, state.load, state.kind,
            surfaces.first, surfaces.surface, surfaces.touch, surfaces.history,
            surfaces.kinds, surfaces.data, surfaces.wall, surfaces.motion, surfaces.kind,
            surfaces.force[b], law.row, law.table, dt,
            law.normal, law.rolling, law.cohesion, law.limit, work,
        )  # fmt: skip


@njit(**_OPTIONS)
def _share(
    who, team, state, near, rigid, surfaces, law, edge, periodic, push, dt, worst, deepest
):  # fmt: skip
    """Blocks of the present part until none is left, those of the thread's own range first."""
    blocks, bodies, threads = near.block.size - 1, rigid.first.size - 1, team[THREADS]
    done = 0
    for turn in range(threads):
        whose = (who + turn) % threads
        begin, end = whose * blocks // threads, (whose + 1) * blocks // threads
        while True:
            b = begin + add(team, _NEXT + whose * _LINE, 1)
            if b >= end:
                break
            part = team[_PART]
            if part == _PAIRS:
                # From the last one on: what the kicks have come to last is still near.
                b = begin + end - 1 - b
                _forces_of_block(
                    b, state, near, surfaces, law, edge, periodic, dt, team[_LOOKS] != 0,
                    deepest[b],
                )  # fmt: skip
            elif part == _KICKS:
                _kick_and_drift(
                    near.block[b], near.block[b + 1], state, near, push, dt, team[_ENDS],
                    team[_STARTS], worst[b],
                )  # fmt: skip
            else:
                kick_some(
                    b * bodies // blocks, (b + 1) * bodies // blocks, rigid, state, near, push,
                    edge, dt, team[_ENDS], team[_STARTS],
                )  # fmt: skip
            done += 1
    add(team, _READY, done)


@njit(**_OPTIONS)
def _furthest(worst):
    """The largest square of a way, and whose; also where it is no number, and then for good."""
    largest, who = 0.0, -1
    for b in range(worst.shape[0]):
        if not worst[b, 0] <= largest and largest == largest:
            largest, who = worst[b, 0], np.int64(worst[b, 1])
    return largest, who


@njit(**_OPTIONS)
def work(
    order, steps, who, team, state, near, rigid, surfaces, law, edge, periodic, push, dt, skin,
    wall_pace, wall_way, pending, worst, deepest,
):  # fmt: skip
    """Up to ``steps`` steps; returns those done, why it ended, and the particle that was at fault.

    ``pending`` says that the loads are of the present places but not yet in the velocities: so it
    is after a step, and where lists were renewed between the way and the forces. Forces across
    blocks wait in ``near.crossing``. ``team`` is one of ``new_team``; thread 0 leads, the others
    help and return when somebody has put STOP at GO.
    """
    blocks, step, number, looks = near.block.size - 1, 0, 0, 0
    while who > 0:
        go = look(team, GO)
        if go == STOP:
            return 0, HELPED, -1, wall_way
        if go == number:
            looks += 1
            rest(looks > _PATIENCE)
            continue
        number, looks = go, 0
        _share(
            who, team, state, near, rigid, surfaces, law, edge, periodic, push, dt, worst, deepest
        )
    first = _BODIES if rigid.first.size > 1 else _KICKS
    part = _PAIRS if order == FORCES else first
    team[_STARTS] = order == STEPS
    team[_ENDS] = pending
    team[_LOOKS] = order == FORCES
    while True:
        number, looks = number + 1, 0
        team[_PART] = part
        for k in range(team[THREADS]):
            put(team, _NEXT + k * _LINE, 0)
        put(team, GO, number)
        _share(
            who, team, state, near, rigid, surfaces, law, edge, periodic, push, dt, worst, deepest
        )
        while look(team, _READY) < number * blocks:
            looks += 1
            rest(looks > _PATIENCE)
        if part == _BODIES:
            part = _KICKS
        elif part == _KICKS:
            if order == FINISH:
                near.crossing[:, :] = 0.0
                return 0, DONE, -1, wall_way
            team[_ENDS] = 1
            largest, at_fault = _furthest(worst)
            if wall_pace > 0.0:
                move(surfaces.kinds, surfaces.data, surfaces.wall, surfaces.motion, dt)
                wall_way += wall_pace * dt
            if not largest < np.inf:
                return step, LOST, at_fault, wall_way
            if 2.0 * np.sqrt(largest) > skin - wall_way:
                return step, RENEW, at_fault, wall_way
            team[_LOOKS] = step == steps - 1
            part = _PAIRS
        else:
            step += 1
            if order == FORCES or step == steps:
                return step, DONE, -1, wall_way
            part = first


@njit(**_OPTIONS)
def push(forces, torques, ident, before, outer, load):
    """Fill ``outer`` (n, 6) with pushes in the order of the input, and change the loads by them."""
    turned, pushed = torques.shape[0] > 0, before.shape[0] > 0
    for i in range(ident.size):
        for c in range(3):
            outer[i, c] = forces[ident[i], c]
            outer[i, 3 + c] = torques[ident[i], c] if turned else 0.0
        for c in range(6):
            load[i, c] += outer[i, c] - before[i, c] if pushed else outer[i, c]


@njit(**_OPTIONS)
def gather(state, near):
    """Add to the loads what waits in ``near.crossing``, and leave nothing there."""
    for i in range(near.into.size - 1):
        for m in range(near.into[i], near.into[i + 1]):
            for c in range(6):
                state.load[i, c] += near.crossing[near.slots[m], c]
    near.crossing[:, :] = 0.0
