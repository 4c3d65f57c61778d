"""What could explain a residual: named effects, powers of a covariate, offsets of a label."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from greybed.residual.effect import Effect
from greybed.residual.problem import Problem

Array = NDArray[np.float64]

# Prior shares of what may be missing from a model, all terms of a kind together: named effects
# first, then covariates that the model does not use, faulty labels, and last an unnamed law in a
# covariate that the model does use.
SHARE = {"effect": 0.60, "outside": 0.18, "label": 0.18, "inside": 0.04}
EXPONENTS = (-2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0)
POWER_SD = 0.5  # prior size of an unnamed dependence, of the transformed response
LABEL_SD = 0.3  # prior size of an offset
FORM = 0.10  # relative error of the shape of a published law, over the range of an experiment
OFF_THEORY = 0.05  # prior share of amplitudes that theory does not foresee
OFF_SPREAD = 0.8  # and their relative spread
ATOMS_PER_DECADE = 2.0


@dataclass(frozen=True)
class Atom:
    """One column with a Gaussian prior of its coefficient: a piece of a term."""

    column: Array  # (n,)
    mean: float
    sd: float
    log_weight: float
    exponent: float = 0.0


@dataclass(frozen=True)
class Term:
    """One candidate explanation.

    Attributes
    ----------
    kind : str
        ``effect``, ``outside`` or ``inside`` (power of a covariate), ``label``.
    name : str
        Effect, covariate or ``label=value``.
    log_prior : float
        Logarithm of the prior share.
    atoms : tuple of Atom
        Columns at the typical amplitude, in units of it.
    effect : Effect or None
        For kind ``effect``.
    spread : float
        Relative prior sd of the amplitude about theory, for these rows.
    basis : ndarray (n,) or None
        Covariate over its geometric mean, or the label's indicator.
    centre : float
        That geometric mean, or the root mean square where the covariate is not positive.
    linear : bool
        The covariate is not positive everywhere, so it has no powers but 1 and 2.
    """

    kind: str
    name: str
    log_prior: float
    atoms: tuple[Atom, ...]
    effect: Effect | None = None
    spread: float = 0.0
    basis: Array | None = None
    centre: float = 1.0
    linear: bool = False

    @property
    def size(self) -> int:
        """Coefficients of a nonlinear fit: an exponent besides the amplitude for a power."""
        return 2 if self.kind in ("outside", "inside") and not self.linear else 1

    def on(self, problem: Problem) -> Array:
        """The basis on the rows of a problem, shape (n,)."""
        if self.kind == "label":
            name, value = self.name.split("=", 1)
            return np.array([word == value for word in problem.labels[name]], dtype=np.float64)
        return problem.columns[self.name] / self.centre


def effect_column(problem: Problem, t: Array, effect: Effect, amplitude: float) -> Array:
    """Change of the transformed prediction per unit of ``amplitude`` / typical, shape (n,)."""
    change = problem.predict(t, {effect.name: amplitude}) - problem.predict(t, {})
    return change / (amplitude / effect.typical)


def _effect_atoms(problem: Problem, t: Array, effect: Effect) -> tuple[Atom, ...]:
    if effect.theory is not None:
        column = effect_column(problem, t, effect, effect.theory)
        if not np.isfinite(column).all():
            return ()
        return (
            Atom(column, 1.0, effect.spread, float(np.log(1.0 - OFF_THEORY))),
            Atom(column, 1.0, OFF_SPREAD, float(np.log(OFF_THEORY))),
        )
    small, large = effect.sizes
    count = max(2, int(np.ceil(ATOMS_PER_DECADE * np.log10(large / small))) + 1)
    sign = 1.0 if effect.low + effect.high > 0.0 else -1.0
    atoms = []
    width = np.log(large / small) / count
    for k in range(count):
        size = small * float(np.exp(width * (k + 0.5)))
        column = effect_column(problem, t, effect, sign * size)
        if np.isfinite(column).all():
            scaled = sign * size / effect.typical
            atoms.append(Atom(column, scaled, 0.6 * width * scaled, -float(np.log(count))))
    return tuple(atoms)


def power(basis: Array, exponent: float, reference: Array | None = None) -> Array:
    """basis^exponent over its root mean square on ``reference``; exponent 0 is the logarithm."""
    reference = basis if reference is None else reference
    if exponent == 0.0:  # the geometric mean of the reference is 1, so its logarithms average 0
        return np.log(basis) / max(float(np.sqrt(np.mean(np.log(reference) ** 2))), 1e-300)
    return basis**exponent / max(float(np.sqrt(np.mean(reference ** (2.0 * exponent)))), 1e-300)


def _power_term(kind: str, name: str, values: Array, log_prior: float) -> Term:
    if not (values > 0.0).all():
        # powers need positive numbers
        centre = float(np.sqrt(np.mean(values**2)))
        line = Atom(values / centre, 0.0, POWER_SD, 0.0, 1.0)
        return Term(
            kind, name, log_prior, (line,), basis=values / centre, centre=centre, linear=True
        )
    centre = float(np.exp(np.mean(np.log(values))))
    basis = values / centre
    share = -float(np.log(len(EXPONENTS)))
    atoms = tuple(Atom(power(basis, n), 0.0, POWER_SD, share, n) for n in EXPONENTS)
    return Term(kind, name, log_prior, atoms, basis=basis, centre=centre)


def _label_values(problem: Problem) -> list[tuple[str, str, Array]]:
    found = []
    # the error of a group is part of the noise already
    known = {*problem.study.group, problem.study.replicate}
    names = [n for n in (*problem.study.labels, *problem.labels) if n not in known]
    for name in dict.fromkeys(names):
        words = np.array(problem.labels[name])
        values, counts = np.unique(words, return_counts=True)
        if len(values) < 2 or len(values) > len(words) // 2:
            continue
        for value, count in zip(values, counts, strict=True):
            # the odd one out is in the minority; of two values each may be the faulty one
            if 2 <= count <= len(words) - 2 and (count <= len(words) / 2 or len(values) == 2):
                found.append((name, str(value), (words == value).astype(np.float64)))
    return found


def terms(problem: Problem, t: Array) -> tuple[list[Term], dict[str, str]]:
    """All terms that the columns allow, linearised at internal coordinates ``t``.

    Parameters
    ----------
    problem : Problem
        Rows and model.
    t : ndarray (p,)
        Parameters to linearise at.

    Returns
    -------
    terms : list of Term
        Named effects first.
    failed : dict of str to str
        Effects that the model cannot evaluate on these rows, with the reason.
    """
    wanted = problem.study.options.candidates
    effects: Mapping[str, Effect] = problem.model.effects
    chosen = [e for e in effects.values() if wanted is None or e.name in wanted]
    found: list[Term] = []
    failed: dict[str, str] = {}
    made = {}
    for effect in chosen:
        atoms = _effect_atoms(problem, t, effect)
        if not atoms:
            failed[effect.name] = "the model gives no number with it on some rows"
        elif max(float(np.abs(a.column).max()) for a in atoms) < 1e-12:
            failed[effect.name] = "it changes nothing at these conditions"
        else:
            made[effect.name] = (effect, atoms)
    for name, (effect, atoms) in made.items():
        prior = float(np.log(SHARE["effect"] / len(made)))
        found.append(Term("effect", name, prior, atoms, effect=effect, spread=effect.spread))
    covariates = problem.covariates()
    known = {*problem.used, *(c for e in effects.values() for c in e.columns)}
    for kind in ("outside", "inside"):
        names = [n for n in covariates if (n in known) == (kind == "inside")]
        for name in names:
            prior = float(np.log(SHARE[kind] / len(names)))
            found.append(_power_term(kind, name, covariates[name], prior))
    labels = _label_values(problem)
    for name, value, indicator in labels:
        prior = float(np.log(SHARE["label"] / len(labels)))
        atom = Atom(indicator, 0.0, LABEL_SD, 0.0)
        found.append(Term("label", f"{name}={value}", prior, (atom,), basis=indicator))
    return found, failed


def blurred(term: Term, visible: float) -> Term:
    """The term with its theory trusted as far as these rows can show it.

    Where recalibration absorbs all but a share ``visible`` of an effect, its amplitude hangs on
    the remaining curvature, and the error of the law's shape weighs as much more.
    """
    if term.effect is None or term.effect.theory is None:
        return term
    spread = float(np.hypot(term.effect.spread, FORM * np.sqrt(1.0 / visible**2 - 1.0)))
    near, *others = term.atoms
    return replace(term, spread=spread, atoms=(replace(near, sd=spread), *others))
