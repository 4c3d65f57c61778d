"""Compiled scratch of one thread: the arrays through which the rays of a task go."""

from typing import NamedTuple

import numpy as np

from greybed.core.jit import njit
from greybed.raytrace._blocks import BLOCK, Room, room_for_blocks
from greybed.raytrace._bundle import MOST

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


class Work(NamedTuple):
    """Scratch of one thread, for tasks of up to so many rays and replicates."""

    raw: np.ndarray  # (6, rays): direction, place on the unit sphere
    single: np.ndarray  # (6 rays,) float32: the same by direction, in blocks
    rays: np.ndarray  # (6, rays): those that no neighbour has settled, places in metres
    order: np.ndarray  # (rays,) int32
    code: np.ndarray  # (rays,) int16
    fields: np.ndarray  # (4097,) int64
    distance: np.ndarray  # (rays,) float32, in radii
    nearest: np.ndarray  # (rays,) int32, neighbour
    waiting: np.ndarray  # (rays,) int32, rays that no neighbour has settled
    pending: np.ndarray  # (rays,) int64, their columns
    hit: np.ndarray  # (rays,) int64, their neighbour or -1
    met: np.ndarray  # (rays,) its distance [m]
    ahead: np.ndarray  # (rays,) how far they have come [m]
    bound: np.ndarray  # (rays,) how far they may go [m]
    wall: np.ndarray  # (rays,) int64, what is there, or -1
    key: np.ndarray  # (rays,) int64, what they meet
    room: Room
    keys: np.ndarray  # (2^k,) int64
    slots: np.ndarray  # (2^k,) int64, -1 where free
    places: np.ndarray  # (slots,) int64
    slot_of: np.ndarray  # (MOST,) int64
    counts: np.ndarray  # (slots, replicates) int32


@njit(**_OPTIONS)
def room_for_tasks(rays, replicates):
    """Scratch for tasks of up to ``rays`` rays."""
    most = rays + MOST
    size = 1
    while size < 2 * most:
        size *= 2
    padded = rays + BLOCK
    return Work(
        np.empty((6, padded)),
        np.empty(6 * padded, np.float32),
        np.empty((6, padded)),
        np.empty(padded, np.int32),
        np.empty(padded, np.int16),
        np.empty(4097, np.int64),
        np.empty(padded, np.float32),
        np.empty(padded, np.int32),
        np.empty(padded, np.int32),
        np.empty(padded, np.int64),
        np.empty(padded, np.int64),
        np.empty(padded),
        np.empty(padded),
        np.empty(padded),
        np.empty(padded, np.int64),
        np.empty(padded, np.int64),
        room_for_blocks(),
        np.empty(size, np.int64),
        np.full(size, -1, np.int64),
        np.empty(most, np.int64),
        np.empty(MOST, np.int64),
        np.empty((most, replicates), np.int32),
    )
