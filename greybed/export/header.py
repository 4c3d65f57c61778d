"""A closure or a term as one self-contained C++11 header, with test program and CMake file."""

from __future__ import annotations

import os
import re
import textwrap
from functools import cache
from pathlib import Path
from typing import Any

from greybed.closures import FilteredDragClosure
from greybed.closures.artifact import Closure
from greybed.closures.term import GreyBoxTerm
from greybed.core.files import atomic_path, output_folder
from greybed.export.drag_form import drag_form
from greybed.export.factor_form import factor_form
from greybed.export.form import Form
from greybed.export.metadata import allowed, export_name
from greybed.export.tables import checksum, doubles
from greybed.export.term import term_form

# Relative difference that a golden row may show on another machine or with -ffast-math.
TOLERANCE = 1e-12


def form_of(subject: Closure | GreyBoxTerm, name: str | None = None) -> Form:
    """What the exports need to know of a closure or a term.

    Raises
    ------
    InputError
        If the name is no C++ identifier, or the closure holds numbers that are not finite.
    """
    word = export_name(subject, name)
    if isinstance(subject, GreyBoxTerm):
        return term_form(subject, word)
    if isinstance(subject, FilteredDragClosure):
        return drag_form(subject, word)
    return factor_form(subject, word)


@cache
def environment() -> Any:
    """Templates of the exported files."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("greybed.export"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # C++ is no HTML
    )
    environment.filters["quoted"] = _quoted
    environment.filters["wrapped"] = _wrapped
    environment.filters["capital"] = _capital
    return environment


def _capital(text: str) -> str:
    """The text with its first letter large."""
    return text[:1].upper() + text[1:]


def _wrapped(line: str) -> str:
    """A long line of C++, continued four columns further in."""
    body = line.strip().replace("double* ", "double*\1").replace("double ", "double\1")
    indent = " " * (len(line) - len(line.lstrip()))
    text = textwrap.fill(
        body,
        100,
        initial_indent=indent,
        subsequent_indent=indent + "    ",
        break_long_words=False,
        break_on_hyphens=False,
    )
    return text.replace("\1", " ") + "\n"  # a type stays with the name that follows


def _quoted(text: str) -> str:
    """A C++ string literal: printable ASCII, everything else as octal bytes."""
    # Octal escapes end after three digits, hexadecimal ones swallow what follows.
    body = "".join(
        chr(byte) if 32 <= byte < 127 and byte not in b'"\\?' else f"\\{byte:03o}"
        for byte in text.encode()
    )
    # A break must not fall into an octal sequence; adjacent literals are one.
    pieces = re.findall(r"(?:\\[0-7]{3}|[^\\]){1,80}", body) or [""]
    return "\n      ".join(f'"{piece}"' for piece in pieces)


def context_of(form: Form) -> dict[str, Any]:
    """What the templates of any language are filled with."""
    inputs, outputs = form.golden
    return {
        # What a body may leave open.
        "convention": "",
        "of_pairs": False,
        "pressure": False,
        "with_material": False,
        **form.context,
        "name": form.name,
        "facts": form.facts,
        "guard": f"GREYBED_{form.name.upper()}_HPP",
        "quantity": form.quantity,
        "kind": form.kind,
        "unit": form.unit,
        "markers": form.markers,
        "outputs": form.outputs,
        "n_answers": form.n_answers,
        "inputs": form.inputs,
        "n_inputs": len(form.inputs),
        # Numbers of one place: those of the material stand before them, and are made once.
        "flat": form.inputs[form.context.get("n_before", 0) :],
        "allowed": allowed,
        "body": form.body,
        "tables": form.tables,
        "golden": [doubles("golden_markers", inputs), doubles("golden_answers", outputs)],
        "rows": len(inputs),
        "tolerance": repr(TOLERANCE),
        "checksum": f"0x{checksum(form.tables):016x}ULL",
    }


def write_templates(form: Form, folder: Path, files: dict[str, str]) -> None:
    """Fill templates and put the files into their places, whole or not at all."""
    context = context_of(form)
    for file, template in files.items():
        text = environment().get_template(template).render(context)
        with atomic_path(folder / file) as temporary:
            temporary.write_text(text, encoding="ascii")


HEADER_FILES = {
    "{}.hpp": "header.hpp",
    "{}_test.cpp": "test.cpp",
    "README.md": "README.md",
    "CMakeLists.txt": "CMakeLists.txt",
}


def export_cpp(
    subject: Closure | GreyBoxTerm, folder: str | os.PathLike[str], name: str | None = None
) -> Path:
    """Write ``NAME.hpp``, ``NAME_test.cpp``, ``CMakeLists.txt`` and ``README.md``.

    Parameters
    ----------
    subject : ViewFactorClosure, FilteredDragClosure or GreyBoxTerm
        What to export.
    folder : path
        Made if it does not exist.
    name : str, optional
        Namespace inside ``greybed`` and stem of the files; made from the closure by default.

    Returns
    -------
    header : Path
        The header: C++11, no heap, no threads, nothing to link but the C++ library.

    Raises
    ------
    InputError
        If the name is no C++ identifier, or the closure holds numbers that are not finite.
    OutputError
        If a file cannot be written.

    Notes
    -----
    The header's ``self_test()`` replays the golden rows to a relative 1e-12 and compares a
    checksum of every constant; ``NAME_test.cpp`` runs it and evaluates CSV rows.
    """
    form = form_of(subject, name)
    target = output_folder(folder)
    write_templates(form, target, {k.format(form.name): v for k, v in HEADER_FILES.items()})
    return target / f"{form.name}.hpp"
