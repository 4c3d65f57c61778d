"""Pictures of a bed, cut open and coloured by a value per sphere, made with our own ray tracer."""

from __future__ import annotations

import math
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.colors import ListedColormap
from numpy.typing import ArrayLike, NDArray

from greybed.core import InputError, Packing
from greybed.raytrace import first_hits

Array = NDArray[np.float64]

# Perceptually uniform; the ends are cut off because black and white spheres lose their shading.
HEAT = ListedColormap(matplotlib.colormaps["inferno"](np.linspace(0.22, 0.97, 256)), "heat")
# For differences: colour-blind safe, grey-white where nothing differs.
DIFFERENCE = ListedColormap(
    matplotlib.colormaps["RdBu_r"](np.linspace(0.06, 0.94, 256)), "difference"
)
# Rays per pixel along each edge.
SUPERSAMPLING = 2
# Shading: what a surface keeps when it looks away from the light, and deep in a gap.
DIMMEST = 0.62
DARKEST_GAP = 0.5
_LIGHT = np.array([-0.45, 0.62, 0.64])  # right, up and towards the eye, as the eye sees it
# Directions, in the frame of a surface, along which its surroundings are felt for.
_FEELERS = 6


@dataclass(frozen=True)
class View:
    """Where the eye stands.

    Attributes
    ----------
    azimuth : float
        Direction from the bed to the eye around the vertical z axis, -90 looks along y [deg].
    elevation : float
        Height of the eye above the horizon [deg].
    distance : float
        From the centre of the bed to the eye, in half diagonals of the bed; infinite for an
        orthographic picture [-].
    """

    azimuth: float = -90.0
    elevation: float = 20.0
    distance: float = 5.0

    def frame(self) -> Array:
        """Unit vectors to the right, up and towards the eye, shape (3, 3) [-]."""
        a, e = math.radians(self.azimuth), math.radians(self.elevation)
        eye = np.array([math.cos(a) * math.cos(e), math.sin(a) * math.cos(e), math.sin(e)])
        right = np.array([-math.sin(a), math.cos(a), 0.0])
        return np.stack([right, np.cross(eye, right), eye])


@dataclass(frozen=True)
class _Camera:
    """A view made to fit spheres: image coordinates u, v are slopes or, orthographic, metres."""

    frame: Array
    middle: Array
    distance: float
    low: Array
    high: Array

    @classmethod
    def around(cls, view: View, centres: Array, radii: Array) -> _Camera:
        low = (centres - radii[:, None]).min(axis=0)
        high = (centres + radii[:, None]).max(axis=0)
        middle = 0.5 * (low + high)
        distance = view.distance * 0.5 * float(np.linalg.norm(high - low))
        frame = view.frame()
        seen = (centres - middle) @ frame.T
        depth = distance - seen[:, 2] if math.isfinite(distance) else np.ones(len(seen))
        u, r = seen[:, :2] / depth[:, None], (radii / depth)[:, None]
        low2, high2 = (u - 1.01 * r).min(axis=0), (u + 1.01 * r).max(axis=0)
        return cls(frame, middle, distance, low2, high2)

    def rays(self, width: int, height: int) -> tuple[Array, Array]:
        """Origins and directions through the middle of every pixel, row by row from the top."""
        size = self.high - self.low
        pixel = float(max(size[0] / width, size[1] / height))
        middle = 0.5 * (self.low + self.high)
        u = middle[0] + pixel * (np.arange(width) + 0.5 - width / 2)
        v = middle[1] - pixel * (np.arange(height) + 0.5 - height / 2)
        uv = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
        across = uv @ self.frame[:2]
        if math.isfinite(self.distance):
            directions = across - self.frame[2]
            origins = np.broadcast_to(self.middle + self.distance * self.frame[2], across.shape)
        else:
            origins = self.middle + across + 1e3 * float(size.max()) * self.frame[2]
            directions = np.broadcast_to(-self.frame[2], across.shape)
        return origins, directions


@dataclass(frozen=True)
class Sight:
    """What the eye sees of a bed: traced once, painted as often as there are values to show."""

    shape: tuple[int, int]  # rows and columns of the picture [pixels]
    shown: NDArray[np.bool_]  # which spheres of the packing are left after the cut, shape (n,)
    met: NDArray[np.bool_]  # rays that meet one of them, by subpixel
    owner: NDArray[np.int64]  # whom those meet, an index among the shown
    shade: Array  # how bright each meets it [-]

    def paint(
        self,
        values: ArrayLike,
        *,
        limits: tuple[float, float] | None = None,
        colours: ListedColormap = HEAT,
    ) -> NDArray[np.uint8]:
        """Picture, shape (height, width, 4), coloured by one value per sphere of the packing.

        Raises
        ------
        InputError
            If there is not one value per sphere.
        """
        v = np.asarray(values, dtype=np.float64)
        if v.shape != self.shown.shape:
            raise InputError(
                f"values have shape {v.shape}; give one per sphere, {self.shown.shape}."
            )
        rgba = np.zeros((len(self.met), 4))
        colour = colour_of(v[self.shown], limits, colours)[self.owner]
        rgba[self.met, :3] = colour * self.shade[:, None]
        rgba[self.met, 3] = 1.0
        n, (height, width) = SUPERSAMPLING, self.shape
        rgba = rgba.reshape(height, n, width, n, 4).mean(axis=(1, 3))
        rgba[..., :3] /= np.maximum(rgba[..., 3:], 1e-9)
        return np.round(255.0 * np.clip(rgba, 0.0, 1.0)).astype(np.uint8)


def look_at(
    packing: Packing,
    *,
    width: int = 600,
    height: int | None = None,
    view: View | None = None,
    cut: bool = True,
    stage: ArrayLike | None = None,
) -> Sight:
    """Trace what the eye sees of a bed; the options are those of :func:`bed_picture`."""
    if width < 1 or (height is not None and height < 1):
        raise InputError(f"a picture of {width} x {height} pixels is empty; give at least 1 x 1.")
    view = view or View()
    shown = in_view(packing, view) if cut else np.ones(len(packing), dtype=bool)
    bed = Packing(packing.centres[shown], packing.radii[shown], source=packing.source)
    camera = _Camera.around(view, bed.centres, bed.radii)
    if stage is not None:
        box = np.asarray(stage, dtype=np.float64)
        corners = np.stack(np.meshgrid(*box.T, indexing="ij"), axis=-1).reshape(-1, 3)
        camera = _Camera.around(view, corners, np.zeros(len(corners)))
    if height is None:
        size = camera.high - camera.low
        height = max(1, round(width * float(size[1] / size[0])))
    n = SUPERSAMPLING
    origins, directions = camera.rays(n * width, n * height)
    distance, owner = first_hits(bed, origins, directions)
    met = owner >= 0
    along = directions[met] / np.linalg.norm(directions[met], axis=1, keepdims=True)
    points = origins[met] + distance[met, None] * along
    owner = owner[met]
    normals = (points - bed.centres[owner]) / bed.radii[owner, None]
    shade = _light(normals, camera.frame) * _openness(bed, points, normals)
    return Sight((height, width), shown, met, owner, shade)


def bed_picture(
    packing: Packing,
    values: ArrayLike,
    *,
    width: int = 600,
    height: int | None = None,
    view: View | None = None,
    cut: bool = True,
    limits: tuple[float, float] | None = None,
    colours: ListedColormap = HEAT,
    stage: ArrayLike | None = None,
) -> NDArray[np.uint8]:
    """Picture of a bed coloured by a value per sphere, on a transparent ground.

    Parameters
    ----------
    packing : Packing
        The bed, its axis along z; its walls are left out, its box is not repeated.
    values : array_like, shape (n,)
        What to colour by, in any unit; grey where not finite.
    width, height : int
        Of the picture; without a height it is as high as the bed needs [pixels].
    view : View, optional
        Where the eye stands; the picture is filled whatever the distance.
    cut : bool
        Leave out the spheres whose centre lies in the half in front of the axis.
    limits : two floats, optional
        Values at the ends of the colours; otherwise those of ``values``.
    colours : colormap
        Colours from the lower to the upper limit.
    stage : array_like, shape (2, 3), optional
        Corners of a box that fills the picture, for frames of a film; else the spheres do [m].

    Returns
    -------
    array of uint8, shape (height, width, 4)
        Red, green, blue and opacity; colours are straight, not multiplied by the opacity.

    Raises
    ------
    InputError
        If there is not one value per sphere, or the size is below one pixel.
    """
    sight = look_at(packing, width=width, height=height, view=view, cut=cut, stage=stage)
    return sight.paint(values, limits=limits, colours=colours)


def in_view(packing: Packing, view: View) -> NDArray[np.bool_]:
    """Which spheres stay when the half of the bed that faces the eye is taken away."""
    a = math.radians(view.azimuth)
    facing = packing.centres[:, :2] @ np.array([math.cos(a), math.sin(a)])
    r = packing.radii
    middle = 0.5 * float((facing - r).min() + (facing + r).max())
    behind = facing <= middle
    return behind if behind.any() else np.ones(len(packing), dtype=bool)


def value_limits(*values: ArrayLike) -> tuple[float, float]:
    """Lowest and highest finite value of all arrays together, apart by more than zero."""
    v = np.concatenate([np.ravel(np.asarray(a, dtype=np.float64)) for a in values])
    v = v[np.isfinite(v)]
    low, high = (float(v.min()), float(v.max())) if v.size else (0.0, 1.0)
    return (low, high) if high > low else (low - 0.5, high + 0.5)


def colour_of(
    values: ArrayLike, limits: tuple[float, float] | None = None, colours: ListedColormap = HEAT
) -> Array:
    """Red, green and blue of each value, shape (n, 3) [-]."""
    v = np.asarray(values, dtype=np.float64)
    low, high = limits or value_limits(v)
    share = np.clip((v - low) / (high - low), 0.0, 1.0)
    rgb = np.asarray(colours(np.nan_to_num(share)), dtype=np.float64)[:, :3]
    rgb[~np.isfinite(v)] = 0.6
    return rgb


def _light(normals: Array, frame: Array) -> Array:
    """Lambert shading that fades softly into the side away from the light, at most 1."""
    towards = normals @ (_LIGHT @ frame) / float(np.linalg.norm(_LIGHT))
    wrapped = np.clip(0.5 + 0.5 * towards, 0.0, 1.0)
    return DIMMEST + (1.0 - DIMMEST) * wrapped**1.4


def _openness(bed: Packing, points: Array, normals: Array) -> Array:
    """Ambient light: how far a surface point sees before it meets the next sphere."""
    reach = 2.0 * float(bed.radii.mean())
    start = points + 1e-6 * reach * normals
    helper = np.where(np.abs(normals[:, :1]) < 0.9, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    side = np.cross(normals, helper)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    other = np.cross(normals, side)
    # Turned from pixel to pixel so that the few directions do not show as bands.
    turn = 2.0 * np.pi * np.random.default_rng(0).random(len(points))
    total = np.zeros(len(points))
    for k in range(_FEELERS):
        phi = turn + 2.0 * np.pi * k / _FEELERS
        tilt = math.sqrt((k + 0.5) / _FEELERS)
        direction = tilt * (np.cos(phi)[:, None] * side + np.sin(phi)[:, None] * other)
        direction += math.sqrt(1.0 - tilt**2) * normals
        distance, _ = first_hits(bed, start, direction)
        total += np.minimum(distance / reach, 1.0)
    return DARKEST_GAP + (1.0 - DARKEST_GAP) * total / _FEELERS
