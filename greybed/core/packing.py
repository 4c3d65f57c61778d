"""Packing: centres, radii, box, periodicity and walls of a bed of spheres; checked once, SI."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError
from greybed.core.walls import Wall

Array = NDArray[np.float64]

# Radii whose fourth powers, times any number of spheres, stay far from the ends of doubles [m].
RADII = (1e-30, 1e30)
# Spacing of the numbers around a coordinate, over the radius: beyond, results are noise [-].
RESOLUTION = 1e-3


@dataclass(frozen=True)
class Overlaps:
    """Pairs of spheres that overlap, with their depth.

    Attributes
    ----------
    pairs : (m, 2) int array
        Indices of the two spheres.
    depth : (m,) float array
        r_i + r_j - distance [m], above zero.
    relative : (m,) float array
        Depth over the smaller radius [-].
    """

    pairs: NDArray[np.int64]
    depth: Array
    relative: Array

    @property
    def count(self) -> int:
        """Number of overlapping pairs [-]."""
        return len(self.depth)

    @property
    def largest(self) -> float:
        """Largest depth over the smaller radius [-]; 0 where nothing overlaps."""
        return float(self.relative.max(initial=0.0))


def check_spheres(
    centres: Array,
    radii: Array,
    box: Array | None,
    periodic: tuple[bool, bool, bool],
    place: Callable[[int], str],
) -> None:
    """Refuse what no later step could use; ``place(i)`` says where sphere ``i`` was read.

    Raises
    ------
    InputError
        For a coordinate that is not finite, a radius that is not finite and above zero, or a
        centre outside the box in a direction that is not periodic.
    """
    bad = ~np.isfinite(centres)
    if bad.any():
        i, axis = np.argwhere(bad)[0]
        raise InputError(
            f"{place(int(i))}: {'xyz'[axis]} = {centres[i, axis]} [m] is not finite; every "
            "coordinate must be a finite number: mend or remove this sphere."
        )
    bad_radius = ~(np.isfinite(radii) & (radii > 0.0))
    if bad_radius.any():
        i = int(bad_radius.argmax())
        raise InputError(
            f"{place(i)}: radius = {radii[i]:g} [m] must be finite and above 0; "
            "mend or remove this sphere."
        )
    odd = (radii < RADII[0]) | (radii > RADII[1])
    if odd.any():
        i = int(odd.argmax())
        raise InputError(
            f"{place(i)}: radius = {radii[i]:g} [m] is outside {RADII[0]:g} ... {RADII[1]:g}; "
            "check its unit."
        )
    coarse = np.spacing(np.abs(centres).max(axis=1)) > RESOLUTION * radii
    if coarse.any():
        i = int(coarse.argmax())
        raise InputError(
            f"{place(i)}: coordinates up to {np.abs(centres[i]).max():g} [m] leave a sphere of "
            f"radius {radii[i]:g} [m] known to less than {RESOLUTION:g} of it; move the origin "
            "to the bed."
        )
    if box is None:
        return
    for axis in range(3):
        if periodic[axis]:
            continue
        low, high = box[:, axis]
        # Dumps carry six digits: a centre on the face must not fail for its rounding.
        slack = 1e-5 * (high - low)
        out = (centres[:, axis] < low - slack) | (centres[:, axis] > high + slack)
        if out.any():
            i = int(out.argmax())
            raise InputError(
                f"{place(i)}: {'xyz'[axis]} = {centres[i, axis]:g} [m] is outside the box "
                f"[{low:g}, {high:g}] [m]; widen the box, make this direction periodic, or "
                "remove the sphere."
            )


def _as_box(box: ArrayLike | None) -> Array | None:
    if box is None:
        return None
    array = np.array(box, dtype=np.float64)
    if array.shape == (3,):
        array = np.stack([np.zeros(3), array])
    if array.shape != (2, 3):
        raise InputError(
            f"box has shape {array.shape}; give lengths (3,) or lower and upper corner (2, 3) [m]."
        )
    if not np.isfinite(array).all() or (array[1] <= array[0]).any():
        raise InputError(
            f"box from {array[0].tolist()} to {array[1].tolist()} [m] is empty or not finite; "
            "each upper bound must exceed its lower bound."
        )
    return array


@dataclass(frozen=True, eq=False)
class Packing:
    """A bed of spheres.

    Parameters
    ----------
    centres : array_like, shape (n, 3)
        Sphere centres [m]. Wrapped into the box along periodic directions.
    radii : array_like, shape (n,) or scalar
        Radii, above zero [m].
    box : array_like, shape (3,) or (2, 3), optional
        Edge lengths, or lower and upper corner [m]. Required where a direction is periodic.
    periodic : three bools
        Which directions repeat.
    walls : sequence of walls
        What bounds the bed or stands in it; see :mod:`greybed.core.walls`.
    source : str
        Where the packing came from (a file name, a generator), for messages and reports.

    Raises
    ------
    InputError
        If shapes disagree, a number is not finite, a radius is not above zero, a centre is
        outside the box in a direction that is not periodic, or a sphere does not fit a periodic
        box (diameter above the edge).

    Notes
    -----
    Overlaps are allowed, measured by :meth:`overlaps`, and treated by each consumer as it
    documents; see ``docs/overlaps.md``.
    """

    centres: Array
    radii: Array
    box: Array | None = None
    periodic: tuple[bool, bool, bool] = (False, False, False)
    walls: tuple[Wall, ...] = ()
    source: str = field(default="packing", kw_only=True)

    def __init__(
        self,
        centres: ArrayLike,
        radii: ArrayLike,
        box: ArrayLike | None = None,
        periodic: tuple[bool, bool, bool] = (False, False, False),
        walls: tuple[Wall, ...] | list[Wall] = (),
        *,
        source: str = "packing",
    ) -> None:
        c = np.array(centres, dtype=np.float64, ndmin=2, order="C")
        if c.ndim != 2 or c.shape[1:] != (3,) or len(c) == 0:
            raise InputError(
                f"{source}: centres have shape {c.shape}; give (n, 3) with n >= 1, in metres."
            )
        r = np.array(np.broadcast_to(np.asarray(radii, dtype=np.float64), (len(c),)))
        b = _as_box(box)
        p0, p1, p2 = (bool(v) for v in periodic)
        if b is None and (p0 or p1 or p2):
            raise InputError(f"{source}: periodic = {periodic} needs a box; give box=lengths [m].")
        check_spheres(c, r, b, (p0, p1, p2), lambda i: f"{source}: sphere {i}")
        if b is not None:
            for axis, wraps in enumerate((p0, p1, p2)):
                if not wraps:
                    continue
                low, edge = b[0, axis], b[1, axis] - b[0, axis]
                if 2.0 * r.max() > edge:
                    raise InputError(
                        f"{source}: diameter {2.0 * r.max():g} [m] exceeds the periodic edge "
                        f"{edge:g} [m] along {'xyz'[axis]}; enlarge the box."
                    )
                # Only those outside: wrapping what is inside already would change its last digit.
                out = (c[:, axis] < low) | (c[:, axis] >= low + edge)
                wrapped = low + (c[out, axis] - low) % edge
                c[out, axis] = np.where(wrapped >= b[1, axis], low, wrapped)
        for array in (c, r, b):
            if array is not None:
                array.setflags(write=False)
        object.__setattr__(self, "centres", c)
        object.__setattr__(self, "radii", r)
        object.__setattr__(self, "box", b)
        object.__setattr__(self, "periodic", (p0, p1, p2))
        object.__setattr__(self, "walls", tuple(walls))
        object.__setattr__(self, "source", source)

    def __setstate__(self, state: dict[str, Any]) -> None:
        # Arrays of a copy come writable, and kernels would be compiled once more for that.
        self.__dict__.update(state)
        for array in (self.centres, self.radii, self.box):
            if array is not None:
                array.setflags(write=False)

    def __len__(self) -> int:
        return len(self.radii)

    def __repr__(self) -> str:
        kind = "mono" if self.is_monodisperse else "polydisperse"
        return f"Packing({len(self)} spheres, {kind}, periodic={self.periodic}, {self.source!r})"

    @property
    def n_walls(self) -> int:
        """Number of walls [-]."""
        return len(self.walls)

    @property
    def is_monodisperse(self) -> bool:
        """Whether all radii are equal."""
        return bool(self.radii.min() == self.radii.max())

    @cached_property
    def areas(self) -> Array:
        """Sphere surfaces 4 pi r^2, shape (n,) [m2]."""
        return 4.0 * np.pi * self.radii**2

    @property
    def sphere_volume(self) -> float:
        """Sum of the sphere volumes; an overlap counts twice [m3]."""
        return float((4.0 / 3.0 * np.pi * self.radii**3).sum())

    @property
    def edges(self) -> Array:
        """Box edge lengths, shape (3,) [m]; of all spheres where no box is given."""
        low, high = self.bounds
        return high - low

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Lower and upper corner of the box, or of the spheres where no box is given [m]."""
        if self.box is not None:
            return self.box[0], self.box[1]
        r = self.radii[:, None]
        return (self.centres - r).min(axis=0), (self.centres + r).max(axis=0)

    @property
    def solid_fraction(self) -> float:
        """Sphere volume over the volume of the box [-].

        Meaningful for boxes that the bed fills; for a settled bed in a tall box use a local one.
        """
        return self.sphere_volume / float(np.prod(self.edges))

    def neighbours(self, gap: float) -> tuple[NDArray[np.int64], Array]:
        """Pairs i < j whose surfaces are closer than ``gap``, nearest images.

        Parameters
        ----------
        gap : float
            Largest distance between the surfaces [m]; 0 gives the overlapping pairs.

        Returns
        -------
        pairs : (m, 2) int array
            Indices, each pair once, sorted.
        distance : (m,) array
            Distance of the centres [m].
        """
        from greybed.core.pairs import close_pairs

        low, _ = self.bounds
        period = np.where(self.periodic, self.edges, 0.0)
        pairs = close_pairs(self.centres - low, self.radii, period, gap)
        delta = self.centres[pairs[:, 1]] - self.centres[pairs[:, 0]]
        safe = np.where(period > 0.0, period, 1.0)
        delta -= np.where(period > 0.0, period * np.round(delta / safe), 0.0)
        distance = np.sqrt((delta**2).sum(axis=1))
        keep = distance < self.radii[pairs].sum(axis=1) + gap
        return pairs[keep], distance[keep]

    def overlaps(self) -> Overlaps:
        """Measure the overlapping pairs (nearest images)."""
        pairs, distance = self.neighbours(0.0)
        depth = self.radii[pairs].sum(axis=1) - distance
        return Overlaps(pairs, depth, depth / self.radii[pairs].min(axis=1))
