"""Lists of near pairs and walls: made, renewed where particles have moved, histories kept."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError
from greybed.dem import _neighbours, _rigid, _step, _surfaces, _walls
from greybed.dem.bodies import chosen_bodies, joined_bodies, joined_states, sorted_bodies
from greybed.dem.crew import in_parts
from greybed.dem.skin import AT_START, best_skin

Array = NDArray[np.float64]
Index = NDArray[np.int64]

# Particles of a block: enough work for a thread, little enough to stay in its cache.
BLOCK = 2048
# Rows of wall forces that keep those of two blocks, which two threads write at once, from sharing
# a line of the cache: without them some runs took a fifth longer, by where memory happened to lie.
_APART = 2
# Cells over particles at most, for a few particles in a wide space.
MOST_CELLS = 8


class Lists:
    """Everything that depends on who is near whom.

    Attributes
    ----------
    state : State
        Particles, sorted by place at each :meth:`renew`.
    ident : (n,) int array
        Numbers of the input in this order.
    body_ident : (b,) int array
        The same of the bodies.
    near, surfaces
        Lists for the compiled steps.
    rigid : Rigid
        Bodies; their spheres are numbered as in ``state``.
    threads : int
        Threads that make the lists; they change no bit.
    skin, reach : float
        Gap up to which pairs are listed, and up to which they attract each other [m].
    radius : float or None
        Mean radius, by which the skin follows the speed of the particles [m]; None if it is given.
    listed_at : int
        Step at which the lists were made.
    wall_pace, wall_way : float
        Highest speed of a wall's surface [m/s] and its way since the lists were made [m].
    """

    def __init__(
        self,
        state: _step.State,
        rigid: _rigid.Rigid,
        walls: tuple[Index, Array, Index, Array],
        wall_kind: Index,
        columns: int,
        box: ArrayLike | None,
        periodic: tuple[bool, bool, bool],
        skin: float | None,
        reach: float,
    ) -> None:
        self.threads = 1
        n = len(state.place)
        radius = float(state.place[:, 3].mean())
        self.radius = radius if skin is None else None
        skin = reach + (AT_START * radius if skin is None else skin)
        self.state, self.rigid = state, rigid
        self.ident, self.body_ident = np.arange(n), np.arange(len(rigid.pose))
        self.skin, self.reach, self.columns = skin, reach, columns
        self.periodic = np.array(periodic, dtype=bool)
        self.wraps = bool(self.periodic.any())
        self.box = self._checked_box(box)
        # Only along periodic axes is it used; elsewhere no image is ever shifted.
        self.edge = np.where(self.periodic, self.box[1] - self.box[0], 0.0)
        if not skin > reach:
            raise InputError(f"skin = {skin - reach:g} [m] must be above 0.")
        none = np.zeros(0, np.int64)
        self.near = _step.Near(
            np.zeros(n + 1, np.int64), np.zeros(0, np.int32), *_pairs(0, columns), np.zeros((0, 6)),
            np.zeros(n + 1, np.int64), np.zeros(0, np.int32), np.zeros(0, np.int32), none,
        )  # fmt: skip
        kinds, data, wall, motion = walls
        self.surfaces = _step.Surfaces(
            kinds, data, wall, motion, wall_kind, np.zeros(n + 1, np.int64),
            np.zeros(0, np.int32), np.zeros(0, np.uint8), np.zeros((0, columns)),
            np.zeros((0, len(motion), 6)),
        )  # fmt: skip
        self._lay_blocks(n)
        self.listed_at, self.wall_way = 0, 0.0
        self.wall_pace = self.pace()

    def _lay_blocks(self, n: int) -> None:
        """Blocks for so many particles, and what has a row for each of them."""
        blocks = max(1, round(n / BLOCK))
        self.near = self.near._replace(block=_even(np.arange(n + 1), blocks))
        self.surfaces = self.surfaces._replace(
            force=np.zeros((blocks, len(self.surfaces.motion) + _APART, 6))
        )
        self.worst = np.zeros((blocks, 2))
        self.deepest = np.zeros((blocks, 2))

    def extend(self, step: int, more: _step.State, bodies: _rigid.Rigid) -> None:
        """Take in particles that touch nothing, numbered after those that are there."""
        m = len(more.place)
        self.ident = np.concatenate([self.ident, np.arange(m) + len(self.ident)])
        if len(self.state.outer):  # nothing pushes those that come, until it is said
            more = more._replace(outer=np.zeros((m, 6)))
        self.state = joined_states([self.state, more])
        new_bodies = np.arange(len(bodies.pose)) + len(self.rigid.pose)
        self.body_ident = np.concatenate([self.body_ident, new_bodies])
        self.rigid = joined_bodies([self.rigid, bodies])
        near, surfaces = self.near, self.surfaces
        self.near = near._replace(
            first=np.concatenate([near.first, np.full(m, near.first[-1])]),
            into=np.concatenate([near.into, np.full(m, near.into[-1])]),
        )
        self.surfaces = surfaces._replace(
            first=np.concatenate([surfaces.first, np.full(m, surfaces.first[-1])])
        )
        self.renew(step, np.ones(len(self.ident), dtype=bool))

    def drop_wall(self, step: int, wall: int) -> None:
        """Forget the surfaces of a wall; the others keep their numbers."""
        s = self.surfaces
        stays = s.wall != wall
        number = np.cumsum(stays) - 1
        # Contacts with what is gone: a number that no surface has.
        surface = np.where(stays[s.surface], number[s.surface], -1).astype(np.int32)
        self.surfaces = s._replace(
            kinds=s.kinds[stays], data=s.data[stays], wall=s.wall[stays], surface=surface
        )
        self.wall_pace = self.pace()
        self.renew(step)

    def _checked_box(self, box: ArrayLike | None) -> Array:
        if box is None:
            if self.wraps:
                raise InputError("a periodic simulation needs a box [m]; give its two corners.")
            return np.array([[-np.inf] * 3, [np.inf] * 3])
        given = np.array(box, dtype=np.float64)
        if given.shape != (2, 3) or not (given[1] > given[0]).all():
            raise InputError(f"box = {given.tolist()} must be a lower and an upper corner [m].")
        cell = 2.0 * float(self.state.place[:, 3].max()) + self.skin
        edge = given[1] - given[0]
        for axis in np.flatnonzero(self.periodic):
            if edge[axis] < 3.0 * cell:
                raise InputError(
                    f"the box is {edge[axis]:g} [m] long along {'xyz'[axis]}, less than three "
                    f"times the largest diameter and the skin, {3.0 * cell:g}; take a longer one."
                )
        return given

    def pace(self) -> float:
        """Highest speed at which a surface may come nearer to a particle [m/s]."""
        s, pace = self.surfaces, 0.0
        for k in range(len(s.kinds)):
            m = s.motion[s.wall[k]]
            spin, axis = float(np.linalg.norm(m[3:6])), s.data[k, 3:6]
            turned = s.kinds[k] != _surfaces.TRIANGLE and np.allclose(
                np.cross(axis, m[3:6]), 0.0, atol=1e-12 * max(spin, 1e-300)
            )
            away = m[6:9] - s.data[k, :3]
            if turned:  # about its own axis or normal: no nearer, if the axis goes through it
                across = away - (away @ axis) * axis
                turned = s.kinds[k] == _surfaces.PLANE or float(np.linalg.norm(across)) == 0.0
            far = float(np.linalg.norm(s.data[k, 10:13] - m[6:9])) + min(s.data[k, 9], 1e300)
            if math.isinf(s.data[k, 9]):
                place = self.state.place[:, :3] - m[6:9]
                far = 2.0 * float(np.sqrt((place**2).sum(axis=1)).max())
            pace = max(pace, float(np.linalg.norm(m[:3])) + (0.0 if turned else spin * far))
        return pace

    def fitting_skin(self, step: int) -> float:
        """The skin that the speed of the particles calls for at a step [m].

        At most twice the present one, or half of it: one fast particle says little of the others.
        """
        if self.radius is None:
            return self.skin
        way = 2.0 * math.sqrt(float(self.worst[:, 0].max())) + self.wall_way
        best = best_skin(way / max(step - self.listed_at, 1), self.radius)
        now = self.skin - self.reach
        # Across periodic faces pairs reach one cell far: three cells must find room.
        rooms = self.edge[self.periodic] / 3.0 - 2.0 * float(self.state.place[:, 3].max())
        return self.reach + min(max(best, 0.5 * now), 2.0 * now, *(rooms - self.reach).tolist())

    def renew(self, step: int, keep: NDArray[np.bool_] | None = None) -> None:
        """Sort the particles by place and list anew who is near whom, at a step.

        ``keep`` says which of them stay, in their present order; all by default. The loads stay,
        too: what touched a particle that goes gets half a kick from it yet.
        """
        old, near = self.state, self.near
        chosen = np.arange(len(old.place)) if keep is None else np.flatnonzero(keep)
        place = old.place[chosen]
        if self.wraps:
            _neighbours.wrap(place, self.box[0], self.edge, self.periodic)
        n = len(place)
        low, inverse, shape = self._grid(place)
        cell, key = np.empty(n, np.int64), np.empty(n, np.int64)
        _neighbours.cells_of(place, low, inverse, shape, cell)
        _neighbours.morton_keys(cell, shape, key)
        # Equal cells keep their order, so that equal states give equal orders.
        order = np.argsort(key, kind="stable")
        place, cell = place[order], cell[order]
        order = chosen[order]
        self.ident = self.ident[order]
        if keep is not None:
            # Numbers of the input without gaps, in the same order.
            self.ident = np.argsort(np.argsort(self.ident, kind="stable"), kind="stable")
            self._lay_blocks(n)
            near = self.near
        self.state = _step.State(
            place, old.motion[order], old.load[order], old.kind[order], place[:, :3].copy(),
            old.fixed[order], old.body[order],
            old.outer[order] if len(old.outer) else old.outer,
        )  # fmt: skip
        # Not only where they are made: particles come from several doors.
        self.state.load[:, 6:] = 1.0 / self.state.motion[:, 6:]
        if len(self.rigid.pose):
            self._renew_bodies(order, len(old.place))
        self._renew_pairs(near, order, cell, shape)
        self._renew_surfaces(order)
        self.listed_at, self.wall_way = step, 0.0

    def _renew_bodies(self, order: Index, before: int) -> None:
        """Spheres of the bodies where they are now; bodies without spheres are gone."""
        now = np.full(before, -1)
        now[order] = np.arange(len(order))
        rigid = self.rigid._replace(member=now[self.rigid.member])
        stays = rigid.member[rigid.first[:-1]] >= 0
        if not stays.all():
            rigid, left = chosen_bodies(rigid, stays), self.body_ident[stays]
            self.body_ident = np.argsort(np.argsort(left, kind="stable"), kind="stable")
        # By place, too: a body's spheres are then near the last one's in memory.
        by_place = np.argsort(rigid.member[rigid.first[:-1]], kind="stable")
        rigid = sorted_bodies(rigid, by_place)
        self.body_ident = self.body_ident[by_place]
        body = np.full(len(order), -1)
        body[rigid.member] = np.repeat(np.arange(len(rigid.pose)), np.diff(rigid.first))
        self.state = self.state._replace(body=body)
        if self.wraps and len(rigid.pose):
            _neighbours.wrap(rigid.pose, self.box[0], self.edge, self.periodic)
            _rigid.images_of(rigid, self.state.place, self.edge)
        self.rigid = rigid

    def _grid(self, place: Array) -> tuple[Array, Array, Index]:
        # Column by column: numpy takes ten times as long for both axes at once.
        ends = np.array([[place[:, k].min(), place[:, k].max()] for k in range(3)])
        low = np.where(self.periodic, self.box[0], ends[:, 0])
        high = np.where(self.periodic, self.box[1], ends[:, 1])
        cell = 2.0 * float(place[:, 3].max()) + self.skin
        edge = np.maximum(high - low, cell)
        most = MOST_CELLS * len(place) + 1000
        cell = max(cell, float(edge.prod() / most) ** (1.0 / 3.0))
        shape = np.maximum((edge / cell).astype(np.int64), 1)
        if self.wraps:
            shape = np.where(self.periodic, np.maximum(shape, 3), shape)
        return low, shape / edge, shape

    def _renew_pairs(self, near: _step.Near, order: Index, cell: Index, shape: Index) -> None:
        place = self.state.place
        n = len(place)
        start, member = np.empty(int(shape.prod()) + 1, np.int64), np.empty(n, np.int64)
        _neighbours.fill_cells(cell, start, member)
        first = np.empty(n + 1, np.int64)
        room = max(len(near.partner), 6 * n) // max(n, 1) + 1

        def listed(begin: int, end: int) -> tuple[slice, NDArray[np.int32], NDArray[np.uint8]]:
            most = room * (end - begin)
            while True:
                partner, shift = np.empty(most, np.int32), np.empty(most, np.uint8)
                found = _neighbours.list_pairs(
                    begin, end, place, self.state.body, cell, start, member, shape, self.periodic,
                    self.edge, self.skin, first, partner, shift,
                )  # fmt: skip
                if found >= 0:
                    return slice(begin, end), partner[:found], shift[:found]
                most = -found

        parts = in_parts(self.threads, n, listed)
        found = 0
        for owners, partner, _ in parts:
            first[owners] += found
            found += len(partner)
        first[n] = found
        _, _, touch, history, slot = _pairs(found, self.columns)
        # Copies, so that the room for the longest list so far is not kept twice.
        partner = np.concatenate([part[1] for part in parts])
        shift = np.concatenate([part[2] for part in parts])
        in_parts(
            self.threads, n,
            lambda begin, end: _neighbours.carry_over(
                begin, end, order, first, partner, near.first, near.partner, near.touch,
                near.history, touch, history,
            ),
        )  # fmt: skip
        into, slots = np.empty(n + 1, np.int64), np.empty(found, np.int32)
        # A particle counts as much as a listed pair: those of the first blocks own more pairs, and
        # blocks of equal numbers of particles would have one thread wait for another.
        block = _even(first + np.arange(n + 1), len(near.block) - 1)
        crossings = _neighbours.list_crossings(block, first, partner, slot, into, slots)
        owner = np.repeat(np.arange(n, dtype=np.int32), np.diff(first))
        self.near = _step.Near(
            first, owner, partner, shift, touch, history, slot, np.zeros((crossings, 6)), into,
            slots[:crossings].copy(),
            np.repeat(np.arange(n, dtype=np.int32), np.diff(into)), block,
        )  # fmt: skip

    def _renew_surfaces(self, order: Index) -> None:
        s = self.surfaces
        if not len(s.kinds):
            none = np.zeros(0, np.int32)
            self.surfaces = s._replace(
                first=np.zeros(len(order) + 1, np.int64), surface=none,
                touch=np.zeros(0, np.uint8), history=np.zeros((0, self.columns)),
            )  # fmt: skip
            return
        place = self.state.place
        first = np.empty(len(place) + 1, np.int64)
        room = max(len(s.surface), len(place))
        while True:
            surface = np.empty(room, np.int32)
            found = _walls.list_near(place, s.kinds, s.data, self.skin, first, surface)
            if found >= 0:
                break
            room = -found + -found // 20
        surface = surface[:found].copy()
        touch, history = np.empty(found, np.uint8), np.empty((found, self.columns))
        _walls.carry_over_walls(
            order, first, surface, s.first, s.surface, s.touch, s.history, touch, history
        )
        self.surfaces = s._replace(first=first, surface=surface, touch=touch, history=history)

    def pairs(self, chosen: NDArray[np.bool_]) -> Index:
        """Listed pairs that are chosen, (m, 2), in numbers of the input."""
        at = np.flatnonzero(chosen)
        low = self.near.owner[at]
        return np.stack([self.ident[low], self.ident[self.near.partner[at]]], axis=1)

    def touching(self) -> Index:
        """Pairs whose surfaces overlap now, (m, 2), whether or not their forces are known."""
        near, place = self.near, self.state.place
        low = near.owner
        shift = near.shift.astype(np.int64)
        images = np.stack([shift // 9, shift // 3 % 3, shift % 3], axis=1) - 1
        away = place[near.partner, :3] + images * self.edge - place[low, :3]
        both = place[low, 3] + place[near.partner, 3]
        return self.pairs((away**2).sum(axis=1) < both**2)

    @property
    def bytes(self) -> int:
        """Memory of state and lists [B]."""
        parts = (*self.state, *self.near, *self.surfaces, *self.rigid, self.ident)
        return sum(part.nbytes for part in parts)


def _even(work: Index, blocks: int) -> Index:
    """First particle of each block, with as much to do in one as in another.

    ``work`` (n + 1) is what there is to do before each particle, and in all.
    """
    return np.searchsorted(work, np.arange(blocks + 1) * work[-1] // blocks)


def _pairs(
    count: int, columns: int
) -> tuple[NDArray[np.int32], NDArray[np.uint8], NDArray[np.uint8], Array, NDArray[np.int32]]:
    return (
        np.empty(count, np.int32), np.empty(count, np.uint8), np.empty(count, np.uint8),
        np.empty((count, columns)), np.empty(count, np.int32),
    )  # fmt: skip
