"""A grey-box term: a factor on a response in one dimensionless group, gated, sealed in one file."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError, VerificationError
from greybed.core.files import atomic_path

Array = NDArray[np.float64]

FORMAT = "greybed term 1"
GOLDEN = 16  # rows replayed on loading and in every export
TOLERANCE = 1e-12


@dataclass(frozen=True, kw_only=True)
class GreyBoxTerm:
    """``factor = (1 + gate)^side`` with ``gate = amplitude (z / reference)^exponent``.

    The gate is exactly 0, and the factor exactly 1, where the covariate vanishes (exponent above
    0) or grows without bound (below 0); the factor is positive everywhere. It describes a
    residual that no named effect explains, and names no cause.

    Attributes
    ----------
    name : str
        Of files and functions.
    covariate, unit : str, str
        What it depends on, in base SI.
    response : str
        What it multiplies.
    reference : float
        Value of the covariate that makes the group dimensionless; in ``unit``, above 0.
    amplitude : float
        Of the gate at the reference [-], at least 0.
    exponent : float
        [-], not 0.
    side : int
        1: adds to the response; -1: adds to its resistance.
    window : (float, float)
        Values of the covariate that it was fitted to, in ``unit``.
    card : dict
        Where it came from.
    """

    name: str
    covariate: str
    unit: str
    response: str
    reference: float
    amplitude: float
    exponent: float
    side: int
    window: tuple[float, float]
    card: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        finite = np.isfinite([self.reference, self.amplitude, self.exponent, *self.window]).all()
        if not (finite and self.reference > 0.0 and self.amplitude >= 0.0):
            raise InputError(
                f"term {self.name}: reference = {self.reference:g} must be above 0, amplitude = "
                f"{self.amplitude:g} [-] at least 0 and all numbers finite; fit it again."
            )
        if self.exponent == 0.0 or self.side not in (1, -1):
            raise InputError(
                f"term {self.name}: exponent = {self.exponent:g} [-] must not be 0, and side = "
                f"{self.side} [-] must be 1 or -1; fit it again."
            )

    def gate(self, values: ArrayLike) -> Array:
        """The gate [-] at values of the covariate, at least 0 [base SI], any shape."""
        group = np.asarray(values, dtype=np.float64) / self.reference
        if self.amplitude == 0.0:
            return np.zeros_like(group)
        with np.errstate(divide="ignore", over="ignore"):
            return np.asarray(self.amplitude * group**self.exponent)

    def evaluate(self, values: ArrayLike) -> Array:
        """The factor [-], above 0, at values of the covariate [base SI], any shape."""
        factor = 1.0 + self.gate(values)
        return factor if self.side > 0 else 1.0 / factor

    def inside(self, values: ArrayLike) -> NDArray[np.bool_]:
        """Whether values [base SI] lie in the window that the term was fitted to."""
        z = np.asarray(values, dtype=np.float64)
        return (z >= self.window[0]) & (z <= self.window[1])

    def golden_rows(self) -> tuple[Array, Array]:
        """Values of the covariate (16,) and factors (16,), the limit among them."""
        values = np.geomspace(*self.window, GOLDEN - 1) if self.window[0] > 0.0 else None
        if values is None:
            values = np.linspace(*self.window, GOLDEN - 1)
        limit = 0.0 if self.exponent > 0.0 else 1e300 * self.reference
        values = np.concatenate([[limit], values])
        return values, self.evaluate(values)

    def content_hash(self) -> str:
        """SHA-256 over everything that decides an answer; the same in every export."""
        numbers = (self.reference, self.amplitude, self.exponent, float(self.side))
        text = " ".join([FORMAT, self.covariate, self.response, *(x.hex() for x in numbers)])
        return hashlib.sha256(text.encode()).hexdigest()

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the term to one JSON file, whole or not at all."""
        values, factors = self.golden_rows()
        content = {
            "format": FORMAT,
            "term": asdict(self),
            "hash": self.content_hash(),
            "golden": {"values": values.tolist(), "factors": factors.tolist()},
        }
        with atomic_path(path) as temporary:
            temporary.write_text(json.dumps(content, indent=1) + "\n")
        return Path(path)


def is_term(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins like a saved term."""
    try:
        with open(path, "rb") as stream:
            return FORMAT.encode() in stream.read(80)
    except OSError:
        return False


def load_term(path: str | os.PathLike[str]) -> GreyBoxTerm:
    """Read a term, check its hash and replay its golden rows.

    Raises
    ------
    InputError
        If the file is not a term.
    VerificationError
        If it was changed, or answers differently here.
    """
    try:
        content = json.loads(Path(path).read_text())
        table = dict(content["term"])
        low, high = (float(x) for x in table["window"])
        table |= {name: str(table[name]) for name in ("name", "covariate", "unit", "response")}
        table |= {name: float(table[name]) for name in ("reference", "amplitude", "exponent")}
        term = GreyBoxTerm(**{**table, "window": (low, high), "side": int(table["side"])})
        golden = content["golden"]
        values, factors = (np.array(golden[k], dtype=np.float64) for k in ("values", "factors"))
        if values.shape != factors.shape or values.ndim != 1 or not len(values):
            raise ValueError("golden rows of another shape")
        sealed = content["hash"]
    except OSError as error:
        reason = error.strerror or error
        raise InputError(f"{path}: cannot read this term ({reason}); check the path.") from None
    except InputError:
        raise
    except (LookupError, TypeError, ValueError, ArithmeticError, RecursionError) as error:
        raise InputError(
            f"{path}: not a grey-box term ({type(error).__name__}: {error}); make one with greybed "
            "diagnose."
        ) from None
    with np.errstate(all="ignore"):  # what is not finite is no golden row
        off = np.abs(term.evaluate(values) - factors)
    if sealed != term.content_hash() or not (off <= TOLERANCE * factors).all():
        raise VerificationError(
            f"{path}: the term was changed (its hash or its golden rows do not match); copy it "
            "again or run greybed diagnose again."
        )
    return term
