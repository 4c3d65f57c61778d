"""One file per closure: weights, markers, ranges, card, golden rows; sealed by a hash, no pickle.

Layout: a magic line, the SHA-256 of everything after it, then an ``.npz`` archive whose member
``manifest`` is JSON. Loading checks the hash, reads arrays only, and replays the golden rows.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import stat
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed._version import __version__
from greybed.closures.drag.filtered import limits as drag_limits
from greybed.closures.drag.filtered.closure import QUANTITY, FilteredDragClosure
from greybed.closures.drag.filtered.features import MARKER_SETS as DRAG_MARKER_SETS
from greybed.closures.drag.filtered.gate import Gate
from greybed.closures.predictors import PREDICTORS, Forest
from greybed.closures.viewfactor.closure import Domain, ViewFactorClosure
from greybed.closures.viewfactor.limits import random_markers
from greybed.closures.viewfactor.visibility import MARKER_SETS
from greybed.core import InputError, VerificationError
from greybed.core.files import atomic_path

MAGIC = b"greybed closure 1\n"
GOLDEN_ROWS = 64
# The same arithmetic in the same order: only the last digits of libm may differ.
GOLDEN_TOLERANCE = 1e-12
SUFFIX = ".closure"
LARGEST = 1 << 30  # bytes when unpacked; a small archive may hold far more than a machine

Closure = ViewFactorClosure | FilteredDragClosure


def golden_rows(closure: Closure) -> tuple[NDArray, NDArray]:
    """Inputs (64, n_markers) and outputs (64, n) to replay anywhere.

    Outputs are factor and standard error, or kept fractions along and across gravity, share of
    the gradient's force and standard error.
    """
    if isinstance(closure, FilteredDragClosure):
        markers = drag_limits.random_markers(closure, GOLDEN_ROWS, seed=20, beyond=0.2)
        # Each limit of the gate is replayed too.
        markers["solid_fraction"][::16] = 0.0
        markers["solid_fraction"][1::16] = closure.gate.packing
        markers["filter_size"][2::16] = 0.0
    else:
        markers = _pair_rows(closure)
    inputs = np.stack([markers[name] for name in closure.marker_names], axis=1)
    return inputs, answers(closure, inputs)


def answers(closure: Closure, inputs: NDArray) -> NDArray:
    """What a closure says of rows of markers, as golden rows have it."""
    columns = dict(zip(closure.marker_names, inputs.T, strict=True))
    if isinstance(closure, FilteredDragClosure):
        return np.stack(closure.predict(**columns)[:4], axis=1)
    return np.stack(closure.predict(**columns)[:2], axis=1)


def _pair_rows(closure: ViewFactorClosure) -> dict[str, NDArray]:
    markers = random_markers(closure, GOLDEN_ROWS, seed=20)
    # Every third row free of obstruction, so that the gate's exact zero is replayed too.
    for marker in closure.markers.markers:
        if marker.free is not None:
            markers[marker.name][::3] = marker.free
    return markers


def content_hash(closure: Closure) -> str:
    """SHA-256 over the arrays that decide what a closure answers: the same in every export."""
    digest = hashlib.sha256(f"{closure.quantity} {closure.markers.name} {closure.kind}".encode())
    arrays = {**closure.predictor.arrays(), **closure.arrays()}
    for name, array in sorted(arrays.items()):
        digest.update(name.encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def save(closure: Closure, path: str | os.PathLike[str]) -> Path:
    """Write a closure to one file, whole or not at all.

    Raises
    ------
    OutputError
        If the file cannot be written.
    """
    inputs, outputs = golden_rows(closure)
    manifest = {
        "quantity": closure.quantity,
        "kind": closure.kind,
        "markers": closure.markers.name,
        "marker_names": closure.marker_names,
        "marker_meanings": [m.meaning for m in closure.markers.markers],
        "feature_names": closure.markers.feature_names,
        "hash": content_hash(closure),
        "greybed": __version__,
        "card": closure.card,
    }
    arrays = {
        **{f"predictor_{k}": v for k, v in closure.predictor.arrays().items()},
        **closure.arrays(),
        "golden_inputs": inputs,
        "golden_outputs": outputs,
        "manifest": np.frombuffer(json.dumps(manifest).encode(), dtype=np.uint8),
    }
    buffer = io.BytesIO()
    # savez accepts names as keywords; its stubs also reserve allow_pickle
    np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]
    payload = buffer.getvalue()
    seal = hashlib.sha256(payload).hexdigest().encode() + b"\n"
    target = Path(path)
    with atomic_path(target) as temporary:
        temporary.write_bytes(MAGIC + seal + payload)
    return target


def load(path: str | os.PathLike[str]) -> ViewFactorClosure:
    """Read a closure of view, wall or exchange factors and replay its golden rows.

    Parameters
    ----------
    path : path
        A ``.closure`` file.

    Returns
    -------
    ViewFactorClosure
        Ready to evaluate; needs neither torch nor scikit-learn.

    Raises
    ------
    InputError
        If the file is missing, not an artifact, truncated, changed, or of filtered drag.
    VerificationError
        If a golden row does not come out as it was stored.
    """
    closure = load_any(path)
    if isinstance(closure, FilteredDragClosure):
        raise InputError(
            f"{path}: this closure gives filtered drag, not view factors; read it with load_drag."
        )
    return closure


def load_drag(path: str | os.PathLike[str]) -> FilteredDragClosure:
    """Read a closure of filtered drag and replay its golden rows; see :func:`load`."""
    closure = load_any(path)
    if not isinstance(closure, FilteredDragClosure):
        raise InputError(
            f"{path}: this closure gives {closure.quantity}s, not filtered drag; read it with load."
        )
    return closure


def load_any(path: str | os.PathLike[str]) -> Closure:
    """Read a closure of any kind and replay its golden rows; see :func:`load`."""
    file = Path(path)
    arrays, manifest = _unpack(file)
    try:
        _check_numbers(arrays)
        predictor = PREDICTORS[manifest["kind"]].from_arrays(
            {k.removeprefix("predictor_"): v for k, v in arrays.items() if k[:10] == "predictor_"}
        )
        domain, card = Domain.from_arrays(arrays), manifest["card"]
        closure: Closure
        if manifest["quantity"] == QUANTITY:
            closure = FilteredDragClosure(
                DRAG_MARKER_SETS[manifest["markers"]], predictor, domain,
                Gate.from_arrays(arrays), card,
            )  # fmt: skip
        else:
            closure = ViewFactorClosure(MARKER_SETS[manifest["markers"]], predictor, domain, card)
        # The walk of a tree takes columns by these numbers, without looking.
        width = len(closure.markers.feature_names)
        if isinstance(predictor, Forest) and (predictor.feature >= width).any():
            raise ValueError("features: a tree compares one that there is not")
        inputs, expected = arrays["golden_inputs"], arrays["golden_outputs"]
        # An artifact that is not of one piece must not get further than here.
        fits = inputs.shape[1] == len(closure.marker_names) and len(inputs) == len(expected)
        with np.errstate(all="ignore"):  # what is not finite is no golden row, below
            replayed = answers(closure, inputs)
        if not fits or replayed.shape != expected.shape:
            raise ValueError("golden rows of another shape")
    except (LookupError, ValueError, TypeError, AttributeError, ArithmeticError) as error:
        raise InputError(
            f"{file}: the artifact lacks or mistakes {error}; it was written by greybed "
            f"{manifest.get('greybed', 'unknown')}, this is {__version__}: train it again."
        ) from None
    with np.errstate(all="ignore"):
        error_ = np.abs(replayed - expected) / np.maximum(np.abs(expected), 1e-300)
    if not (error_ <= GOLDEN_TOLERANCE).all():
        wrong = np.nan_to_num(error_, nan=np.inf)
        row = int(wrong.max(axis=1).argmax())
        column = int(wrong[row].argmax())
        raise VerificationError(
            f"{file}: golden row {row} gives {replayed[row, column]:.17g} instead of "
            f"{expected[row, column]:.17g} [-], beyond {GOLDEN_TOLERANCE:g}; this installation "
            "computes differently: reinstall numpy, or train the closure again."
        )
    return closure


def _check_numbers(arrays: dict[str, NDArray]) -> None:
    """Refuse text, complex numbers and what is not finite where weights and rows should be."""
    for name, array in arrays.items():
        if array.dtype.kind not in "fiu":
            raise ValueError(f"array {name} of type {array.dtype}")
        if not name.startswith("domain_") and not np.isfinite(array).all():
            raise ValueError(f"array {name}, not all of it finite")


def _unpack(file: Path) -> tuple[dict[str, NDArray], dict[str, Any]]:
    try:
        if not stat.S_ISREG(file.stat().st_mode):  # a device may never end
            raise InputError(f"{file}: this is a folder or a device; give a {SUFFIX} file.")
        content = file.read_bytes()
    except OSError as error:
        raise InputError(
            f"{file}: cannot read this artifact ({error.strerror}); check the path."
        ) from None
    if not content.startswith(MAGIC):
        raise InputError(
            f"{file}: not a closure artifact (it does not begin with {MAGIC.decode().strip()!r}); "
            "make one with greybed train."
        )
    seal, _, payload = content[len(MAGIC) :].partition(b"\n")
    if hashlib.sha256(payload).hexdigest().encode() != seal:
        raise InputError(
            f"{file}: the artifact is truncated or changed (its SHA-256 does not match); "
            "copy it again or train it again."
        )
    try:
        with zipfile.ZipFile(io.BytesIO(payload)) as members:
            if sum(member.file_size for member in members.infolist()) > LARGEST:
                raise ValueError(f"more than {LARGEST} bytes")
        with np.load(io.BytesIO(payload), allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        manifest = json.loads(arrays.pop("manifest").tobytes())
        if not isinstance(manifest, dict):
            raise ValueError("no manifest")
    except Exception as error:  # what numpy and zipfile raise for damage is not documented
        raise InputError(f"{file}: the artifact cannot be unpacked ({error}); train it again.") \
            from None  # fmt: skip
    return arrays, manifest
