"""An experiment that is a Python function: ``function(parameters, seed, settings) -> measures``."""

from __future__ import annotations

import hashlib
import importlib
import os
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from greybed.calibration.experiment import Experiment, Measure, Value
from greybed.core.errors import InputError

HOW = "write it as function(parameters, seed, settings) -> a dict of measures"


class PythonExperiment(Experiment):
    """A function of a module.

    Parameters
    ----------
    name : str
        Of the experiment.
    function : str
        ``module:callable``.
    measures : mapping of str to Measure
        What it gives.
    folder : Path
        Where the module is looked for first.
    takes : tuple of str, optional
        Parameters that it knows; all by default.
    settings : mapping, optional
        Third argument of the function, as the study has it.

    Raises
    ------
    InputError
        If the function cannot be found.
    """

    def __init__(
        self, name: str, function: str, measures: Mapping[str, Measure], folder: Path,
        takes: tuple[str, ...] | None = None, settings: Mapping[str, Any] | None = None,
    ) -> None:  # fmt: skip
        self.name, self.function, self.measures = name, function, dict(measures)
        self.folder, self.takes, self.settings = str(folder.resolve()), takes, dict(settings or {})
        found = _find(self.function, self.folder)
        module = sys.modules[found.__module__]
        source = getattr(module, "__file__", None)
        self._source = hashlib.sha256(Path(source).read_bytes()).hexdigest() if source else ""

    def identity(self) -> Any:
        """See :meth:`Experiment.identity`: the function, its module's source, settings."""
        return ["python", self.function, self._source, self.settings, sorted(self.measures)]

    def run(self, values: Mapping[str, float], seed: int) -> dict[str, Value]:
        """See :meth:`Experiment.run`."""
        known = {k: v for k, v in values.items() if self.takes is None or k in self.takes}
        return dict(_find(self.function, self.folder)(known, seed, dict(self.settings)))


def _find(text: str, folder: str) -> Callable[..., Mapping[str, Value]]:
    if text.count(":") != 1:
        raise InputError(f"function = {text!r} must be 'module:callable', such as 'silo:run'.")
    module, name = text.split(":")
    sys.path.insert(0, folder)
    try:
        beside = os.path.join(folder, module.replace(".", os.sep) + ".py")
        loaded = sys.modules.get(module)
        origin = os.path.abspath(getattr(loaded, "__file__", None) or "")
        if loaded is not None and origin != beside and os.path.exists(beside):
            del sys.modules[module]  # another study's module of the same name
        importlib.invalidate_caches()
        found = getattr(importlib.import_module(module), name)
    except AttributeError:
        raise InputError(
            f"function = {text!r}: the module {module} has no {name}; mend the name."
        ) from None
    except Exception as error:
        raise InputError(
            f"function = {text!r}: the module cannot be loaded from {folder} "
            f"({type(error).__name__}: {error}); mend the module or the path."
        ) from error
    finally:
        sys.path.remove(folder)
    if not callable(found):
        raise InputError(f"function = {text!r} is not callable; {HOW}.")
    function: Callable[..., Mapping[str, Value]] = found
    return function
