"""A closure as a C library with a Fortran module, and both of them running."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.closures.artifact import Closure
from greybed.closures.term import GreyBoxTerm
from greybed.core import InputError, VerificationError
from greybed.core.files import output_folder
from greybed.export.form import Form
from greybed.export.header import HEADER_FILES, form_of, write_templates
from greybed.export.replay import filled, flat, found_compiler, named_prediction, run_compiler

Array = NDArray[np.float64]

# Names of a Fortran compiler allow 63 letters, of which the longest suffix takes 14.
LONGEST = 49
FLAGS = ("-std=c++11", "-O3")


def export_c(
    subject: Closure | GreyBoxTerm,
    folder: str | os.PathLike[str],
    name: str | None = None,
    *,
    fortran: bool = False,
) -> Path:
    """Write a C interface beside the C++ header: ``NAME_c.h``, ``NAME_c.cpp``, package files.

    Parameters
    ----------
    subject : ViewFactorClosure, FilteredDragClosure or GreyBoxTerm
        What to export.
    folder : path
        Made if it does not exist.
    name : str, optional
        Stem of files and functions; made from the closure by default.
    fortran : bool
        Also ``NAME.f90``, a module that binds to the library, and ``NAME_test.f90``.

    Returns
    -------
    header : Path
        ``NAME_c.h``.

    Raises
    ------
    InputError
        If the name is no identifier, or too long for Fortran.
    OutputError
        If a file cannot be written.
    """
    form = form_of(subject, name)
    if fortran and len(form.name) > LONGEST:
        raise InputError(
            f"the name {form.name!r} has {len(form.name)} letters, and Fortran leaves {LONGEST} to "
            "it; give a shorter one."
        )
    word, target = form.name, output_folder(folder)
    files = {
        **HEADER_FILES,
        "{}_c.h": "library.h",
        "{}_c.cpp": "library.cpp",
        "{}.pc.in": "package.pc.in",
    }
    if fortran:
        files |= {"{}.f90": "module.f90", "{}_test.f90": "test.f90"}
    write_templates(form, target, {k.format(word): v for k, v in files.items()})
    return target / f"{word}_c.h"


def compile_c(
    header: str | os.PathLike[str],
    folder: str | os.PathLike[str],
    flags: Sequence[str] = FLAGS,
) -> Path:
    """Compile ``libNAME.so`` of a header that :func:`export_c` returned.

    Raises
    ------
    InputError
        If there is no C++ compiler.
    VerificationError
        If the compiler refuses the file.
    """
    source = Path(header).resolve().with_suffix(".cpp")
    library = output_folder(folder).resolve() / f"lib{source.stem.removesuffix('_c')}.so"
    words = [*flags, "-fPIC", "-shared", "-fvisibility=default", str(source), "-o", str(library)]
    run_compiler(found_compiler(), words, source)
    return library


class CompiledLibrary:
    """A closure in its C library, called through ctypes.

    Parameters
    ----------
    library : path
        What :func:`compile_c` returned.
    form : Form
        What was exported: :func:`greybed.export.header.form_of`.

    Attributes
    ----------
    target : str
        For which processor the library runs, ``avx2`` or ``default``.

    Raises
    ------
    VerificationError
        If the library does not open, because its golden rows fail.
    """

    def __init__(self, library: str | os.PathLike[str], form: Form) -> None:
        self._library = ctypes.CDLL(os.fspath(library))
        self._name = form.name
        message = ctypes.create_string_buffer(512)
        self._call("open", ctypes.c_void_p)
        self._open = self._call("open", ctypes.c_void_p)(
            ctypes.c_int(1), message, ctypes.c_size_t(512)
        )
        if not self._open:
            raise VerificationError(message.value.decode())
        self.hash, self.name = self._text("hash"), self._text("name")
        self.marker_names = tuple(self._text("markers").split(","))
        self.outputs = tuple(self._text("outputs").split(","))
        self.target = self._call("target", ctypes.c_char_p)(ctypes.c_void_p(self._open)).decode()
        self._answers = form.n_answers

    def _call(self, name: str, result: Any) -> Any:
        function = getattr(self._library, f"{self._name}_{name}")
        function.restype = result
        return function

    def _text(self, name: str) -> str:
        return self._call(name, ctypes.c_char_p)().decode()

    def evaluate(self, **markers: ArrayLike) -> Array:
        """First of the answers, as of :meth:`predict`."""
        return self.predict(**markers)[0]

    def predict(self, **markers: ArrayLike) -> Any:
        """What the closure's own ``predict`` gives; NaN where a marker is out of range."""
        rows, shape = self._rows(markers)
        table = np.empty((len(rows), len(self.outputs) + 1))
        call, flag = self._call("predict", ctypes.c_int), ctypes.c_int()
        for row, out in zip(rows, table, strict=True):
            call(ctypes.c_void_p(self._open), _at(row), _at(out), ctypes.byref(flag))
            out[-1] = flag.value
        values = [table[:, k].reshape(shape) for k in range(len(self.outputs))]
        return named_prediction(self.outputs, [*values, (table[:, -1] > 0.0).reshape(shape)])

    def batch(self, **markers: ArrayLike) -> Array:
        """Answers (n, k) of ``eval_batch``."""
        rows, _ = self._rows(markers)
        answers = np.empty((len(rows), self._answers))
        n = ctypes.c_size_t(len(rows))
        call = self._call("eval_batch", ctypes.c_int)
        call(ctypes.c_void_p(self._open), n, _at(rows), _at(answers))
        return answers

    def gradients(self, **markers: ArrayLike) -> tuple[Array, Array]:
        """Answers (n, k) of ``eval_grad`` and their derivatives (n, k, n_markers)."""
        rows, _ = self._rows(markers)
        answers = np.empty((len(rows), self._answers))
        slopes = np.empty((len(rows), self._answers, len(self.marker_names)))
        call = self._call("eval_grad", ctypes.c_int)
        for row, out, slope in zip(rows, answers, slopes, strict=True):
            call(ctypes.c_void_p(self._open), _at(row), _at(out), _at(slope))
        return answers, slopes

    def _rows(self, markers: dict[str, ArrayLike]) -> tuple[Array, tuple[int, ...]]:
        columns, shape = flat(self.marker_names, filled(self.marker_names, markers))
        return np.ascontiguousarray(np.stack(columns, axis=1)), shape


def _at(array: Array) -> Any:
    return array.ctypes.data_as(ctypes.c_void_p)


class FortranProgram:
    """A closure called from Fortran: its module, the C library and the test program.

    Parameters
    ----------
    header : path
        What :func:`export_c` returned with ``fortran=True``.
    library : path
        What :func:`compile_c` returned.
    form : Form
        What was exported.

    Raises
    ------
    InputError
        If there is no Fortran compiler (``FC``, gfortran).
    VerificationError
        If it refuses the module, or the program says that golden rows fail.
    """

    def __init__(
        self, header: str | os.PathLike[str], library: str | os.PathLike[str], form: Form
    ) -> None:
        compiler = find_fortran()
        if compiler is None:
            raise InputError("no Fortran compiler found (FC, gfortran); install one or set FC.")
        folder, built = Path(header).resolve().parent, Path(library).resolve()
        self.program = built.with_name(f"{form.name}_fortran")
        sources = [str(folder / f"{form.name}{end}.f90") for end in ("", "_test")]
        words = [
            "-O2",
            "-Wall",
            "-Werror",
            "-ffree-line-length-none",
            f"-J{built.parent}",
            *sources,
        ]
        words += [f"-L{built.parent}", f"-l{form.name}", f"-Wl,-rpath,{built.parent}"]
        run_compiler([compiler], [*words, "-o", str(self.program)], Path(sources[0]))
        self._form = form
        self.marker_names = tuple(marker.name for marker in form.markers)
        self.hash = self._run("0\n").strip()

    def _run(self, text: str) -> str:
        done = subprocess.run([self.program], input=text, capture_output=True, text=True)
        if done.returncode:
            said = (done.stdout + done.stderr).strip()
            raise VerificationError(f"{self.program}: exit code {done.returncode} ({said}).")
        return done.stdout

    def table(self, **markers: ArrayLike) -> Array:
        """Rows of outputs, answers of the batch, derivatives and the flag of extrapolation."""
        columns, _ = flat(self.marker_names, filled(self.marker_names, markers))
        rows = np.stack(columns, axis=1)
        text = "\n".join(" ".join(f"{x:.17g}" for x in row) for row in rows)
        lines = self._run(f"{len(rows)}\n{text}\n").splitlines()[1:]
        return np.loadtxt(lines, ndmin=2)

    def predict(self, **markers: ArrayLike) -> Any:
        """What the closure's own ``predict`` gives, of flat markers."""
        table, outputs = self.table(**markers), self._form.outputs
        columns: list[Any] = [table[:, k] for k in range(len(outputs))]
        return named_prediction(outputs, [*columns, table[:, -1] > 0.0])


def find_fortran() -> str | None:
    """The Fortran compiler: ``FC`` if set, else gfortran."""
    return shutil.which(os.environ.get("FC", "gfortran"))
