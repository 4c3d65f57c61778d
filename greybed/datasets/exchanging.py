"""Long traces of exchange factors: rows in blocks that no kill loses, joined at the end."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from greybed._version import __version__
from greybed.core.errors import InputError
from greybed.core.packing import Packing
from greybed.core.progress import progress
from greybed.datasets.factors_file import packing_hash
from greybed.datasets.tracing import STATE, Kept, keep, state_folder
from greybed.raytrace import ExchangeFactors, ExchangeRows, exchange_factors
from greybed.raytrace.arguments import whole_number

# Paths between two saves: some seconds.
PATHS_PER_BLOCK = 2_000_000

_PER_ROW = (
    "wall_factors", "wall_stderr", "escaped", "escaped_stderr", "areas", "buried", "spread",
    "spread_stderr",
)  # fmt: skip
_PER_SET = ("data", "indices", "stderr", "lengths", "cut", *_PER_ROW)


@dataclass(frozen=True)
class ExchangeSettings:
    """How to trace: see :func:`greybed.raytrace.exchange_factors`; one number for all spheres."""

    emissivity: tuple[float, ...]
    rays: int
    seed: int = 0
    wall_emissivity: tuple[float, ...] = (1.0,)
    specular: float = 0.0
    wall_specular: float = 0.0
    wall_rays: int = 0
    max_distance: float = np.inf


def exchange_in_blocks(
    packing: Packing,
    folder: str | Path,
    settings: ExchangeSettings,
    *,
    threads: int | None = None,
    show_progress: bool = False,
) -> tuple[ExchangeFactors, int]:
    """Trace exchange factors; what is finished stays in ``folder`` and is not traced again.

    Parameters
    ----------
    packing : Packing
        Spheres and walls.
    folder : path
        Existing folder; blocks go to ``.trace`` in it. Those of other settings are removed.
    settings : ExchangeSettings
        With the packing they decide every bit.
    threads : int, optional
        Threads; all available ones by default.
    show_progress : bool
        Draw a progress bar on standard error.

    Returns
    -------
    results : ExchangeFactors
        As one call of :func:`greybed.raytrace.exchange_factors` gives them, but for ``seconds``.
    found : int
        Spheres whose rows an earlier run had left.

    Raises
    ------
    InputError
        As :func:`greybed.raytrace.exchange_factors` does.
    OutputError
        If the folder cannot be written.
    """
    n, sets = len(packing), len(settings.emissivity)
    rays = whole_number(settings.rays, "rays", 1)
    if len(settings.wall_emissivity) not in (1, packing.n_walls):
        raise InputError(
            f"{len(settings.wall_emissivity)} wall emissivities for {packing.n_walls} walls; give "
            "one, or one per wall."
        )
    single = len(settings.wall_emissivity) == 1
    common: dict[str, Any] = {
        "emissivity": list(settings.emissivity),
        "wall_emissivity": settings.wall_emissivity[0] if single else settings.wall_emissivity,
        "specular": settings.specular,
        "wall_specular": settings.wall_specular,
        "seed": settings.seed,
        "threads": threads,
        "max_distance": settings.max_distance,
    }
    size = min(max(PATHS_PER_BLOCK // rays, 1), n)
    key = json.dumps(
        [__version__, "exchange", packing_hash(packing), list(vars(settings).values())]
    )
    root = Path(folder) / STATE
    kept = state_folder(root, hashlib.sha256(f"{key} {size}".encode()).hexdigest()[:32])
    names = tuple(f"{name}_{k}" for k in range(sets) for name in _PER_SET)
    spans = [(first, min(first + size, n)) for first in range(0, n, size)]
    blocks = [Kept(kept / f"{first}-{last}.npz", names) for first, last in spans]
    whole = [block.whole for block in blocks]
    found = sum(last - first for (first, last), done in zip(spans, whole, strict=True) if done)
    # Walls first, with one path from one sphere: what is wrong with them is said at once.
    walls = exchange_factors(packing, rays=1, emitters=[0], wall_rays=settings.wall_rays, **common)
    with progress(n * rays, "following rays", show=show_progress) as advance:
        advance(found * rays)
        for (first, last), block, done in zip(spans, blocks, whole, strict=True):
            if not done:
                part = exchange_factors(
                    packing, rays=rays, emitters=np.arange(first, last), **common
                )
                keep(block.path, _arrays(part, first, last))
                advance((last - first) * rays)
    joined = tuple(_joined(blocks, k, rows, rays) for k, rows in enumerate(walls))
    return ExchangeFactors(joined), found


def forget_blocks(folder: str | Path) -> None:
    """Remove the blocks, once the results are written."""
    shutil.rmtree(Path(folder) / STATE, ignore_errors=True)


def _arrays(part: ExchangeFactors, first: int, last: int) -> dict[str, NDArray[Any]]:
    """Rows ``first`` to ``last - 1`` of all sets."""
    rows, arrays = slice(first, last), {}
    for k, one in enumerate(part):
        entries = slice(*one.factors.indptr[[first, last]])
        values = {
            "data": one.factors.data[entries],
            "indices": one.factors.indices[entries].astype(np.int32),
            "stderr": one.stderr.data[entries],
            "lengths": np.diff(one.factors.indptr)[rows].astype(np.int64),
            "cut": np.array([one.cut * (last - first)]),
            **{name: getattr(one, name)[rows] for name in _PER_ROW},
        }
        arrays.update({f"{name}_{k}": value for name, value in values.items()})
    return arrays


def _joined(blocks: list[Kept], k: int, like: ExchangeRows, rays: int) -> ExchangeRows:
    def rows(name: str) -> NDArray[Any]:
        return np.concatenate([block[f"{name}_{k}"] for block in blocks])

    n = len(like.emissivity)
    start = np.concatenate([[0], np.cumsum(rows("lengths"))])
    index = rows("indices")
    arrays: dict[str, Any] = {name: rows(name) for name in _PER_ROW}
    return ExchangeRows(
        factors=sparse.csr_array((rows("data"), index, start), shape=(n, n)),
        stderr=sparse.csr_array((rows("stderr"), index, start), shape=(n, n)),
        emissivity=like.emissivity,
        wall_emissivity=like.wall_emissivity,
        pairs=None,
        patches=like.patches,
        cut=float(rows("cut").sum()) / n,
        rays=rays,
        seed=like.seed,
        seconds=np.nan,
        **arrays,
    )
