"""Clump: spheres that are one rigid body, with its volume and moments of inertia."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError
from greybed.dem._union import column_moments

Array = NDArray[np.float64]

# Columns across the larger side of a union of spheres whose moments are integrated: right to 1e-5.
COLUMNS = 1000


@dataclass(frozen=True)
class Clump:
    """A shape that spheres stand for.

    Its spheres touch other bodies; mass and inertia are those of the shape itself, however many
    spheres it takes and however they overlap.

    Attributes
    ----------
    name : str
        For messages.
    centres : ndarray, shape (m, 3)
        Of the spheres, from the centre of mass, in the shape's own frame [m].
    radii : ndarray, shape (m,)
        Of the spheres, above 0 [m].
    volume : float
        Of the solid, above 0 [m3].
    inertia : ndarray, shape (3, 3)
        Of a solid of density 1, about the centre of mass, in the shape's frame [m5].
    shape_error : mapping of str to float
        How far the spheres are from the shape, where they only approach it.
    moments : ndarray, shape (3,)
        Principal moments of ``inertia`` [m5].
    axes : ndarray, shape (3, 3)
        Principal axes in the shape's frame, one in each column, right-handed.

    Raises
    ------
    InputError
        For numbers out of range.
    """

    name: str
    centres: Array
    radii: Array
    volume: float
    inertia: Array
    shape_error: dict[str, float] = field(default_factory=dict)
    moments: Array = field(init=False)
    axes: Array = field(init=False)

    def __post_init__(self) -> None:
        centres = np.array(self.centres, dtype=np.float64)
        radii = np.array(self.radii, dtype=np.float64)
        inertia = np.array(self.inertia, dtype=np.float64)
        good = centres.ndim == 2 and centres.shape[1:] == (3,) and radii.shape == centres.shape[:1]
        if not (good and len(radii) and np.isfinite(centres).all()):
            raise InputError(
                f"clump {self.name!r}: centres {centres.shape} and radii {radii.shape} must be "
                "(m, 3) and (m,), finite, m at least 1 [m]."
            )
        if not (np.isfinite(radii).all() and (radii > 0.0).all()):
            raise InputError(f"clump {self.name!r}: radii [m] must be finite and above 0.")
        symmetric = inertia.shape == (3, 3) and np.allclose(inertia, inertia.T)
        moments = np.linalg.eigvalsh(inertia) if symmetric else np.zeros(3)
        if not (self.volume > 0.0 and moments[0] > 0.0):
            raise InputError(
                f"clump {self.name!r}: volume = {self.volume:g} [m3] must be above 0, and the "
                "inertia symmetric with moments above 0 [m5]."
            )
        size = np.trace(inertia)
        off = inertia - np.diag(np.diag(inertia))
        if abs(off).max() < 1e-9 * size:
            moments, axes = np.diag(inertia).copy(), np.eye(3)
        else:
            moments, axes = np.linalg.eigh(inertia)
            axes[:, 2] *= np.sign(np.linalg.det(axes))
        for name, value in (
            ("centres", centres), ("radii", radii), ("inertia", inertia),
            ("moments", moments), ("axes", axes),
        ):  # fmt: skip
            object.__setattr__(self, name, value)

    @property
    def reach(self) -> float:
        """Radius of the sphere about the centre of mass that holds all of it [m]."""
        return float((np.sqrt((self.centres**2).sum(axis=1)) + self.radii).max())

    @property
    def equivalent_radius(self) -> float:
        """Radius of the sphere of the same volume [m]."""
        return float((0.75 * self.volume / np.pi) ** (1.0 / 3.0))


def sphere_union(
    centres: ArrayLike, radii: ArrayLike, *, name: str = "clump", columns: int = COLUMNS
) -> Clump:
    """Clump whose solid is the union of its spheres.

    Parameters
    ----------
    centres : array_like, shape (m, 3)
        In any frame; the clump's own begins at the centre of mass [m].
    radii : array_like, shape (m,)
        Above 0 [m].
    name : str
        For messages.
    columns : int
        Columns across the larger side, where spheres overlap: volume and inertia are right to about
        ``columns`` to the power of -1.5 [-].

    Returns
    -------
    Clump
        With the mass and inertia of what is inside one sphere or more, counted once.
    """
    x, r = np.array(centres, dtype=np.float64), np.array(radii, dtype=np.float64)
    if x.ndim != 2 or x.shape[1:] != (3,) or r.shape != x.shape[:1] or not (r > 0.0).all():
        raise InputError(
            f"clump {name!r}: centres {x.shape} and radii {r.shape} must be (m, 3) and (m,), the "
            "radii above 0 [m]."
        )
    away = np.sqrt(((x[:, None] - x[None]) ** 2).sum(axis=2))
    apart = away >= (r[:, None] + r[None]) * (1.0 - 1e-12)
    np.fill_diagonal(apart, True)
    if apart.all():
        part = 4.0 / 3.0 * np.pi * r**3
        first, second = part @ x, np.einsum("m,mi,mj->ij", part, x, x)
        second += np.eye(3) * float((part * r**2).sum()) / 5.0
        volume = float(part.sum())
    else:
        volume, first, second = column_moments(x, r, int(columns))
    middle = first / volume
    second = second - volume * np.outer(middle, middle)
    return Clump(name, x - middle, r, volume, np.eye(3) * np.trace(second) - second)
