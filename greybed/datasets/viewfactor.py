"""View-factor data sets: designs of packings, traced factors with errors, split by packing."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from collections.abc import Callable
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from greybed._version import __version__
from greybed.closures.viewfactor import PairMarkers, neighbourhood, pair_markers
from greybed.closures.viewfactor.exact import pair_factor
from greybed.core import InputError, Packing
from greybed.core.config import choice, quantity, tables, whole
from greybed.core.files import atomic_path, output_folder, writable_file
from greybed.core.progress import progress
from greybed.core.readers.opening import mapped, shown
from greybed.datasets.generate import MOST_SPHERES, random_packing
from greybed.datasets.sizes import parse_sizes
from greybed.raytrace import standard_error
from greybed.raytrace.tally import MOST_RAYS, image_keys, trace

Array = NDArray[np.float64]

FORMAT = "greybed-viewfactors"
SPLITS = ("train", "calibrate", "test")
MARKERS = tuple(f.name for f in fields(PairMarkers))
COLUMNS = (*MARKERS, "exact", "factor", "stderr", "weight")
# Pairs whose factor is expected below this lie out of reach: a trace of the default length
# gives them a few rays at most.
LEAST_FACTOR = 5e-5
# Pairs expected below this are thinned (they are nine in ten); their weight makes up for it.
FULL_FACTOR = 1e-4
LEAST_SHARE = 0.05
MOST_SEED = 2**32 - 1


@dataclass(frozen=True, kw_only=True)
class PackingDesign:
    """One packing of a data set."""

    fraction: float = quantity("dimensionless", above=0.0, at_most=0.7)  # solid fraction [-]
    sizes: str = "mono:1mm"  # as for greybed pack
    count: int = whole(500, at_least=20, at_most=MOST_SPHERES)  # spheres [-]
    shake: int = whole(100, at_least=0)  # Monte-Carlo sweeps, 0 leaves spheres just touching [-]
    split: str = choice(SPLITS, "train")

    def __post_init__(self) -> None:
        parse_sizes(self.sizes)  # refused here, not after hours of other packings


@dataclass(frozen=True, kw_only=True)
class Design:
    """A data set: packings, and how each is traced."""

    packing: tuple[PackingDesign, ...] = tables("kind", {"random": PackingDesign})
    rays: int = whole(150_000, at_least=100, at_most=MOST_RAYS)  # per emitter [-]
    emitters: int = whole(40, at_least=1)  # per packing [-]
    seed: int = whole(1, at_least=0, at_most=MOST_SEED)

    def __post_init__(self) -> None:
        if not self.packing:
            raise InputError("packing is empty; give at least one [[packing]] table.")
        if not 0 <= self.seed <= MOST_SEED:  # also from --seed, which no case rule sees
            raise InputError(f"seed = {self.seed} [-] must lie in 0 ... {MOST_SEED}; mend it.")


def default_design(seed: int = 1) -> Design:
    """Solid fractions 0.10 to 0.63, one size, log-normal and two sizes; a minute on two cores."""
    mono, wide, two = "mono:1mm", "lognormal:1mm,1.3", "discrete:0.7mm=0.5,1.4mm=0.5"
    rows: tuple[tuple[str, str, tuple[float, ...]], ...] = (
        ("train", mono, (0.10, 0.20, 0.30, 0.40, 0.50, 0.55, 0.62)),
        ("train", wide, (0.10, 0.25, 0.40, 0.50, 0.60, 0.63)),
        ("train", two, (0.15, 0.35, 0.45, 0.55, 0.60, 0.63)),
        ("calibrate", mono, (0.15, 0.58)),
        ("calibrate", wide, (0.30, 0.55)),
        ("calibrate", two, (0.25, 0.50)),
        ("test", mono, (0.12, 0.45, 0.57)),
        ("test", wide, (0.20, 0.52)),
        ("test", two, (0.40, 0.58)),
    )
    packings = [
        # Every other packing keeps its touching pairs, as a settled bed has them.
        PackingDesign(fraction=phi, sizes=sizes, split=split, shake=100 * (k % 2))
        for split, sizes, fractions in rows
        for k, phi in enumerate(fractions)
    ]
    return Design(packing=tuple(packings), seed=seed)


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
        Each packing's design and what came out (spheres, overlaps, missed share).
    digest : str
        SHA-256 over all columns.
    """

    columns: dict[str, Array]
    packing: NDArray[np.int64]
    packings: list[dict[str, Any]]
    digest: str = field(init=False)

    def __post_init__(self) -> None:
        digest = hashlib.sha256(np.ascontiguousarray(self.packing).tobytes())
        for name in COLUMNS:
            digest.update(np.ascontiguousarray(self.columns[name]).tobytes())
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
    who = np.sort(rng.choice(len(packing), min(emitters, len(packing)), replace=False))
    hood = neighbourhood(packing, reach_of(packing), who)
    markers = pair_markers(packing, hood)
    exact = pair_factor(markers.radius_over_distance, markers.radius_ratio)
    # Thinned by what is known before the trace, never by its outcome; 0.03 because a pencil
    # that is wholly blocked still lets a little through between its lines.
    expected = exact * (1.03 - markers.blocked_fraction)
    share = np.clip(expected / FULL_FACTOR, LEAST_SHARE, 1.0)
    keep = rng.random(len(share)) < share
    tally = trace(packing, rays=rays, seed=seed, emitters=who, images=True)
    # Tallies stand in the order (emitter, key): a binary search per emitter pairs them.
    key = image_keys(hood.sphere, hood.image)[hood.within]
    owner = hood.owner[hood.within]
    hits = np.zeros(len(key), np.int64)
    for i in who:
        mine = slice(*np.searchsorted(tally.emitter, [i, i + 1]))
        keys, counts = tally.key[mine], tally.count[mine]
        near = slice(*np.searchsorted(owner, [i, i + 1]))
        at = np.minimum(np.searchsorted(keys, key[near]), len(keys) - 1)
        hits[near] = np.where(keys[at] == key[near], counts[at], 0)
    columns = {name: getattr(markers, name) for name in MARKERS} | {
        "exact": exact,
        "factor": hits / rays,
        "stderr": standard_error(hits, rays),
        "weight": 1.0 / share,
    }
    return {name: column[keep] for name, column in columns.items()}


def generate(
    design: Design,
    path: str | os.PathLike[str],
    *,
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
    show_progress : bool
        Draw a progress bar.
    on_packing : callable, optional
        Called with the number of each finished packing.

    Returns
    -------
    ViewFactorData
    """
    target = writable_file(path)
    parts = output_folder(target.with_name(target.name + ".parts"))
    done = []
    with progress(len(design.packing), "tracing packings", show=show_progress) as advance:
        for number, entry in enumerate(design.packing):
            seed = design.seed + 1000 * number
            settings = json.dumps([asdict(entry), design.rays, design.emitters, seed, __version__])
            name = hashlib.sha256(settings.encode()).hexdigest()[:16]
            part = parts / f"{name}.npz"
            columns = _kept(part)
            if columns is None:
                packing = random_packing(
                    entry.count, entry.fraction, parse_sizes(entry.sizes), seed=seed,
                    shake=entry.shake,
                )  # fmt: skip
                columns = rows_of(packing, design.emitters, design.rays, seed)
                with atomic_path(part) as temporary:
                    np.savez(temporary, **columns)  # type: ignore[arg-type]
            done.append(columns)
            advance(1)
            if on_packing is not None:
                on_packing(number)
    data = ViewFactorData(
        {name: np.concatenate([part[name] for part in done]) for name in COLUMNS},
        np.repeat(np.arange(len(done)), [len(part["factor"]) for part in done]),
        [asdict(entry) for entry in design.packing],
    )
    write(data, design, target)
    shutil.rmtree(parts, ignore_errors=True)
    return data


def _kept(part: Path) -> dict[str, Array] | None:
    """Columns that a stopped run has left, or None where they are to be made."""
    try:
        # Opened here, for numpy would leave a damaged file open.
        with open(part, "rb") as stream, np.load(stream, allow_pickle=False) as archive:
            return {key: archive[key] for key in COLUMNS}
    except Exception:  # absent, or cut as after a power failure: made again, with the same bits
        return None


def write(data: ViewFactorData, design: Design, path: Path) -> None:
    """Write a data set to HDF5, every column with its unit."""
    with atomic_path(path) as temporary, h5py.File(temporary, "w", libver="v110") as file:
        file.attrs["format"] = np.bytes_(FORMAT)
        file.attrs["design"] = np.bytes_(json.dumps(asdict(design)))
        file.attrs["sha256"] = np.bytes_(data.digest)
        file.attrs["greybed"] = np.bytes_(__version__)
        for name in COLUMNS:
            column = file.create_dataset(
                name, data=data.columns[name], compression="gzip", shuffle=True, fletcher32=True
            )
            column.attrs["units"] = np.bytes_("-")
        packing = file.create_dataset(
            "packing", data=data.packing.astype(np.int32), compression="gzip", fletcher32=True
        )
        packing.attrs["units"] = np.bytes_("-")


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
            columns = {name: content[name][...] for name in COLUMNS}
            packing = content["packing"][...].astype(np.int64)
            design = json.loads(content.attrs["design"])
            stored = content.attrs["sha256"].decode()
    except InputError:
        raise
    except Exception as error:  # what h5py raises for a damaged file is not documented
        raise InputError(
            f"{file}: cannot read this data set ({shown(str(error), 80)}); copy it or make it "
            "again."
        ) from None
    data = ViewFactorData(columns, packing, design["packing"])
    if data.digest != stored:
        raise InputError(
            f"{file}: the data do not match their SHA-256; copy the file again or make it again."
        )
    return data
