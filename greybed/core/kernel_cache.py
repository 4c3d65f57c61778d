"""Compiled kernels that were made from sources which have changed since are thrown away.

Numba keeps machine code beside each module and knows that it is old when that module has changed,
but not when one that it imports has: a kernel would go on with the former half of a change, and
may crash. So a stamp holds what each kernel was compiled from, imports included.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

_STAMP = "kernels.json"
_IMPORT = re.compile(r"^from (\w[\w.]*) import (\([^)]*\)|[^\n]*)", re.M)
_COMPILED = re.compile(r"^@n?jit\b|^@numba\.n?jit\b|^@vectorize\b", re.M)


def refresh(package: Path) -> list[str]:
    """Delete compiled kernels of a package whose sources, or what they import, have changed.

    Parameters
    ----------
    package : Path
        Folder of the package; its name is that of the package.

    Returns
    -------
    list of str
        Modules whose compiled kernels were deleted. Nothing happens, and nothing is raised, where
        the folder cannot be written: Numba keeps nothing there then.
    """
    stamp = package / "__pycache__" / _STAMP
    sources = {_name(path, package): path for path in package.rglob("*.py")}
    try:
        glance = _glance(sources)
        before = _read(stamp)
        known = before.get("kernels", {})
        if known and before.get("glance") == glance:
            return []
        found = _digests(sources)
        stale = [name for name, digest in found.items() if known.get(name) != digest]
        for name in stale:
            _delete(sources[name])
        stamp.parent.mkdir(exist_ok=True)
        # Whole or not at all: other processes may look at the same time.
        beside = stamp.with_name(f"{_STAMP}.{os.getpid()}")
        beside.write_text(json.dumps({"glance": glance, "kernels": found}))
        os.replace(beside, stamp)
    except OSError:
        return []
    return stale


def _read(stamp: Path) -> dict[str, Any]:
    """The stamp; one that cannot be read says nothing."""
    try:
        found = json.loads(stamp.read_text())
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _name(path: Path, package: Path) -> str:
    parts = path.relative_to(package.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _glance(sources: dict[str, Path]) -> str:
    """Changes with every edit, and costs no reading."""
    seen = hashlib.sha256()
    for name in sorted(sources):
        state = sources[name].stat()
        seen.update(f"{name} {state.st_mtime_ns} {state.st_size}\n".encode())
    return seen.hexdigest()


def _digests(sources: dict[str, Path]) -> dict[str, str]:
    """Of each module with kernels: over its text and the texts of all that it imports."""
    texts: dict[str, str] = {}

    def text(name: str) -> str:
        if name not in texts:
            texts[name] = sources[name].read_text(encoding="utf-8")
        return texts[name]

    found = {}
    for name in sorted(sources):
        if _COMPILED.search(text(name)):
            whole = hashlib.sha256()
            for other in sorted(_reached(name, sources, text)):
                whole.update(text(other).encode())
            found[name] = whole.hexdigest()
    return found


def _reached(name: str, sources: dict[str, Path], text: Callable[[str], str]) -> set[str]:
    seen, left = {name}, [name]
    while left:
        for module, names in _IMPORT.findall(text(left.pop())):
            # A package's own text does not matter: what kernels use stands in modules.
            inner = [f"{module}.{word}" for word in re.findall(r"\w+", names)]
            for other in [module, *inner]:
                if other in sources and sources[other].name != "__init__.py" and other not in seen:
                    seen.add(other)
                    left.append(other)
    return seen


def _delete(source: Path) -> None:
    for kept in (source.parent / "__pycache__").glob(f"{source.stem}.*.nb[ic]"):
        with suppress(FileNotFoundError):
            kept.unlink()
