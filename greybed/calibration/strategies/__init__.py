"""Strategies: which runs are made."""

from collections.abc import Callable

from greybed.calibration.search import Search
from greybed.calibration.strategies.direct import bayesian_optimisation, cma_es
from greybed.calibration.strategies.screening import screening
from greybed.calibration.strategies.sequential import sequential
from greybed.calibration.strategies.surface import response_surface

# Names as studies give them; the keys are those of greybed.calibration.study.STRATEGIES.
BY_NAME: dict[str, Callable[[Search], None]] = {
    "response-surface": response_surface,
    "direct-cma": cma_es,
    "direct-bayes": bayesian_optimisation,
    "sequential": sequential,
    "screening": screening,
}
