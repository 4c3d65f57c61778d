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
from greybed.closures.drag.filtered.closure import DragPrediction
from greybed.closures.term import GreyBoxTerm
from greybed.closures.viewfactor import Prediction
from greybed.core import InputError, RangeError, VerificationError
from greybed.core.files import output_folder

Array = NDArray[np.float64]

CPP_TOLERANCE = 1e-12
# Runtimes have their own exp and tanh; double precision leaves about 1e-14.
ONNX_TOLERANCE = 1e-6
SINGLE_TOLERANCE = 1e-6


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


def found_compiler() -> list[str]:
    """The same; an InputError where there is none."""
    compiler = find_compiler()
    if compiler is None:
        raise InputError(
            f"no C++ compiler found (CXX = {os.environ.get('CXX', '')!r}, g++, clang++, c++); "
            "install one or set CXX to its path."
        )
    return compiler


def run_compiler(compiler: Sequence[str], words: Sequence[str], source: Path) -> None:
    """Compile; a VerificationError with the first complaint where the compiler refuses."""
    done = subprocess.run([*compiler, *words], capture_output=True, text=True)
    if done.returncode:
        lines = [x for x in done.stderr.splitlines() if "error" in x.lower()] or [done.stderr]
        flags = " ".join(word for word in words if word.startswith("-"))
        raise VerificationError(
            f"{source}: {compiler[0]} {flags} refuses it: {lines[0].strip()}; "
            "try other flags or another compiler in CXX."
        )


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
    compiler = found_compiler()
    source = Path(header).resolve()
    source = source.with_name(f"{source.stem}_test.cpp")
    program = output_folder(folder).resolve() / source.stem
    run_compiler(compiler, [*flags, str(source), "-o", str(program)], source)
    return program


def flat(
    names: tuple[str, ...], markers: Mapping[str, ArrayLike]
) -> tuple[list[Array], tuple[int, ...]]:
    """Columns of the markers, and the shape that they had."""
    if set(names) != set(markers):
        raise RangeError(
            f"this closure takes the markers {', '.join(names)}, not "
            f"{', '.join(markers) or 'none'}; name each of them once."
        )
    arrays = np.broadcast_arrays(*(np.asarray(markers[n], dtype=np.float64) for n in names))
    return [np.ascontiguousarray(a).ravel() for a in arrays], arrays[0].shape


def named_prediction(names: Sequence[str], columns: Sequence[NDArray]) -> Any:
    """Answers under the names that the closure itself gives them; extrapolation comes last."""
    if names[0] == "kept_along":
        return DragPrediction(*columns)
    if len(columns) == 3:
        return Prediction(*columns)
    return tuple(columns)  # of a term


def filled(names: tuple[str, ...], markers: Mapping[str, ArrayLike]) -> Mapping[str, ArrayLike]:
    """Markers with parcels of single particles where none are given."""
    return {"parcels": 1.0, **markers} if "parcels" in names else markers


class CompiledClosure:
    """A closure exported to C++, answering through its compiled test program.

    Unlike in Python, markers out of range give NaN instead of an error.

    Parameters
    ----------
    program : path
        What :func:`compile_cpp` returned.

    Attributes
    ----------
    name, hash : str
        As the program says them.
    marker_names, outputs : tuple of str
        Markers in the order of the header's arguments; answers before the flag of extrapolation.
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
            self.outputs = tuple(facts["outputs"].split(","))
            self.failing_rows = int(facts["failing"].split()[0])
        except (KeyError, ValueError, IndexError):
            raise VerificationError(
                f"{self.program}: does not answer as the test program of a closure (exit code "
                f"{done.returncode}); export and compile it again."
            ) from None

    def evaluate(self, **markers: ArrayLike) -> Array:
        """View, wall or exchange factors [-] of markers by name; of a term, its factor."""
        return self.predict(**markers)[0]

    def predict(self, **markers: ArrayLike) -> Any:
        """What the closure's own ``predict`` gives; all rows in one call of the program."""
        columns, shape = flat(self.marker_names, filled(self.marker_names, markers))
        table = self._lines("rows", np.stack(columns, axis=1), len(self.outputs) + 1)
        values = [table[:, k].reshape(shape) for k in range(len(self.outputs))]
        return named_prediction(self.outputs, [*values, (table[:, -1] > 0.0).reshape(shape)])

    def gradients(self, **markers: ArrayLike) -> tuple[Array, Array]:
        """Answers (n, k) of ``eval_grad`` and their derivatives (n, k, n_markers)."""
        columns, _ = flat(self.marker_names, filled(self.marker_names, markers))
        n, m = max(1, sum(o != "stderr" for o in self.outputs)), len(self.marker_names)
        table = self._lines("grad", np.stack(columns, axis=1), n * (1 + m) + 1)
        return table[:, :n], table[:, n:-1].reshape(-1, n, m)

    def guarded(self, rows: ArrayLike, policy: str) -> tuple[Array, tuple[int, int, int]]:
        """Answers to rows of physical numbers under a guard, and what it counted.

        Parameters
        ----------
        rows : (n, n_inputs) array_like
            In SI and the order of the header's ``Inputs``; of filtered drag: diameter, particle
            and gas density, gas viscosity, gravity, solid fraction, slip, pressure gradient,
            filter size, F and Re dF/dRe of the drag law, parcels.
        policy : str
            ``clamp``, ``baseline``, ``abort`` or ``extrapolate``.

        Returns
        -------
        table : (n, k) float
            Factor and derivatives for the inputs, or force (3), derivative (9) and exchange
            coefficient; last the status: 0 inside, 1 clamped, 2 baseline, 3 refused, 4
            extrapolated.
        counts : (calls, outside, invalid)
        """
        text = "\n".join(",".join(f"{x:.17g}" for x in row) for row in np.atleast_2d(rows))
        lines = self._run("guarded", policy, text=text + "\n").splitlines()
        calls, outside, invalid = (int(word) for word in lines.pop().split(","))
        table = np.loadtxt(lines, delimiter=",", ndmin=2)
        return table, (calls, outside, invalid)

    def forces(self, rows: ArrayLike) -> tuple[Array, Array]:
        """Forces (n, 3) [N m-3] and derivatives (n, 3, 3) [N s m-4] of rows, as in Python."""
        table, _ = self.guarded(rows, "extrapolate")
        return table[:, :3], table[:, 3:12].reshape(-1, 3, 3)

    def nanoseconds(self) -> tuple[float, float]:
        """Time of one value, and of one value with derivatives, best of many turns [ns]."""
        words = self._run("time").split()
        return float(words[1]), float(words[4])

    def _run(self, *words: str, text: str = "") -> str:
        done = subprocess.run([self.program, *words], input=text, capture_output=True, text=True)
        if done.returncode:
            raise VerificationError(
                f"{self.program}: exit code {done.returncode} ({done.stderr.strip()}); "
                "export and compile it again."
            )
        return done.stdout

    def _lines(self, verb: str, rows: Array, width: int) -> Array:
        """A table (n, width) that the program makes of rows of markers."""
        form = ",".join(["%.17g"] * len(self.marker_names))
        lines = (form % tuple(row) for row in rows.tolist())
        answer = self._run(verb, text="\n".join([",".join(self.marker_names), *lines, ""]))
        # A header line alone is a legal answer to no rows.
        if not len(rows):
            return np.empty((0, width))
        return np.loadtxt(io.StringIO(answer), delimiter=",", skiprows=1, ndmin=2)


class OnnxClosure:
    """A closure exported to ONNX, answering through onnxruntime on one thread.

    Unlike in Python, markers out of range give NaN instead of an error.

    Parameters
    ----------
    path : path
        What :func:`greybed.export.export_onnx` returned.

    Attributes
    ----------
    single : bool
        Whether it computes in single precision.
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
        self.single = self._session.get_inputs()[0].type == "tensor(float)"
        self._type = np.float32 if self.single else np.float64

    def evaluate(self, **markers: ArrayLike) -> Array:
        """View, wall or exchange factors [-] of markers by name; of a term, its factor."""
        return self.predict(**markers)[0]

    def predict(self, **markers: ArrayLike) -> Any:
        """What the closure's own ``predict`` gives."""
        columns, shape = flat(self.marker_names, filled(self.marker_names, markers))
        columns = [column.astype(self._type) for column in columns]
        feed = dict(zip(self.marker_names, columns, strict=True))
        found = self._session.run(self._outputs, feed)
        return named_prediction(self._outputs, [np.reshape(result, shape) for result in found])


def relative_error(value: Array, expected: Array) -> Array:
    """|value - expected| / |expected|; zero where both are zero, infinite where NaN came out."""
    size = np.maximum(np.abs(expected), 1e-300)
    return np.nan_to_num(np.abs(value - expected) / size, nan=np.inf, posinf=np.inf)


def replay(closure: Closure | GreyBoxTerm, exported: Exported, tolerance: float) -> dict[str, Any]:
    """Replay the golden rows through an exported form.

    Parameters
    ----------
    closure : ViewFactorClosure, FilteredDragClosure or GreyBoxTerm
        What was exported.
    exported : Exported
        The exported form.
    tolerance : float
        Relative difference that a row may show [-]; in single precision of the largest answer of
        its kind.

    Returns
    -------
    result : dict
        ``rows``, ``failing_rows``, ``max_relative_error``, ``tolerance``, ``same_hash``, and
        ``passed`` where every row holds, the hashes agree, and the form's own self-test passes.
    """
    if isinstance(closure, GreyBoxTerm):
        values, factors = closure.golden_rows()
        inputs, expected, hash_ = values[:, None], factors[:, None], closure.content_hash()
    else:
        inputs, expected = golden_rows(closure)
        hash_ = content_hash(closure)
    answer = exported.predict(**dict(zip(exported.marker_names, inputs.T, strict=True)))
    # The last of the answers is the flag of extrapolation.
    found = np.stack(answer[:-1], axis=1)
    if getattr(exported, "single", False):
        # Of the largest answer of its kind: a share that is nearly 0 or 1 keeps no more digits.
        error = np.abs(found - expected) / np.maximum(np.abs(expected).max(axis=0), 1e-30)
    else:
        error = relative_error(found, expected)
    same_hash = exported.hash == hash_
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
