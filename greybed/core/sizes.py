"""Size distributions of spheres, sampled by stratified quantiles, and their command-line text."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from statistics import NormalDist
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError
from greybed.core.packing import RADII

Array = NDArray[np.float64]

FORMS = (
    "mono:1.5mm, lognormal:1.5mm,1.3, uniform:1mm,2mm, rosin-rammler:1.5mm,3, "
    "discrete:1mm=0.3,2mm=0.7 or quantiles:D10=2mm,D50=3mm,D90=4mm"
)


def _check_positive(value: float, what: str, unit: str) -> None:
    if not (math.isfinite(value) and value > 0.0):
        raise InputError(
            f"{what} = {value:g} [{unit}] must be finite and above 0; give a positive number."
        )
    if unit == "m" and not RADII[0] <= value <= RADII[1]:
        raise InputError(
            f"{what} = {value:g} [m] is outside {RADII[0]:g} ... {RADII[1]:g}; check its unit."
        )


class Sizes(ABC):
    """A distribution of radii; :meth:`radii` gives any number of spheres, always the same ones.

    Sphere i of n takes the quantile (i + 1/2)/n, so that even a small packing has the moments of
    the distribution and two packings differ only in where the spheres lie.
    """

    @abstractmethod
    def quantiles(self, p: Array) -> Array:
        """Radius below which the share ``p`` (n,) in (0, 1) of all spheres lies, shape (n,) [m]."""

    def radii(self, n: int) -> Array:
        """Radii of ``n`` spheres in rising order, shape (n,) [m].

        Raises
        ------
        InputError
            If ``n`` is below 1, or too small for the distribution.
        """
        if n < 1:
            raise InputError(f"number of spheres = {n} [-] must be at least 1; raise it.")
        return self.quantiles((np.arange(n) + 0.5) / n)

    def sampled(self, n: int, rng: np.random.Generator) -> Array:
        """Radii of ``n`` spheres drawn at random, shape (n,) [m]."""
        return self.quantiles(rng.uniform(1e-9, 1.0 - 1e-9, n))

    def by_mass(self, share: float) -> float:
        """Radius below which a share of the mass lies: 0.1, 0.5, 0.9 for half of D10, D50, D90 [m].

        Raises
        ------
        InputError
            If the share is not between 0 and 1.
        """
        if not 0.0 < share < 1.0:
            raise InputError(f"share = {share:g} [-] must be above 0 and below 1.")
        radii = self.quantiles((np.arange(20_000) + 0.5) / 20_000)
        mass = np.cumsum(radii**3)
        return float(radii[np.searchsorted(mass, share * mass[-1])])


@dataclass(frozen=True)
class Mono(Sizes):
    """Equal spheres."""

    radius: float  # [m]

    def __post_init__(self) -> None:
        _check_positive(self.radius, "radius", "m")

    def quantiles(self, p: Array) -> Array:
        """Radius at each share ``p``, shape (n,) [m]."""
        return np.full(len(p), self.radius)

    def __str__(self) -> str:
        return f"equal spheres of radius {self.radius:g} m"


@dataclass(frozen=True)
class Uniform(Sizes):
    """Radii spread evenly, by number, between two bounds."""

    smallest: float  # [m]
    largest: float  # [m]

    def __post_init__(self) -> None:
        _check_positive(self.smallest, "smallest radius", "m")
        _check_positive(self.largest, "largest radius", "m")
        if self.largest < self.smallest:
            raise InputError(
                f"largest radius = {self.largest:g} [m] is below the smallest, "
                f"{self.smallest:g} [m]; exchange them."
            )

    def quantiles(self, p: Array) -> Array:
        """Radius at each share ``p``, shape (n,) [m]."""
        return self.smallest + (self.largest - self.smallest) * p

    def __str__(self) -> str:
        return f"spheres of radius {self.smallest:g} to {self.largest:g} m"


@dataclass(frozen=True)
class LogNormal(Sizes):
    """Log-normal radii, by number, truncated at ``cut`` standard deviations on either side.

    The radii span ``median * geometric_sd**(-cut)`` to ``median * geometric_sd**cut``.
    """

    median: float  # [m]
    geometric_sd: float  # exp of the standard deviation of ln(radius), at least 1 [-]
    cut: float = 2.5  # [-]

    def __post_init__(self) -> None:
        _check_positive(self.median, "median radius", "m")
        _check_positive(self.cut, "cut", "-")
        if not 1.0 <= self.geometric_sd <= 3.0:
            raise InputError(
                f"geometric standard deviation = {self.geometric_sd:g} [-] is outside [1, 3]; "
                "1 means equal spheres, 1.3 a broad powder."
            )

    def quantiles(self, p: Array) -> Array:
        """Radius at each share ``p``, shape (n,) [m]."""
        normal = NormalDist()
        tail = normal.cdf(-self.cut)
        deviates = [normal.inv_cdf(tail + (1.0 - 2.0 * tail) * float(q)) for q in p]
        return self.median * np.exp(math.log(self.geometric_sd) * np.array(deviates))

    def __str__(self) -> str:
        return (
            f"log-normal spheres of median radius {self.median:g} m and geometric standard "
            f"deviation {self.geometric_sd:g}"
        )


@dataclass(frozen=True)
class RosinRammler(Sizes):
    """Mass above radius r: exp(-(r / scale)^spread), between the mass shares 1 and 99 %.

    Rosin & Rammler, J. Inst. Fuel 7 (1933) 29.
    """

    scale: float  # radius above which 36.8 % of the mass lies [m]
    spread: float  # the larger, the narrower, 1 to 20 [-]

    def __post_init__(self) -> None:
        _check_positive(self.scale, "scale radius", "m")
        if not 1.0 <= self.spread <= 20.0:
            raise InputError(
                f"spread = {self.spread:g} [-] is outside [1, 20]; ground solids have 1 to 4."
            )

    def quantiles(self, p: Array) -> Array:
        """Radius at each share ``p``, shape (n,) [m]."""
        # Shares of the mass, each with its radius; a share of mass has the number over r^3.
        mass = 0.01 + 0.98 * (np.arange(4096) + 0.5) / 4096
        radii = self.scale * (-np.log1p(-mass)) ** (1.0 / self.spread)
        number = np.cumsum(radii**-3.0)
        return np.interp(p, (number - 0.5 * radii**-3.0) / number[-1], radii)

    def __str__(self) -> str:
        return f"Rosin-Rammler spheres of scale radius {self.scale:g} m and spread {self.spread:g}"


@dataclass(frozen=True)
class MassQuantiles(Sizes):
    """Diameters that 10, 50 and 90 % of the mass lie below, as a sieve or a laser tells them.

    Log-normal by mass in two halves: ln d is linear in the normal deviate of the mass share from
    D10 to D50 and beyond, and from D50 to D90 and beyond, so that all three come back; with
    D50^2 = D10 D90 it is one log-normal law (Hatch & Choate, J. Franklin Inst. 207 (1929) 369). The
    outermost percent of the mass on either side has the size of its edge.
    """

    d10: float  # [m]
    d50: float  # [m]
    d90: float  # [m]

    def __post_init__(self) -> None:
        for name in ("d10", "d50", "d90"):
            _check_positive(0.5 * getattr(self, name), f"half of {name.upper()}", "m")
        if not self.d10 <= self.d50 <= self.d90:
            raise InputError(
                f"D10 = {self.d10:g}, D50 = {self.d50:g} and D90 = {self.d90:g} [m] must rise; "
                "exchange them."
            )
        if self.d90 > 20.0 * self.d10:
            raise InputError(
                f"D90 = {self.d90:g} [m] is more than 20 times D10 = {self.d10:g} [m]; cut the "
                "fines off, they cannot be simulated beside the rest."
            )

    def quantiles(self, p: Array) -> Array:
        """Radius at each share ``p`` of the number, shape (n,) [m]."""
        mass = (np.arange(4096) + 0.5) / 4096
        normal = NormalDist()
        known = [normal.inv_cdf(q) for q in (0.01, 0.1, 0.5, 0.9, 0.99)]
        low, middle, high = (math.log(0.5 * d) for d in (self.d10, self.d50, self.d90))
        ends = [
            middle + (low - middle) * known[0] / known[1],
            middle + (high - middle) * known[4] / known[3],
        ]
        deviates = np.array([normal.inv_cdf(float(q)) for q in mass])
        radii = np.exp(np.interp(deviates, known, [ends[0], low, middle, high, ends[1]]))
        number = np.cumsum(radii**-3.0)
        return np.interp(p, (number - 0.5 * radii**-3.0) / number[-1], radii)

    def __str__(self) -> str:
        return f"spheres of D10 {self.d10:g}, D50 {self.d50:g} and D90 {self.d90:g} m by mass"


@dataclass(frozen=True)
class Discrete(Sizes):
    """A few radii, each with its share of the mass (equal densities) or of the number."""

    sizes: tuple[float, ...]  # radii [m]
    shares: tuple[float, ...]  # sum 1 [-]
    by: Literal["mass", "number"] = "mass"

    def __post_init__(self) -> None:
        if not self.sizes or len(self.sizes) != len(self.shares):
            raise InputError(
                f"{len(self.sizes)} radii come with {len(self.shares)} shares; "
                "give one share for each radius."
            )
        for radius, share in zip(self.sizes, self.shares, strict=True):
            _check_positive(radius, "radius", "m")
            _check_positive(share, f"share of radius {radius:g} m", "-")
        if abs(sum(self.shares) - 1.0) > 1e-3:
            raise InputError(
                f"shares sum to {sum(self.shares):g} [-], not 1; give the fractions of all "
                f"radii by {self.by}."
            )
        if self.by not in ("mass", "number"):
            raise InputError(f"by = {self.by!r} is unknown; choose 'mass' or 'number'.")

    @property
    def number_shares(self) -> Array:
        """Share of the number of spheres that each radius has, sum 1 [-]."""
        shares = np.array(self.shares)
        if self.by == "mass":
            shares = shares / np.array(self.sizes) ** 3
        return shares / shares.sum()

    def quantiles(self, p: Array) -> Array:
        """Radius at each share ``p``, shape (n,) [m]."""
        order = np.argsort(self.sizes, kind="stable")
        edges = np.cumsum(self.number_shares[order])[:-1]
        return np.array(self.sizes)[order][np.searchsorted(edges, p, side="right")]

    def radii(self, n: int) -> Array:
        """Radii of ``n`` spheres in rising order, counts rounded by largest remainder [m].

        Raises
        ------
        InputError
            If a size would not appear even once.
        """
        if n < 1:
            return super().radii(n)
        wanted = n * self.number_shares
        counts = np.floor(wanted).astype(np.int64)
        for i in np.argsort(counts - wanted, kind="stable")[: n - int(counts.sum())]:
            counts[i] += 1
        if (counts == 0).any():
            i = int(wanted.argmin())
            needed = math.ceil(1.0 / float(self.number_shares.min()))
            raise InputError(
                f"among {n} spheres none has radius {self.sizes[i]:g} [m], whose share of the "
                f"number is {self.number_shares[i]:.3g}; ask for at least {needed} spheres."
            )
        return np.sort(np.repeat(np.array(self.sizes), counts))

    def __str__(self) -> str:
        return "spheres of radius " + ", ".join(f"{radius:g}" for radius in self.sizes) + " m"


def _number(text: str, what: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise InputError(f"{what} {text.strip()!r} is not a number; write e.g. 0.3.") from None


def _mono(words: list[str], length: Callable[[str], float]) -> Sizes:
    (radius,) = words
    return Mono(length(radius))


def _lognormal(words: list[str], length: Callable[[str], float]) -> Sizes:
    median, sd = words
    return LogNormal(length(median), _number(sd, "geometric standard deviation"))


def _rosin_rammler(words: list[str], length: Callable[[str], float]) -> Sizes:
    scale, spread = words
    return RosinRammler(length(scale), _number(spread, "spread"))


def _uniform(words: list[str], length: Callable[[str], float]) -> Sizes:
    smallest, largest = words
    return Uniform(length(smallest), length(largest))


def _discrete(words: list[str], length: Callable[[str], float]) -> Sizes:
    pairs = [word.split("=") for word in words]
    sizes = tuple(length(radius) for radius, _ in pairs)
    return Discrete(sizes, tuple(_number(share, "mass fraction") for _, share in pairs))


def _quantiles(words: list[str], length: Callable[[str], float]) -> Sizes:
    pairs = dict(word.split("=") for word in words)
    known = {name.strip().lower(): length(size) for name, size in pairs.items()}
    if len(words) != 3 or set(known) != {"d10", "d50", "d90"}:
        raise ValueError
    return MassQuantiles(**known)


_PARSERS = {
    "mono": _mono, "lognormal": _lognormal, "uniform": _uniform, "discrete": _discrete,
    "rosin-rammler": _rosin_rammler, "quantiles": _quantiles,
}  # fmt: skip


def parse_sizes(text: str) -> Sizes:
    """Read a size distribution from command-line text.

    Parameters
    ----------
    text : str
        ``mono:RADIUS``, ``lognormal:MEDIAN,GEOMETRIC_SD``, ``uniform:SMALLEST,LARGEST``,
        ``rosin-rammler:RADIUS,SPREAD``, ``discrete:RADIUS=MASS_FRACTION,...`` or
        ``quantiles:D10=DIAMETER,D50=DIAMETER,D90=DIAMETER`` (by mass); every length with its unit.

    Raises
    ------
    InputError
        If the text has another form, a unit is missing or is no length, or a value is out of
        range.
    """
    from greybed.core.units import parse_quantity

    kind, _, rest = text.partition(":")
    parser = _PARSERS.get(kind.strip().lower())
    if parser is None or not rest.strip():
        raise InputError(f"sizes {text!r} are not understood; write e.g. {FORMS}.")

    def length(word: str) -> float:
        return parse_quantity(word, "length", f"sizes {text!r}")

    try:
        return parser(rest.split(","), length)
    except InputError:
        raise
    except ValueError:  # a wrong number of words
        raise InputError(f"sizes {text!r} are not understood; write e.g. {FORMS}.") from None
