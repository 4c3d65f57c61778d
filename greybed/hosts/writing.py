"""Adapters as files: templates of the project, the closure's header, a summary of both."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from greybed._version import __version__
from greybed.closures.viewfactor.markers import N_LINES, RIM, pencil_lines
from greybed.core.exact import quadrature
from greybed.core.files import atomic_path, output_folder
from greybed.export import export_cpp
from greybed.export.metadata import LICENCE
from greybed.hosts.model import RADIATION, HostModel

SUFFIX = ".jinja"


@cache
def _environment() -> Any:
    from jinja2 import Environment, PackageLoader, StrictUndefined

    return Environment(
        loader=PackageLoader("greybed.hosts"),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # C++ is no HTML
    )


def context_of(model: HostModel, engine: str) -> dict[str, Any]:
    """Words that the templates take."""
    context: dict[str, Any] = {
        "made": f"Written by greybed {__version__} for {engine}.",
        "engine": engine,
        "licence": LICENCE,
        "kind": model.kind,
        "name": model.name,
        "model": model.text,
        "hash": model.hash,
        "law": model.law,
        "closure": model.closure is not None,
        "markers": model.markers,
    }
    if model.kind == RADIATION:
        squares, weights = quadrature()
        context |= {
            "squares": _numbers(squares),
            "weights": _numbers(weights),
            "rim": repr(RIM),
            "n_lines": N_LINES,
            "lines": ",\n".join(
                "      {" + ", ".join(map(repr, line)) + "}" for line in pencil_lines().tolist()
            ),
        }
    return context


def _numbers(values: Any) -> str:
    return ",\n".join(f"      {value!r}" for value in values.tolist())


def write_adapter(
    model: HostModel, engine: str, folder: Path, templates: dict[str, str], **more: Any
) -> list[str]:
    """Write the closure's header and the files of templates.

    Parameters
    ----------
    model : HostModel
        What to compute.
    engine : str
        Name of the host.
    folder : Path
        Made if it does not exist.
    templates : dict of str
        Template, without its suffix, of each file.
    **more
        Further words for the templates.

    Returns
    -------
    list of str
        Names of the files.
    """
    target = output_folder(folder)
    if model.closure is not None:
        export_cpp(model.closure, target, model.name)
        # The exports' own test and build files are for programs that stand alone.
        for extra in (f"{model.name}_test.cpp", "CMakeLists.txt", "README.md"):
            (target / extra).unlink(missing_ok=True)
    context = {**context_of(model, engine), **more}
    for name, template in templates.items():
        text = _environment().get_template(template + SUFFIX).render(context)
        (target / name).parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(target / name) as part:
            part.write_text(text, encoding="ascii")
    header = [f"{model.name}.hpp"] if model.closure is not None else []
    return [*header, *templates]
