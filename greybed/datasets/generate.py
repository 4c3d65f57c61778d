"""Random packings of spheres at an exact solid fraction, in periodic boxes and between walls."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError, VerificationError
from greybed.core.packing import Packing
from greybed.core.progress import progress
from greybed.core.sizes import Discrete, LogNormal, Mono, Sizes, Uniform, parse_sizes
from greybed.datasets import _kernels
from greybed.datasets.containers import (
    Box,
    Container,
    CylinderContainer,
    PeriodicBox,
    solid_fraction_between_walls,
    wall_overlap,
)

__all__ = [
    "Box",
    "CylinderContainer",
    "Discrete",
    "LogNormal",
    "Mono",
    "PeriodicBox",
    "Sizes",
    "Uniform",
    "parse_sizes",
    "random_packing",
    "solid_fraction_between_walls",
    "wall_overlap",
]

Array = NDArray[np.float64]

DENSEST = math.pi / math.sqrt(18.0)  # Kepler: no packing of equal spheres is denser [-]
MARGIN = 1e-4  # radii are inflated by this share, so that residual overlaps vanish with it [-]
GUARD = 1e-9  # gap kept by Monte-Carlo moves, for the rounding of centres [-]
STILL = 1e-3  # net force over contact force below which a bed counts as jammed [-]
STEP_LIMIT = 0.5  # largest FIRE time step, in units of sqrt(mass / stiffness) [-]
CHUNK = 100  # FIRE steps between two looks at the progress and at Ctrl-C [-]
STEPS = 40_000  # FIRE steps of one attempt [-]
STEPS_DEFLATED = 8_000  # and of each stage of a deflation [-]
TOP = 0.8  # fraction at which a deflation starts, jammed for all but very wide sizes [-]
MOST_SPHERES = 10**8  # of one packing: beyond, memory and patience end [-]
MOST_SWEEPS = 10**6
KICK = 5e-3  # random displacement at each stage of a deflation, in mean radii [-]


@dataclass(frozen=True, kw_only=True)
class _Setup:
    """One packing problem, in units of the mean radius."""

    radii: Array  # (n,), falling [-]
    metres: Array  # the same as they were asked for, (n,) [m]
    container: Container
    scale: float  # the mean radius [m]

    def lengths(self, fraction: float) -> Array:
        solid = float((4.0 / 3.0 * np.pi * self.radii**3).sum())
        return self.container.lengths(solid * self.scale**3 / fraction) / self.scale

    def cylinder(self, lengths: Array) -> float:
        round_wall = isinstance(self.container, CylinderContainer)
        return 0.5 * float(lengths[0]) if round_wall else 0.0

    def start(self, lengths: Array, rng: np.random.Generator) -> Array:
        """Independent points, uniform in the container, shape (n, 3)."""
        u = rng.random((len(self.radii), 3))
        radius = self.cylinder(lengths)
        if radius:
            rho, angle = radius * np.sqrt(u[:, 0]), 2.0 * np.pi * u[:, 1]
            u[:, 0] = 0.5 + rho * np.cos(angle) / lengths[0]
            u[:, 1] = 0.5 + rho * np.sin(angle) / lengths[1]
        return u * lengths


class _Relaxed(NamedTuple):
    done: bool
    centres: Array
    mean: float  # mean relative overlap of the pairs that overlap [-]


def _relax(
    setup: _Setup,
    x: Array,
    lengths: Array,
    steps: int,
    report: Callable[[float], None] = lambda done: None,
) -> _Relaxed:
    """Push overlapping spheres apart until none overlaps, or the bed is jammed."""
    x, v = x.copy(), np.zeros_like(x)
    fire = np.array([0.2 * STEP_LIMIT, 0.1, 0.0])
    # Overlaps of inflated spheres below this leave a small gap between the true ones.
    tolerance = 0.999 * MARGIN / (1.0 + MARGIN)
    first = mean = 0.0
    for _ in range(0, steps, CHUNK):
        status, worst, mean = _kernels.relax(
            x,
            v,
            setup.radii * (1.0 + MARGIN),
            lengths,
            np.array(setup.container.periodic),
            setup.cylinder(lengths),
            tolerance,
            STILL,
            STEP_LIMIT,
            fire,
            CHUNK,
        )
        if status != _kernels.RUNNING:
            return _Relaxed(status == _kernels.DONE, x, mean)
        first = first or worst
        report(math.log(first / worst) / math.log(max(first / tolerance, 1.0 + 1e-9)))
    return _Relaxed(False, x, mean)


def _deflate(
    setup: _Setup, wanted: float, rng: np.random.Generator, steps: int
) -> tuple[float, Array]:
    """Jam a bed far above ``wanted``, then deflate it until nothing overlaps (O'Hern et al. 2003).

    Returns the fraction reached [-] and the centres; the path down to it does not depend on
    ``wanted``, so asking for a fraction that was once reached succeeds.
    """
    fraction, cut = TOP if wanted < TOP else 0.5 * (1.0 + wanted), 2e-3
    lengths = setup.lengths(fraction)
    state = _relax(setup, setup.start(lengths, rng), lengths, steps)
    while not state.done:
        # In a jammed bed the mean overlap measures how far its fraction is too high; the growing
        # cut ends the search where that measure fails, between narrow walls.
        fraction *= (1.0 - cut) * (1.0 - min(state.mean, 0.1)) ** 3
        cut = min(1.3 * cut, 0.1)
        before, lengths = lengths, setup.lengths(fraction)
        # A small kick frees spheres that balance on top of each other.
        kick = KICK * (2.0 * rng.random(state.centres.shape) - 1.0)
        state = _relax(setup, state.centres * (lengths / before) + kick, lengths, steps)
    return fraction, state.centres


def _arrange(
    setup: _Setup, wanted: float, seed: int, report: Callable[[float], None]
) -> tuple[float, Array]:
    """Centres at the fraction ``wanted``, or the highest fraction reached [-] and its centres."""
    lengths = setup.lengths(wanted)
    rng = np.random.default_rng([seed, 0])
    direct = _relax(setup, setup.start(lengths, rng), lengths, STEPS, report)
    if direct.done:
        return wanted, direct.centres
    best, centres = 0.0, direct.centres
    # Small beds differ much from start to start, large ones hardly.
    for attempt in range(1, 1 + min(max(10_000 // len(setup.radii), 1), 8)):
        rng = np.random.default_rng([seed, attempt])
        reached, loose = _deflate(setup, wanted, rng, STEPS_DEFLATED)
        if reached >= wanted:
            apart = _relax(setup, loose * (lengths / setup.lengths(reached)), lengths, STEPS)
            if apart.done:
                return wanted, apart.centres
        if reached > best:
            best, centres = reached, loose
        if reached < wanted - 0.015:
            break
    return best, centres


def _shake(
    setup: _Setup,
    x: Array,
    lengths: Array,
    sweeps: int,
    rng: np.random.Generator,
    advance: Callable[[int], object],
) -> Array:
    """Hard-sphere Monte-Carlo sweeps, which keep every pair apart."""
    r = setup.radii * (1.0 + GUARD)
    periodic, cylinder = np.array(setup.container.periodic), setup.cylinder(lengths)
    x, step, skin = x.copy(), 0.1, 0.0
    at_list = x
    first = members = np.empty(0, np.int64)
    for _ in range(sweeps):
        moved = float(np.sqrt(((x - at_list) ** 2).sum(axis=1).max()))
        if 2.0 * (moved + math.sqrt(3.0) * step) > skin:
            _kernels.wrap(x, lengths, periodic)
            skin = 0.3 + 5.0 * step
            pairs = _kernels.neighbour_list(x, r, lengths, periodic, skin)
            first, members = _kernels.both_sides(*pairs)
            at_list = x.copy()
        uniforms = rng.random(x.shape)
        accepted = _kernels.sweep(x, r, lengths, periodic, cylinder, first, members, step, uniforms)
        # About 40 % of the moves accepted explores fastest.
        step = float(np.clip(step * (1.05 if accepted > 0.4 * len(x) else 0.95), 1e-5, 0.5))
        advance(1)
    return x


def _check(setup: _Setup, n: int, fraction: float) -> None:
    """Refuse what no run could reach, before any work."""
    mono = setup.radii[0] == setup.radii[-1]
    if mono and fraction >= DENSEST:
        raise InputError(
            f"solid fraction = {fraction:g} [-] exceeds {DENSEST:.4f}, the densest that equal "
            "spheres can be packed in any order, while a random packing reaches about 0.64 in a "
            "periodic box and less between walls; ask for at most 0.62."
        )
    lengths = setup.lengths(fraction)
    for axis, wraps in enumerate(setup.container.periodic):
        edge, largest = float(lengths[axis]) * setup.scale, float(setup.metres[0])
        # Below two diameters a sphere meets another one and that one's image at once.
        if wraps and edge < 4.0 * largest:
            needed = math.ceil(n * (4.0 * largest / edge) ** 3)
            raise InputError(
                f"n = {n} [-] at solid fraction {fraction:g} [-] makes a periodic edge of "
                f"{edge:.4g} [m] along {'xyz'[axis]}, below two diameters of the largest sphere, "
                f"{4.0 * largest:.4g} [m]; ask for at least {needed} spheres."
            )
        if edge < 2.0 * largest:
            raise InputError(
                f"n = {n} [-] at solid fraction {fraction:g} [-] makes {setup.container} of "
                f"{edge:.4g} [m] along {'xyz'[axis]}, too small for the largest sphere, diameter "
                f"{2.0 * largest:.4g} [m]; ask for more spheres or change the container's shape."
            )


def _verified(setup: _Setup, x: Array, lengths: Array, order: NDArray[np.int64]) -> Packing:
    """Packing in metres, measured once more by the code that every reader of it uses."""
    edges = lengths * setup.scale
    box = np.stack([np.zeros(3), edges])
    if isinstance(setup.container, CylinderContainer):
        box[:, :2] -= 0.5 * edges[:2]
    packing = Packing(
        x[order] * setup.scale + box[0],
        setup.metres[order],
        box,
        setup.container.periodic,
        setup.container.walls(edges),
        source="random packing",
    )
    deepest = max(packing.overlaps().largest, wall_overlap(packing))
    if deepest > 0.0:
        raise VerificationError(
            f"random packing: the deepest overlap is {deepest:.2g} of a radius where none was "
            "expected; please report the call, and change the seed meanwhile."
        )
    return packing


def random_packing(
    n: int,
    solid_fraction: float,
    sizes: Sizes,
    *,
    container: Container | None = None,
    seed: int = 0,
    shake: int = 0,
    show_progress: bool = False,
) -> Packing:
    r"""Random packing of ``n`` spheres without overlaps, at exactly ``solid_fraction``.

    Spheres start at independent random points of a container of the final size and push each
    other apart: the energy :math:`\tfrac12\sum(\text{overlap depth})^2` of pairs and walls falls
    by FIRE [1]_ until no overlap is left. Radii are 0.01 % larger meanwhile, so the result has
    none at all.

    Parameters
    ----------
    n : int
        Number of spheres, at least 1 (periodic: enough for edges of two diameters) [-].
    solid_fraction : float
        Sphere volume over container volume, in (0, 1) [-]. Equal spheres reach about 0.64 in a
        periodic box; walls lower, a spread of sizes raises it.
    sizes : Sizes
        ``Mono(radius)``, ``LogNormal``, ``Uniform`` or ``Discrete``, radii [m].
    container : PeriodicBox, Box or CylinderContainer, optional
        A cubic periodic box where none is given. Its size follows from the solid it holds.
    seed : int
        Start of the random numbers; the same seed gives the same bits [-].
    shake : int
        Hard-sphere Monte-Carlo sweeps afterwards, which part the spheres that just touch and
        lead, over some 300 sweeps, to the structure of a hard-sphere fluid (below 0.5) [-].
    show_progress : bool
        Draw a bar on standard error.

    Returns
    -------
    packing : Packing
        Verified: no pair, image or wall overlaps. Spheres come in random order.

    Raises
    ------
    InputError
        If the fraction is out of reach (the message names the one reached), or the container
        would be too small for the largest sphere.

    References
    ----------
    .. [1] Bitzek et al. (2006), Phys. Rev. Lett. 97, 170201, doi:10.1103/PhysRevLett.97.170201.

    Examples
    --------
    >>> packing = random_packing(500, 0.55, Mono(1.5e-3), seed=1)
    >>> len(packing), packing.overlaps().count, round(packing.solid_fraction, 12)
    (500, 0, 0.55)
    """
    if not 0.0 < solid_fraction < 1.0:
        raise InputError(
            f"solid fraction = {solid_fraction:g} [-] is outside (0, 1); give the sphere volume "
            "over the container volume, e.g. 0.6."
        )
    if n > MOST_SPHERES:
        raise InputError(
            f"n = {n} [-] exceeds {MOST_SPHERES}, more than a run of days; ask for fewer spheres "
            "and let the box repeat."
        )
    if not 0 <= shake <= MOST_SWEEPS:
        raise InputError(
            f"shake = {shake} [-] is outside 0 ... {MOST_SWEEPS}; give a number of sweeps, "
            "some 300 mix a bed."
        )
    if seed < 0:
        raise InputError(f"seed = {seed} [-] is below 0; give 0 or a positive integer.")
    radii = sizes.radii(n)[::-1]
    scale = float(radii.mean())
    setup = _Setup(
        radii=radii / scale, metres=radii, container=container or PeriodicBox(), scale=scale
    )
    _check(setup, n, solid_fraction)
    lengths = setup.lengths(solid_fraction)
    with progress(100, "packing", show=show_progress) as advance:
        shown = 0

        def report(done: float) -> None:
            nonlocal shown
            percent = max(int(100.0 * min(done, 1.0)), shown)
            advance(percent - shown)
            shown = percent

        reached, centres = _arrange(setup, solid_fraction, seed, report)
        report(1.0)
    if reached < solid_fraction:
        raise InputError(
            f"solid fraction = {solid_fraction:g} [-] is out of reach: {n} {sizes} in "
            f"{setup.container} reached {math.floor(1e3 * reached) / 1e3:.3f}; ask for at most "
            "that, or take a wider range of sizes or a larger container."
        )
    rng = np.random.default_rng([seed, 1_000_000])
    if shake:
        with progress(shake, "shaking", show=show_progress) as advance:
            centres = _shake(setup, centres, lengths, shake, rng, advance)
    return _verified(setup, centres, lengths, rng.permutation(n))
