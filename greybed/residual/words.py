"""The verdict in words, and what a reader should know besides."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from greybed.residual.study import Study

if TYPE_CHECKING:
    from greybed.residual.choice import Choice
    from greybed.residual.look import Look


def _set(names: tuple[str, ...]) -> str:
    return " + ".join(names) if names else "nothing"


def sentence(answer: Mapping[str, Any]) -> str:
    """One sentence that says what was found."""
    verdict = answer["verdict"]
    error = answer["error"]
    change = (
        f"the held-out error ({error.metric}) goes from {error.base.value:.3g} to "
        f"{error.with_effect.value:.3g}"
    )
    if verdict == "none":
        relative = answer["detectable"].get("relative", float("nan"))
        size = f"{relative:.2g}" if answer["transform"] == "linear" else f"{100 * relative:.2g} %"
        if not relative > 0.0:
            return "Nothing is missing that these rows show; no named effect was a candidate."
        return f"Nothing is missing: an effect of {size} of the response would have been seen."
    if verdict == "not-identifiable":
        return (
            "These data cannot show any of the candidate effects, because recalibrating the "
            "parameters would absorb them; measure a parameter independently."
        )
    if verdict == "ambiguous":
        rivals = " or ".join(_set(names) for names in answer["rivals"])
        return f"Something is missing, and these data cannot tell which: {rivals}."
    if verdict == "suspect-data":
        found = answer["suspect"]
        return (
            f"The residual follows {found['label']} = {found['value']} rather than physics: check "
            f"that {found['label']} before looking for an effect."
        )
    if verdict == "unknown":
        if not answer["depends_on"]:
            return (
                "The scatter is certainly larger than stated and follows nothing that was "
                "recorded: something that varies was not written down, or the stated noise is "
                "too small."
            )
        parts = [f"{d.covariate}^{d.exponent:.2g}" for d in answer["depends_on"]]
        named = [e.name for e in answer["effects"]]
        also = f" besides {_set(tuple(named))}" if named else ""
        return (
            f"Something outside the catalogue is missing{also}: it goes with "
            f"{' and '.join(parts)}; with it, {change}."
        )
    names = _set(tuple(e.name for e in answer["effects"]))
    return f"The model lacks {names}; with it, {change}."


def remarks(
    study: Study, seen: Look, choice: Choice | None, answer: Mapping[str, Any]
) -> tuple[str, ...]:
    """What did not fit elsewhere."""
    said = []
    if choice is not None and choice.remainder is not None:
        said.append(
            f"A small remainder follows {choice.remainder.name}; it is within what the form of "
            "the named effect is known to, so it is not called another effect."
        )
    if seen.excess is not None:
        said.append(
            f"The random scatter is {seen.excess:.2g} times the stated one; it was estimated from "
            "the rows instead."
        )
    if seen.screened.varies_with is not None:
        said.append(f"The random error varies with {seen.screened.varies_with}; rows are weighted.")
    for effect in answer["effects"]:
        theory = effect.theory
        if theory is not None and not effect.ci95[0] <= theory <= effect.ci95[1]:
            said.append(
                f"The amplitude of {effect.name} differs from theory ({theory:.3g}) by more than "
                "its interval."
            )
    if seen.problem.defining:
        said.append(
            f"The response was computed from {' and '.join(seen.problem.defining)}, so "
            "they were left aside."
        )
    constant = [
        name
        for name, column in study.table.columns.items()
        if name != study.response and len(set(column.tolist())) == 1
    ]
    if constant:
        said.append(
            f"{', '.join(constant)} did not vary, so nothing can be traced to "
            f"{'it' if len(constant) == 1 else 'them'} alone."
        )
    return tuple(said)
