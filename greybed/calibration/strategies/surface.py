"""Response surface: a design, surrogates, then runs where the answer is undecided."""

from __future__ import annotations

from greybed.calibration.acquisition import choose, quick_posterior, surrogate_share
from greybed.calibration.designs import first_design
from greybed.calibration.search import Search


def response_surface(search: Search) -> None:
    """Spend the runs of a study on a first design and on what :func:`choose` asks for."""
    o, space = search.study.options, search.study.space
    points = first_design(o.design, search.first_points(), len(space), o.seed)
    search.everywhere(space.from_prior(points), o.replicates)
    refine(search)


def refine(search: Search) -> None:
    """Choose runs by the surrogates until none are left or they would change little."""
    o = search.study.options
    while search.left > 0:
        model = search.fit()
        spent = search.campaign.spent
        if o.stop > 0.0:
            share = surrogate_share(model, quick_posterior(model, o.seed + spent))
            if share < o.stop:
                search.notes.append(
                    f"The search ended after {spent} of {o.runs} runs: surrogate errors are "
                    f"{100.0 * share:.0f} % of the variances at most (stop = {o.stop:g})."
                )
                return
        chosen = choose(model, o.seed + spent, min(o.batch, search.left))
        done: dict[tuple[str, bytes], int] = {}
        wanted = []
        for name, u in chosen:
            # A point that is chosen again is a replicate.
            named = tuple(search.study.space.named(u).items())
            before = sum(
                job.experiment == name and job.values == named
                for job, _ in search.campaign.finished
            )
            key = (name, u.tobytes())
            wanted.append((name, u, before + done.get(key, 0)))
            done[key] = done.get(key, 0) + 1
        search.make(wanted)
