"""Rigid bodies of a simulation: clumps that are put somewhere, and the arrays of their motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError
from greybed.dem import _step
from greybed.dem._rigid import Rigid
from greybed.dem.clump import Clump
from greybed.dem.materials import Material

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Clumps:
    """Clumps of one shape and one material, and where they are.

    Attributes
    ----------
    shape : Clump
        Their shape.
    centres : array_like, shape (k, 3)
        Centres of mass [m].
    orientations : array_like, shape (k, 4), optional
        Quaternions from the shape's frame to space, scalar first, of any length but 0; not turned
        by default [-].
    kind : int
        Number of their material.
    velocities, spins : array_like, shape (k, 3) or (3,), optional
        At the start, 0 by default [m/s], [1/s].
    """

    shape: Clump
    centres: ArrayLike
    orientations: ArrayLike | None = None
    kind: int = 0
    velocities: ArrayLike | None = None
    spins: ArrayLike | None = None


@dataclass(frozen=True)
class Bodies:
    """Rigid bodies of now, in the order of the input.

    Attributes
    ----------
    centres : ndarray, shape (b, 3)
        Centres of mass [m].
    quaternions : ndarray, shape (b, 4)
        From the principal axes to space, scalar first.
    velocities, spins : ndarray, shape (b, 3)
        In space [m/s], [1/s].
    masses : ndarray, shape (b,)
        Masses [kg].
    moments : ndarray, shape (b, 3)
        Principal moments of inertia [kg m2].
    momenta : ndarray, shape (b, 3)
        Angular momenta in space [kg m2/s].
    """

    centres: Array
    quaternions: Array
    velocities: Array
    spins: Array
    masses: Array
    moments: Array
    momenta: Array


def no_bodies() -> Rigid:
    """The arrays of none."""
    none = np.zeros(0, np.int64)
    return Rigid(
        np.zeros((0, 7)), np.zeros((0, 6)), np.zeros((0, 4)), np.zeros(1, np.int64), none,
        np.zeros((0, 3)), np.zeros((0, 3)),
    )  # fmt: skip


def bodies_of(
    clumps: Sequence[Clumps], materials: Sequence[Material], n: int, bodies: int
) -> tuple[_step.State, Rigid]:
    """Spheres of clumps, numbered from ``n`` on, and their bodies, numbered from ``bodies`` on."""
    parts = [_placed(group, materials) for group in clumps]
    parts = [part for part in parts if len(part[1].pose)]
    count, spheres = bodies, n
    states, rigids = [], []
    for (place, motion, kind, owner), rigid in parts:
        m = len(place)
        states.append(
            _step.State(
                place, motion, np.zeros((m, 8)), kind, place[:, :3].copy(), np.zeros(m, bool),
                owner + count,
            )
        )  # fmt: skip
        rigids.append(rigid._replace(member=rigid.member + spheres))
        spheres += m
        count += len(rigid.pose)
    if not rigids:
        return empty_state(), no_bodies()
    return joined_states(states), joined_bodies(rigids)


def empty_state() -> _step.State:
    """The arrays of no spheres."""
    none = np.zeros(0, np.int64)
    return _step.State(
        np.zeros((0, 4)), np.zeros((0, 8)), np.zeros((0, 8)), none, np.zeros((0, 3)),
        np.zeros(0, bool), none,
    )  # fmt: skip


def joined_states(states: Sequence[_step.State]) -> _step.State:
    """Spheres of several states, one after the other."""
    return _step.State(*(np.concatenate(arrays) for arrays in zip(*states, strict=True)))


def joined_bodies(rigids: Sequence[Rigid]) -> Rigid:
    """Bodies of several arrays, one after the other; their spheres are numbered already."""
    sizes = np.concatenate([np.diff(rigid.first) for rigid in rigids])
    whole = Rigid(*(np.concatenate(arrays) for arrays in zip(*rigids, strict=True)))
    return whole._replace(first=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64))


def chosen_bodies(rigid: Rigid, stays: NDArray[np.bool_]) -> Rigid:
    """Bodies without those that do not stay."""
    sizes = np.diff(rigid.first)
    spheres = np.repeat(stays, sizes)
    return Rigid(
        rigid.pose[stays], rigid.swing[stays], rigid.bulk[stays],
        np.concatenate([[0], np.cumsum(sizes[stays])]).astype(np.int64),
        rigid.member[spheres], rigid.offset[spheres], rigid.image[spheres],
    )  # fmt: skip


def sorted_bodies(rigid: Rigid, order: Index) -> Rigid:
    """Bodies in another order, ``order[new] = old``."""
    sizes = np.diff(rigid.first)[order]
    first = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    spheres = np.arange(first[-1]) + np.repeat(rigid.first[order] - first[:-1], sizes)
    return Rigid(
        rigid.pose[order], rigid.swing[order], rigid.bulk[order], first,
        rigid.member[spheres], rigid.offset[spheres], rigid.image[spheres],
    )  # fmt: skip


def shown(rigid: Rigid) -> Bodies:
    """What bodies are and do."""
    turn = turns(rigid.pose[:, 3:])
    momenta = rigid.swing[:, 3:]
    moments = rigid.bulk[:, 1:]
    return Bodies(
        rigid.pose[:, :3].copy(), rigid.pose[:, 3:].copy(), rigid.swing[:, :3].copy(),
        np.einsum("bij,bj->bi", turn, momenta / moments), rigid.bulk[:, 0].copy(), moments.copy(),
        np.einsum("bij,bj->bi", turn, momenta),
    )  # fmt: skip


def turns(quaternions: Array) -> Array:
    """Rotation matrices of unit quaternions, (b, 3, 3)."""
    w, x, y, z = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.array(rows).transpose(2, 0, 1)


def random_orientations(count: int, seed: int | Sequence[int]) -> Array:
    """Quaternions, evenly spread over all orientations (Shoemake 1992), shape (count, 4)."""
    drawn = np.random.default_rng(seed).standard_normal((count, 4))
    result: Array = drawn / np.sqrt((drawn**2).sum(axis=1, keepdims=True))
    return result


def _placed(
    group: Clumps, materials: Sequence[Material]
) -> tuple[tuple[Array, Array, Index, Index], Rigid]:
    shape, name = group.shape, group.shape.name
    at = np.array(group.centres, dtype=np.float64)
    if at.ndim != 2 or at.shape[1] != 3 or not np.isfinite(at).all():
        raise InputError(f"clump {name!r}: centres of shape {at.shape} must be (k, 3), finite [m].")
    k, m = len(at), len(shape.radii)
    if not 0 <= group.kind < len(materials):
        raise InputError(f"clump {name!r}: kind = {group.kind} is no number of a material.")
    given = np.array([1.0, 0, 0, 0]) if group.orientations is None else group.orientations
    q = np.broadcast_to(np.asarray(given, dtype=np.float64), (k, 4)).copy()
    size = np.sqrt((q**2).sum(axis=1))
    if not (np.isfinite(size).all() and (size > 0.0).all()):
        raise InputError(f"clump {name!r}: orientations must be finite quaternions other than 0.")
    q = _times(q / size[:, None], _quaternion(shape.axes))
    motions = []
    for what, values in (("velocities", group.velocities), ("spins", group.spins)):
        given = 0.0 if values is None else values
        array = np.broadcast_to(np.asarray(given, dtype=np.float64), (k, 3))
        if not np.isfinite(array).all():
            raise InputError(f"clump {name!r}: {what} must be finite.")
        motions.append(array)
    velocity, spin = motions
    density = materials[group.kind].density
    turn = turns(q)
    offset = shape.centres @ shape.axes
    moments = density * shape.moments
    # A spin in space is an angular momentum in the body.
    momentum = np.einsum("bji,bj->bi", turn, spin) * moments
    out = np.einsum("bij,mj->bmi", turn, offset)
    place = np.empty((k, m, 4))
    place[..., :3] = at[:, None] + out
    place[..., 3] = shape.radii
    motion = np.zeros((k, m, 8))
    motion[..., :3] = velocity[:, None] + np.cross(spin[:, None], out)
    motion[..., 3:6] = spin[:, None]
    # Contacts feel the whole body's mass behind a sphere.
    motion[..., 6] = density * shape.volume
    motion[..., 7] = 0.4 * motion[..., 6] * shape.radii**2
    rigid = Rigid(
        np.concatenate([at, q], axis=1), np.concatenate([velocity, momentum], axis=1),
        np.broadcast_to(np.append(density * shape.volume, moments), (k, 4)).copy(),
        m * np.arange(k + 1), np.arange(k * m), np.tile(offset, (k, 1)), np.zeros((k * m, 3)),
    )  # fmt: skip
    spheres = place.reshape(-1, 4), motion.reshape(-1, 8)
    return (*spheres, np.full(k * m, group.kind), np.repeat(np.arange(k), m)), rigid


def _quaternion(turn: Array) -> Array:
    """Unit quaternion of a rotation matrix, from its largest component (Shepperd 1978)."""
    trace = np.trace(turn)
    square = np.array([trace, turn[0, 0], turn[1, 1], turn[2, 2]])
    best = int(square.argmax())
    if best == 0:
        q = np.array([
            1.0 + trace, turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1],
        ])  # fmt: skip
    else:
        i = best - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        q = np.zeros(4)
        q[0] = turn[k, j] - turn[j, k]
        q[1 + i] = 1.0 + turn[i, i] - turn[j, j] - turn[k, k]
        q[1 + j] = turn[j, i] + turn[i, j]
        q[1 + k] = turn[k, i] + turn[i, k]
    result: Array = q / np.sqrt((q**2).sum())
    return result


def _times(p: Array, q: Array) -> Array:
    """Product of quaternions, (b, 4) times (4,)."""
    w, x, y, z = p.T
    a, b, c, d = q
    return np.stack(
        [
            w * a - x * b - y * c - z * d,
            w * b + x * a + y * d - z * c,
            w * c - x * d + y * a + z * b,
            w * d + x * c - y * b + z * a,
        ],
        axis=1,
    )
