"""View-factor data sets: designs of packings, traced factors with errors, split by packing."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from greybed._version import __version__
from greybed.closures.viewfactor import PairMarkers, neighbourhood, pair_markers
from greybed.closures.viewfactor.bed import inner_fraction
from greybed.core import InputError, Packing
from greybed.core.exact import pair_factor
from greybed.core.files import atomic_path, output_folder, writable_file
from greybed.core.processes import finished, processes
from greybed.core.progress import progress
from greybed.core.readers.opening import mapped, shown
from greybed.core.writers.hdf5_stream import written_hdf5
from greybed.datasets.beds import (
    Bed,
    as_table,
    emitters_of,
)
from greybed.datasets.columns import whole_column
from greybed.datasets.designs import (
    MOST_SEED,
    Design,
    PackingDesign,
    default_design,
    quick_design,
)
from greybed.datasets.tables import (
    EXCHANGE_COLUMNS,
    RESULTS,
    WALL_COLUMNS,
    exchange_rows_of,
    wall_rows_of,
)
from greybed.raytrace import standard_error
from greybed.raytrace.errors import sequence_error
from greybed.raytrace.tally import image_keys, trace

__all__ = [
    "MOST_SEED",
    "Design",
    "PackingDesign",
    "ViewFactorData",
    "default_design",
    "generate",
    "quick_design",
    "reach_of",
    "read",
    "rows_of",
    "write",
]

Array = NDArray[np.float64]

FORMAT = "greybed-viewfactors"
MARKERS = tuple(f.name for f in fields(PairMarkers))
COLUMNS = (*MARKERS, *RESULTS)
# Pairs whose factor is expected below this lie out of reach: a trace of the default length
# gives them a few rays at most.
LEAST_FACTOR = 5e-5
# Pairs expected below this are thinned (they are nine in ten); their weight makes up for it.
FULL_FACTOR = 1e-4
LEAST_SHARE = 0.05


@dataclass(frozen=True, eq=False)
class ViewFactorData:
    """Rows of a data set; see :func:`generate`.

    Attributes
    ----------
    columns : dict of (m,) arrays
        The markers, ``exact`` (unobstructed factor), ``factor`` (traced), ``stderr``, and
        ``weight``: how many pairs of the packing a row stands for [-].
    packing : (m,) int array
        Which packing a row comes from.
    packings : list of dict
        Each packing's design.
    walls : ViewFactorData or None
        Rows (sphere, wall) with the same packings, their markers those of the set ``wall``.
    exchange : ViewFactorData or None
        Rows (pair, emissivity) of exchange factors, their markers those of the set ``exchange``.
    digest : str
        SHA-256 over all columns, those of walls and exchange included.
    """

    columns: dict[str, Array]
    packing: NDArray[np.int64]
    packings: list[dict[str, Any]]
    walls: ViewFactorData | None = None
    exchange: ViewFactorData | None = None
    digest: str = field(init=False)

    def __post_init__(self) -> None:
        digest = hashlib.sha256(np.ascontiguousarray(self.packing).tobytes())
        for name in sorted(self.columns):
            digest.update(name.encode())
            digest.update(np.ascontiguousarray(self.columns[name]).tobytes())
        for table in (self.walls, self.exchange):
            if table is not None:
                digest.update(table.digest.encode())
        object.__setattr__(self, "digest", digest.hexdigest())

    def __len__(self) -> int:
        return len(self.packing)

    def in_split(self, split: str) -> NDArray[np.bool_]:
        """Rows of one split; whole packings, never single rows."""
        wanted = np.array([entry["split"] == split for entry in self.packings])
        return wanted[self.packing]


def reach_of(packing: Packing, least: float = LEAST_FACTOR) -> float:
    """Distance beyond which a factor is expected below ``least`` [m].

    Free view r^2 / (4 d^2) of the largest sphere times the chance exp(-s / l) that a line of
    length s meets nothing, with the mean chord l = 4 (1 - phi) r32 / (3 phi) between spheres.
    """
    r, phi = packing.radii, packing.solid_fraction
    chord = 4.0 * (1.0 - phi) * (r**3).sum() / (r**2).sum() / (3.0 * phi)
    d = np.linspace(2.0, 200.0, 4000) * r.max()
    expected = r.max() ** 2 / (4.0 * d**2) * np.exp(-(d - 2.0 * r.max()) / chord)
    return float(d[np.flatnonzero(expected >= least)[-1]])


def rows_of(packing: Packing, emitters: int, rays: int, seed: int) -> dict[str, Array]:
    """Trace one packing and give a row for every pair (emitter, sphere in reach)."""
    rng = np.random.default_rng(seed)
    # By surface: a bed of many small spheres and a few large ones must show both.
    who = np.sort(
        rng.choice(
            len(packing), min(emitters, len(packing)), replace=False,
            p=packing.areas / packing.areas.sum(),
        )
    )  # fmt: skip
    hood = neighbourhood(packing, reach_of(packing), who)
    phi = inner_fraction(packing)
    # Thinned by what is known before the trace, never by its outcome: first by a mean field,
    # because most pairs in reach of large spheres are small ones that see nothing of each other.
    r, owner = packing.radii, hood.owner
    chord = 4.0 * (1.0 - phi) * (r**3).sum() / (r**2).sum() / (3.0 * phi)
    touching = r[owner] + r[hood.sphere]
    d = np.maximum(hood.distance, touching)
    expected = r[hood.sphere] ** 2 / (4.0 * d**2) * np.exp((touching - d) / chord)
    first = np.clip(expected / (0.2 * LEAST_FACTOR), LEAST_SHARE, 1.0)
    choose = hood.within & (rng.random(len(d)) < first)
    markers = pair_markers(packing, hood, choose, solid_fraction=phi)
    exact = pair_factor(markers.radius_over_distance, markers.radius_ratio)
    # Then by the pencil; 0.03 because one that is wholly blocked still lets a little through
    # between its lines.
    expected = exact * (1.03 - markers.blocked_fraction)
    share = np.clip(expected / FULL_FACTOR, LEAST_SHARE, 1.0)
    keep = rng.random(len(share)) < share
    tally = trace(packing, rays=rays, seed=seed, emitters=who, images=True)
    # Tallies stand in the order (emitter, key): a binary search per emitter pairs them.
    key = image_keys(hood.sphere, hood.image)[choose]
    owner = owner[choose]
    error = sequence_error(tally.emitter, tally.count, tally.squares, rays, tally.replicates)
    hits = np.zeros(len(key), np.int64)
    stderr = np.full(len(key), standard_error(0, rays))
    for i in who:
        mine = slice(*np.searchsorted(tally.emitter, [i, i + 1]))
        keys, counts = tally.key[mine], tally.count[mine]
        near = slice(*np.searchsorted(owner, [i, i + 1]))
        at = np.minimum(np.searchsorted(keys, key[near]), len(keys) - 1)
        hits[near] = np.where(keys[at] == key[near], counts[at], 0)
        stderr[near] = np.where(keys[at] == key[near], error[mine][at], stderr[near])
    columns = {name: getattr(markers, name) for name in MARKERS} | {
        "exact": exact,
        "factor": hits / rays,
        "stderr": stderr,
        "weight": 1.0 / (share * first[choose]),
    }
    return {name: column[keep] for name, column in columns.items()}


def generate(
    design: Design,
    path: str | os.PathLike[str],
    *,
    workers: int = 1,
    show_progress: bool = False,
    on_packing: Callable[[int], object] | None = None,
) -> ViewFactorData:
    """Make a data set and write it to HDF5; a killed run continues where it stopped.

    Parameters
    ----------
    design : Design
        Packings, rays, seed.
    path : path
        The HDF5 file. Finished packings wait in ``PATH.parts`` until all are there.
    workers : int
        Processes; does not change the result.
    show_progress : bool
        Draw a progress bar.
    on_packing : callable, optional
        Called with the number of each finished packing.

    Returns
    -------
    ViewFactorData
    """
    if workers < 1:
        raise InputError(f"workers = {workers} [-] must be at least 1; mend it.")
    target = writable_file(path)
    parts = output_folder(target.with_name(target.name + ".parts"))
    jobs = [
        (entry, design.emitters, design.rays, design.seed + 1000 * number, design.exchange, parts)
        for number, entry in enumerate(design.packing)
    ]
    done: list[dict[str, Array]] = [{}] * len(jobs)
    with (
        progress(len(jobs), "tracing packings", show=show_progress) as advance,
        _finished(jobs, workers) as finished,
    ):
        for number, columns in finished:
            done[number] = columns
            advance(1)
            if on_packing is not None:
                on_packing(number)
    tables = [as_table(entry) for entry in design.packing]
    data = ViewFactorData(
        *_joined(done, COLUMNS, ""),
        tables,
        ViewFactorData(*_joined(done, WALL_COLUMNS, "wall/"), tables),
        ViewFactorData(*_joined(done, EXCHANGE_COLUMNS, "exchange/"), tables),
    )
    write(data, design, target)
    shutil.rmtree(parts, ignore_errors=True)
    return data


def _joined(
    done: list[dict[str, Array]], names: tuple[str, ...], prefix: str
) -> tuple[dict[str, Array], NDArray[np.int64]]:
    """Columns of all packings one after the other, and which packing each row is from."""
    sizes = [len(part[f"{prefix}factor"]) for part in done]
    columns = {name: np.concatenate([part[prefix + name] for part in done]) for name in names}
    return columns, np.repeat(np.arange(len(done)), sizes)


@contextmanager
def _finished(
    jobs: list[tuple[Bed, int, int, int, bool, Path]], workers: int
) -> Iterator[Iterator[tuple[int, dict[str, Array]]]]:
    """Numbers and columns of the packings, as they are finished."""
    if workers == 1:
        yield ((number, _one(*job)) for number, job in enumerate(jobs))
        return
    order = {id(job): number for number, job in enumerate(jobs)}
    with processes(workers) as pool:
        yield ((order[id(job)], columns) for job, columns in finished(pool, _one, jobs, len(jobs)))


def _one(
    entry: Bed, emitters: int, rays: int, seed: int, exchange: bool, parts: Path
) -> dict[str, Array]:
    """Columns of one packing, made, or kept from a run that was stopped."""
    settings = json.dumps([as_table(entry), rays, emitters, seed, exchange, __version__])
    part = parts / f"{hashlib.sha256(settings.encode()).hexdigest()[:16]}.npz"
    columns = _kept(part)
    if columns is None:
        packing = entry.packing(seed)
        some = emitters_of(entry, emitters)
        columns = rows_of(packing, some, rays, seed)
        walls = wall_rows_of(packing, some, rays, seed)
        columns |= {f"wall/{name}": column for name, column in walls.items()}
        grey = {name: np.empty(0) for name in EXCHANGE_COLUMNS}
        if exchange:
            grey = exchange_rows_of(packing, some, rays, seed)
        columns |= {f"exchange/{name}": column for name, column in grey.items()}
        with atomic_path(part) as temporary:
            np.savez(temporary, **columns)  # type: ignore[arg-type]
    return columns


def _kept(part: Path) -> dict[str, Array] | None:
    """Columns that a stopped run has left, or None where they are to be made."""
    try:
        # Opened here, for numpy would leave a damaged file open.
        with open(part, "rb") as stream, np.load(stream, allow_pickle=False) as archive:
            names = (
                *COLUMNS,
                *(f"wall/{name}" for name in WALL_COLUMNS),
                *(f"exchange/{name}" for name in EXCHANGE_COLUMNS),
            )
            return {key: archive[key] for key in names}
    except Exception:  # absent, or cut as after a power failure: made again, with the same bits
        return None


def write(data: ViewFactorData, design: Design, path: Path) -> None:
    """Write a data set to HDF5, every column with its unit."""
    with atomic_path(path) as temporary, written_hdf5(temporary, libver="v110") as file:
        file.attrs["format"] = np.bytes_(FORMAT)
        tables = {"packing": data.packings}
        settings = {"rays": design.rays, "emitters": design.emitters, "seed": design.seed}
        settings["exchange"] = int(design.exchange)
        file.attrs["design"] = np.bytes_(json.dumps(tables | settings))
        file.attrs["sha256"] = np.bytes_(data.digest)
        file.attrs["greybed"] = np.bytes_(__version__)
        _write_rows(file, data, COLUMNS)
        if data.walls is not None:
            _write_rows(file.create_group("wall"), data.walls, WALL_COLUMNS)
        if data.exchange is not None:
            _write_rows(file.create_group("exchange"), data.exchange, EXCHANGE_COLUMNS)


def _write_rows(group: h5py.Group, data: ViewFactorData, names: tuple[str, ...]) -> None:
    for name in (*names, "packing"):
        values = data.packing.astype(np.int32) if name == "packing" else data.columns[name]
        column = group.create_dataset(
            name, data=values, compression="gzip", shuffle=True, fletcher32=True
        )
        column.attrs["units"] = np.bytes_("-")


def read(path: str | os.PathLike[str]) -> ViewFactorData:
    """Read a data set.

    Raises
    ------
    InputError
        If the file is missing, not such a data set, truncated, or its hash does not match.
    """
    file = Path(path)
    with mapped(file):
        pass  # refuses what is missing, empty, or no regular file
    try:
        with h5py.File(file, "r") as content:
            if content.attrs.get("format", b"") != FORMAT.encode():
                raise InputError(
                    f"{file}: not a view-factor data set; make one with greybed dataset viewfactor."
                )
            columns, packing = _read_rows(content, COLUMNS)
            wall = _read_rows(content["wall"], WALL_COLUMNS)
            exchange = _read_rows(content["exchange"], EXCHANGE_COLUMNS)
            design = json.loads(content.attrs["design"])
            stored = content.attrs["sha256"].decode()
            tables = design["packing"]
    except InputError:
        raise
    except Exception as error:  # what h5py raises for a damaged file is not documented
        raise InputError(
            f"{file}: cannot read this data set ({shown(str(error), 80)}); copy it or make it "
            "again."
        ) from None
    data = ViewFactorData(
        columns, packing, tables, ViewFactorData(*wall, tables), ViewFactorData(*exchange, tables)
    )
    if data.digest != stored:
        raise InputError(
            f"{file}: the data do not match their SHA-256; copy the file again or make it again."
        )
    return data


def _read_rows(
    group: h5py.Group, names: tuple[str, ...]
) -> tuple[dict[str, Array], NDArray[np.int64]]:
    columns = {name: whole_column(group, name, "f") for name in names}
    packing = whole_column(group, "packing", "i").astype(np.int64)
    if len({len(packing), *map(len, columns.values())}) != 1:
        raise ValueError("columns of different lengths")
    return columns, packing
