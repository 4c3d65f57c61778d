"""Runs exported closures: compiles the header, opens the graph, replays the golden rows."""

from __future__ import annotations

import io
import os
import shlex
import shutil
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.closures import content_hash, golden_rows
from greybed.closures.artifact import Closure
from greybed.closures.viewfactor import Prediction
from greybed.core import InputError, RangeError, VerificationError
from greybed.core.files import output_folder

Array = NDArray[np.float64]

CPP_TOLERANCE = 1e-12
# Runtimes have their own exp and tanh; double precision leaves about 1e-14.
ONNX_TOLERANCE = 1e-6


class Exported(Protocol):
    """An exported closure that answers as the closure itself does."""

    hash: str
    marker_names: tuple[str, ...]

    def predict(self, **markers: ArrayLike) -> Any:
        """What the closure's own ``predict`` gives."""
        ...


def find_compiler() -> list[str] | None:
    """The C++ compiler as words of a command: ``CXX`` if set, else g++, clang++ or c++."""
    chosen = shlex.split(os.environ.get("CXX", ""))
    for words in [chosen] if chosen else [["g++"], ["clang++"], ["c++"]]:
        if shutil.which(words[0]):
            return words
    return None


def compile_cpp(
    header: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    flags: Sequence[str] = ("-std=c++11", "-O2"),
) -> Path:
    """Compile the test program of an exported header.

    Parameters
    ----------
    header : path
        What :func:`greybed.export.export_cpp` returned; ``NAME_test.cpp`` stands beside it.
    folder : path
        Where the program goes.
    flags : sequence of str
        Options of the compiler.

    Returns
    -------
    program : Path

    Raises
    ------
    InputError
        If there is no C++ compiler.
    VerificationError
        If the compiler refuses the header.
    """
    compiler = find_compiler()
    if compiler is None:
        raise InputError(
            f"no C++ compiler found (CXX = {os.environ.get('CXX', '')!r}, g++, clang++, c++); "
            "install one or set CXX to its path."
        )
    source = Path(header).resolve()
    source = source.with_name(f"{source.stem}_test.cpp")
    program = output_folder(folder).resolve() / source.stem
    command = [*compiler, *flags, str(source), "-o", str(program)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        lines = [line for line in done.stderr.splitlines() if "error" in line] or [done.stderr]
        raise VerificationError(
            f"{source}: {compiler[0]} {' '.join(flags)} refuses it: {lines[0].strip()}; "
            "try other flags or another compiler in CXX."
        )
    return program


def _flat(
    names: tuple[str, ...], markers: Mapping[str, ArrayLike]
) -> tuple[list[Array], tuple[int, ...]]:
    if set(names) != set(markers):
        raise RangeError(
            f"this closure takes the markers {', '.join(names)}, not "
            f"{', '.join(markers) or 'none'}; name each of them once."
        )
    arrays = np.broadcast_arrays(*(np.asarray(markers[n], dtype=np.float64) for n in names))
    return [np.ascontiguousarray(a).ravel() for a in arrays], arrays[0].shape


class CompiledProgram:
    """The compiled test program of an exported closure.

    Parameters
    ----------
    program : path
        What :func:`compile_cpp` returned.

    Attributes
    ----------
    name, hash : str
        As the program says them.
    marker_names : tuple of str
        Markers in the order of the header's arguments.
    failing_rows : int
        What the header's ``self_test()`` returned: zero means sound.
    """

    def __init__(self, program: str | os.PathLike[str]) -> None:
        self.program = Path(program)
        done = subprocess.run([self.program], capture_output=True, text=True)
        facts = dict(line.split(" ", 1) for line in done.stdout.splitlines() if " " in line)
        try:
            self.name, self.hash = facts["name"], facts["hash"]
            self.marker_names = tuple(facts["markers"].split(","))
            self.failing_rows = int(facts["failing"].split()[0])
        except (KeyError, ValueError, IndexError):
            raise VerificationError(
                f"{self.program}: does not answer as the test program of a closure (exit code "
                f"{done.returncode}); export and compile it again."
            ) from None

    def rows(self, markers: Mapping[str, ArrayLike], width: int) -> tuple[Array, tuple[int, ...]]:
        """Answers (n, width) to markers, and the shape that these had; one call of the program."""
        columns, shape = _flat(self.marker_names, markers)
        form = ",".join(["%.17g"] * len(columns))
        rows = (form % row for row in zip(*(c.tolist() for c in columns), strict=True))
        text = "\n".join([",".join(self.marker_names), *rows, ""])
        done = subprocess.run([self.program, "rows"], input=text, capture_output=True, text=True)
        if done.returncode:
            raise VerificationError(
                f"{self.program}: exit code {done.returncode} ({done.stderr.strip()}); "
                "export and compile it again."
            )
        # A header line alone is a legal answer to no rows.
        table = np.empty((0, width))
        if columns[0].size:
            table = np.loadtxt(io.StringIO(done.stdout), delimiter=",", skiprows=1, ndmin=2)
        return table, shape


class CompiledClosure(CompiledProgram):
    """A closure exported to C++, answering through its compiled test program.

    Unlike in Python, markers out of range give NaN instead of an error.
    """

    def evaluate(self, **markers: ArrayLike) -> Array:
        """View, wall or exchange factors [-] of markers by name."""
        return self.predict(**markers).view_factor

    def predict(self, **markers: ArrayLike) -> Prediction:
        """Factor, standard error and extrapolation; all pairs in one call of the program."""
        table, shape = self.rows(markers, 3)
        return Prediction(
            table[:, 0].reshape(shape),
            table[:, 1].reshape(shape),
            (table[:, 2] > 0.0).reshape(shape),
        )


class OnnxGraph:
    """A graph of an exported closure in onnxruntime, on one thread.

    Parameters
    ----------
    path : path
        What :func:`greybed.export.export_onnx` returned.

    Attributes
    ----------
    metadata : dict of str
        Name, hash, versions, licence and the meanings of the markers.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        import onnxruntime

        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        options.log_severity_level = 3  # errors only: a missing GPU is none
        try:
            self._session = onnxruntime.InferenceSession(
                os.fspath(path), options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:  # onnxruntime raises a class of its own for every reason
            reason = str(error).splitlines()[0]
            raise InputError(
                f"{path}: onnxruntime cannot open this graph ({reason}); export it again."
            ) from None
        self.metadata = dict(self._session.get_modelmeta().custom_metadata_map)
        self.name, self.hash = self.metadata.get("name", ""), self.metadata.get("hash", "")
        self.marker_names = tuple(value.name for value in self._session.get_inputs())
        self._outputs = [value.name for value in self._session.get_outputs()]

    def run(self, markers: Mapping[str, ArrayLike]) -> list[Any]:
        """Outputs of the graph, in their order and in the shape of the markers."""
        columns, shape = _flat(self.marker_names, markers)
        feed = dict(zip(self.marker_names, columns, strict=True))
        return [np.reshape(result, shape) for result in self._session.run(self._outputs, feed)]


class OnnxClosure(OnnxGraph):
    """A closure exported to ONNX, answering through onnxruntime on one thread.

    Unlike in Python, markers out of range give NaN instead of an error.
    """

    def evaluate(self, **markers: ArrayLike) -> Array:
        """View, wall or exchange factors [-] of markers by name."""
        return self.predict(**markers).view_factor

    def predict(self, **markers: ArrayLike) -> Prediction:
        """Factor, standard error and extrapolation."""
        return Prediction(*self.run(markers))


def relative_error(value: Array, expected: Array) -> Array:
    """|value - expected| / |expected|; zero where both are zero, infinite where NaN came out."""
    size = np.maximum(np.abs(expected), 1e-300)
    return np.nan_to_num(np.abs(value - expected) / size, nan=np.inf, posinf=np.inf)


def replay(closure: Closure, exported: Exported, tolerance: float) -> dict[str, Any]:
    """Replay the golden rows through an exported form.

    Parameters
    ----------
    closure : ViewFactorClosure or FilteredDragClosure
        What was exported.
    exported : Exported
        The exported form.
    tolerance : float
        Relative difference that a row may show [-].

    Returns
    -------
    result : dict
        ``rows``, ``failing_rows``, ``max_relative_error``, ``tolerance``, ``same_hash``, and
        ``passed`` where every row holds, the hashes agree, and the form's own self-test passes.
    """
    inputs, expected = golden_rows(closure)
    answer = exported.predict(**dict(zip(closure.marker_names, inputs.T, strict=True)))
    # The last of the answers is the flag of extrapolation.
    error = relative_error(np.stack(answer[:-1], axis=1), expected)
    same_hash = exported.hash == content_hash(closure)
    failing = int((error > tolerance).any(axis=1).sum())
    own = int(getattr(exported, "failing_rows", 0))
    return {
        "rows": len(inputs),
        "failing_rows": failing,
        "self_test": own,
        "max_relative_error": float(error.max()),
        "tolerance": tolerance,
        "same_hash": same_hash,
        "passed": failing == 0 and own == 0 and same_hash,
    }
