"""Files for ``hardening.py`` to spoil: for each format a whole one and the reader that takes it."""

from __future__ import annotations

import functools
import random
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from hardening_mutations import mutated, odd_archive, odd_closure, odd_hdf5, odd_json, odd_store

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"
Mutator = Callable[[bytes, random.Random], bytes]
Reader = Callable[[Path], Any]


@dataclass(frozen=True)
class Target:
    """A format.

    Attributes
    ----------
    name : str
        Of the file, with the extension that announces it.
    make : callable
        Writes a whole file below a folder and gives its place.
    read : callable
        Reads it; what it raises must be a ``GreybedError``.
    inside : callable, optional
        Changes what the file holds and keeps its check sums right; half of the inputs.
    """

    name: str
    make: Callable[[Path], Path]
    read: Reader
    inside: Mutator | None = None

    def input(self, content: bytes, rng: random.Random) -> bytes:
        """One spoilt file."""
        if self.inside is not None and rng.randrange(2):
            return self.inside(content, rng)
        return mutated(content, rng)


def _bed(walls: bool = False) -> Any:
    from greybed.core.packing import Packing
    from greybed.core.walls import Cylinder, Plane

    centres = [[0.1 + 0.3 * k, 0.5, 0.5] for k in range(6)]
    around = (Plane((0, 0, 0), (0, 0, 1), "floor"), Cylinder((1, 0.5, 0), (0, 0, 1), 5.0, "shell"))
    return Packing(centres, 0.1, [2, 1, 1], walls=around if walls else ())


def _text(name: str, content: str | bytes) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        path = folder / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return make


def _copied(*parts: str) -> Callable[[Path], Path]:
    """A file of the examples, with those beside it that it may name."""

    def make(folder: Path) -> Path:
        source = EXAMPLES.joinpath(*parts)
        for beside in source.parent.iterdir():
            if beside.is_file() and beside.stat().st_size < 1_000_000:
                shutil.copy(beside, folder)
        return folder / source.name

    return make


def _packing(name: str, walls: bool = False) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        from greybed.core.writers import write_packing

        return write_packing(_bed(walls), folder / name)

    return make


def _read_bed(path: Path) -> None:
    from greybed.core.readers import read_packing

    bed = read_packing(path)
    if not (np.isfinite(bed.centres).all() and (bed.radii > 0.0).all()):
        raise AssertionError("a bed that cannot be was taken")


def _dump() -> bytes:
    rows = "".join(f"{k} 1 {0.1 + 0.3 * k} 0.5 0.5 0.1\n" for k in range(6))
    frame = (
        "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n6\nITEM: BOX BOUNDS pp ff ff\n0 2\n0 1\n0 1\n"
        f"ITEM: ATOMS id type x y z radius\n{rows}"
    )
    return 2 * frame.encode()


def _vtk(binary: bool) -> bytes:
    centres, radii = np.arange(18.0).reshape(6, 3), np.full(6, 0.1)
    head = f"# vtk DataFile Version 3.0\nbed\n{'BINARY' if binary else 'ASCII'}\n"
    parts = [head.encode() + b"DATASET POLYDATA\nPOINTS 6 double\n"]
    for array, after in ((centres, b"\nPOINT_DATA 6\nSCALARS radius double 1\nLOOKUP_TABLE "
                          b"default\n"), (radii, b"\n")):  # fmt: skip
        text = " ".join(f"{x:g}" for x in array.ravel()).encode()
        parts += [array.astype(">f8").tobytes() if binary else text, after]
    return b"".join(parts)


def _mesh(name: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        import trimesh

        box = trimesh.creation.box()
        path = folder / name
        if name == "ascii.stl":
            path.write_text(trimesh.exchange.stl.export_stl_ascii(box))
        else:
            box.export(path)
        return path

    return make


def _read_mesh(path: Path) -> None:
    from greybed.core.readers import read_mesh

    read_mesh(path, "mm")


def _case(module: str, function: str) -> Reader:
    def read(path: Path) -> Any:
        from importlib import import_module

        return getattr(import_module(module), function)(path)

    return read


def _read_design(path: Path) -> None:
    from greybed.core.config import read_case
    from greybed.datasets.viewfactor import Design

    read_case(path, Design)


def _read_drag_design(path: Path) -> None:
    from greybed.core.config import read_case
    from greybed.datasets.drag_design import DragDesign

    read_case(path, DragDesign)


def _shipped(name: str) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        from greybed.closures.shipping import model_path

        return Path(shutil.copy(model_path(f"shipped:{name}"), folder / f"{name}.closure"))

    return make


def _forest(folder: Path) -> Path:
    from greybed.closures import save
    from greybed.closures.predictors import Forest
    from greybed.closures.viewfactor.closure import Domain, ViewFactorClosure
    from greybed.closures.viewfactor.visibility import MARKER_SETS

    markers = MARKER_SETS["pencil"]
    n = len(markers.feature_names)
    stump = {
        "roots": np.array([0], np.int32), "feature": np.array([0, -1, -1], np.int32),
        "threshold": np.array([0.5, 0, 0], np.float32), "left": np.array([1, 0, 0], np.int32),
        "value": np.array([[0.1, 0.2], [0.3, 0.1], [0.2, 0.2]]),
    }  # fmt: skip
    rows = np.random.default_rng(1).normal(size=(100, n))
    closure = ViewFactorClosure(markers, Forest.from_arrays(stump), Domain.of(rows), {})
    return save(closure, folder / "forest.closure")


def _term(folder: Path) -> Path:
    from greybed.closures.term import GreyBoxTerm

    return GreyBoxTerm(
        name="term", covariate="diameter", unit="m", response="velocity", reference=1e-3,
        amplitude=0.1, exponent=0.5, side=1, window=(1e-4, 1e-2),
    ).save(folder / "term.json")  # fmt: skip


def _load_term(path: Path) -> None:
    from greybed.closures.term import load_term

    load_term(path)


def _load_closure(path: Path) -> None:
    from greybed.closures import load_any

    load_any(path)


@functools.cache
def _particles() -> Any:
    from greybed.core.readers import read_packing
    from greybed.dem.case import load_particle_case
    from greybed.dem.runner import ParticleRun

    case = load_particle_case(EXAMPLES / "campaign" / "bounce.toml")
    return ParticleRun(case, {0: read_packing(EXAMPLES / "campaign" / "start.csv")}, threads=1)


def _particle_checkpoint(folder: Path) -> Path:
    return Path(_particles().save(folder / "checkpoint.npz", key="k"))


def _restore_particles(path: Path) -> None:
    from greybed.dem.checkpoint import kept_with

    if kept_with(path) is not None:
        _particles().restore(path)
        _particles().simulation.run(3)


@functools.cache
def _flow(kind: str) -> Any:
    import tempfile

    from greybed.coupling.flow_run import FlowRun
    from greybed.coupling.gas_case import GasRun, load_gas_case
    from greybed.coupling.two_fluid_case import TwoFluidRun, load_two_fluid_case

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "case.toml"
        name = "channel" if kind == "gas" else "clusters"
        text = (EXAMPLES / "flows" / f"{name}.toml").read_text()
        path.write_text(
            text.replace("[64, 128, 1]", "[8, 8, 1]").replace("[4, 1, 32]", "[4, 1, 8]")
        )
        if kind == "gas":
            case: Any = load_gas_case(path)
            return FlowRun(case, GasRun(case))
        case = load_two_fluid_case(path)
        return FlowRun(case, TwoFluidRun(case))


def _flow_checkpoint(kind: str) -> Callable[[Path], Path]:
    return lambda folder: Path(_flow(kind).save(folder / f"{kind}.npz", "key"))


def _restore_flow(kind: str) -> Reader:
    return lambda path: _flow(kind).restore(path, "key")


def _block(folder: Path) -> Path:
    from greybed.datasets.tracing import keep

    keep(folder / "0-6.npz", {"data": np.ones(4), "indices": np.arange(4), "lengths": np.ones(6)})
    return folder / "0-6.npz"


def _read_block(path: Path) -> None:
    from greybed.datasets.tracing import Kept

    if Kept(path, ("data", "indices", "lengths")).whole:
        Kept(path, ("data",))["data"]


def _store(folder: Path) -> Path:
    from greybed.calibration.store import Outcome, Store

    path = folder / "runs.sqlite"
    store = Store(path)
    for k in range(3):
        store.put(f"key{k}", Outcome("drum", {"friction": 0.1 * k}, k, {"angle": 20.0 + k}))
    store.close()
    return path


def _read_store(path: Path) -> None:
    from greybed.calibration.store import Outcome, Store

    store = Store(path)
    try:
        for k in range(4):
            found = store.get(f"key{k}")
            if found is not None and not isinstance(found.values, dict):
                raise AssertionError("an outcome that cannot be was taken")
        store.put("key9", Outcome("drum", {}, 0, None, "failed"))
    finally:
        store.close()


def _factors(folder: Path) -> Path:
    from greybed.datasets.factors_file import write_factors
    from greybed.raytrace import view_factors

    bed = _bed(walls=True)
    return write_factors(folder / "view_factors.h5", bed, view_factors(bed, rays=50, seed=1))


def _exchange(folder: Path) -> Path:
    from greybed.datasets.exchange_file import write_exchange
    from greybed.raytrace import exchange_factors

    bed = _bed(walls=True)
    found = exchange_factors(bed, emissivity=[0.5], rays=50, seed=1)
    return Path(write_exchange(folder / "exchange_factors.h5", bed, found))


def _view_data(folder: Path) -> Path:
    from greybed.core.config import build
    from greybed.datasets.viewfactor import Design, generate

    tables = [
        {"kind": "random", "count": 30, "shake": 1, "fraction": 0.2, "split": split}
        for split in ("train", "calibrate", "test")
    ]
    design = build(Design, {"rays": 100, "emitters": 3, "seed": 1, "packing": tables}, "d.toml")
    generate(design, folder / "data.h5")
    return folder / "data.h5"


def _drag_data(folder: Path) -> Path:
    from dataclasses import replace

    from greybed.datasets.filtered_drag import COLUMNS, shipped_filtered_drag, write_filtered_drag

    data = shipped_filtered_drag()
    few = {name: getattr(data, name)[:50] for name in COLUMNS}
    path = folder / "drag.h5"
    write_filtered_drag(path, replace(data, **few))
    return path


def _read_measured(path: Path) -> None:
    from greybed.residual.table import read_table

    read_table(path, "velocity", counters=("repeat",))


def _read_campaign(path: Path) -> None:
    from greybed.datasets.case_campaign import cases_of

    cases_of(path)


def _engine_dump(folder: Path) -> Path:
    from greybed.dem.liggghts.dump import _HEAD, _WIDTH

    rows = np.arange(3.0 * _WIDTH)
    head = _HEAD.pack(5, 3, 0, *([0] * 6), *([0.0, 1.0] * 3), _WIDTH, 1)
    path = folder / "engine.bin"
    path.write_bytes(head + np.int32(len(rows)).tobytes() + rows.tobytes())
    return path


def _slurm(path: Path) -> None:
    from greybed.core.clusters import slurm_table

    slurm_table(path)


_FLOW = "greybed.coupling."
TARGETS = {
    "LIGGGHTS dump": Target("bed.dump", _text("bed.dump", _dump()), _read_bed),
    "CSV of spheres": Target("bed.csv", _packing("bed.csv"), _read_bed),
    "HDF5 of spheres": Target("bed.h5", _packing("bed.h5", True), _read_bed, odd_hdf5),
    "VTK, text": Target("a.vtk", _text("a.vtk", _vtk(False)), _read_bed),
    "VTK, binary": Target("b.vtk", _text("b.vtk", _vtk(True)), _read_bed),
    "mesh, STL text": Target("ascii.stl", _mesh("ascii.stl"), _read_mesh),
    "mesh, STL binary": Target("box.stl", _mesh("box.stl"), _read_mesh),
    "mesh, PLY": Target("box.ply", _mesh("box.ply"), _read_mesh),
    "mesh, OBJ": Target("box.obj", _mesh("box.obj"), _read_mesh),
    "case, thermal bed": Target(
        "case.toml", _copied("heated_bed", "case.toml"), _case(_FLOW + "case", "load_case")
    ),
    "case, particles": Target(
        "hopper.toml", _copied("particles", "hopper.toml"),
        _case("greybed.dem.case", "load_particle_case"),
    ),
    "case, bodies": Target(
        "spherocylinder_drop.toml", _copied("particles", "spherocylinder_drop.toml"),
        _case("greybed.dem.case", "load_particle_case"),
    ),
    "case, gas": Target(
        "channel.toml", _copied("flows", "channel.toml"),
        _case(_FLOW + "gas_case", "load_gas_case"),
    ),
    "case, two-fluid": Target(
        "clusters.toml", _copied("flows", "clusters.toml"),
        _case(_FLOW + "two_fluid_case", "load_two_fluid_case"),
    ),
    "case, gas-particles": Target(
        "khawaja.toml", _copied("flows", "khawaja.toml"),
        _case(_FLOW + "gas_particles_case", "load_gas_particles_case"),
    ),
    "study, diagnosis": Target(
        "study.toml", _copied("settling_spheres", "study.toml"),
        _case("greybed.residual", "read_study"),
    ),
    "study, calibration": Target(
        "heap_and_hopper.toml", _copied("calibration", "heap_and_hopper.toml"),
        _case("greybed.calibration.read", "read_study"),
    ),
    "campaign": Target("campaign.toml", _copied("campaign", "campaign.toml"), _read_campaign),
    "design, view factors": Target(
        "design.toml",
        _text("design.toml", "rays = 100\nemitters = 5\nseed = 4\n" + "".join(
            f'[[packing]]\nkind = "random"\ncount = 60\nfraction = 0.3\nsplit = "{split}"\n'
            for split in ("train", "calibrate", "test")
        )),
        _read_design,
    ),
    "design, drag": Target(
        "small.toml", _copied("filtered_drag", "small.toml"), _read_drag_design
    ),
    "Slurm": Target(
        "slurm.toml", _text("slurm.toml", 'jobs = 2\n[slurm]\nqueue = "a"\ncores = 4\n'), _slurm
    ),
    "measured table": Target(
        "settling.csv", _copied("settling_spheres", "settling.csv"), _read_measured
    ),
    "closure, network": Target(
        "mlp.closure", _shipped("viewfactor_mlp_pencil"), _load_closure, odd_closure
    ),
    "closure, forest": Target("forest.closure", _forest, _load_closure, odd_closure),
    "closure, drag": Target(
        "drag.closure", _shipped("filtered_drag_mlp_plain"), _load_closure, odd_closure
    ),
    "grey-box term": Target("term.json", _term, _load_term, odd_json),
    "checkpoint, particles": Target(
        "checkpoint.npz", _particle_checkpoint, _restore_particles, odd_archive
    ),
    "checkpoint, gas": Target(
        "gas.npz", _flow_checkpoint("gas"), _restore_flow("gas"), odd_archive
    ),
    "checkpoint, two-fluid": Target(
        "two.npz", _flow_checkpoint("two-fluid"), _restore_flow("two-fluid"), odd_archive
    ),
    "block of a trace": Target("0-6.npz", _block, _read_block, odd_archive),
    "view_factors.h5": Target("view_factors.h5", _factors, _case(
        "greybed.datasets.factors_file", "read_factors"), odd_hdf5),
    "exchange_factors.h5": Target("exchange_factors.h5", _exchange, _case(
        "greybed.datasets.exchange_file", "read_exchange"), odd_hdf5),
    "data set, view factors": Target("data.h5", _view_data, _case(
        "greybed.datasets.viewfactor", "read"), odd_hdf5),
    "data set, drag": Target("drag.h5", _drag_data, _case(
        "greybed.datasets.filtered_drag", "read_filtered_drag"), odd_hdf5),
    "store of runs": Target("runs.sqlite", _store, _read_store, None),
    "dump of an engine": Target("engine.bin", _engine_dump, _case(
        "greybed.dem.liggghts.dump", "read_dump")),
}  # fmt: skip


def of_store(folder: Path) -> Mutator:
    """Mutator of a store's cells, which needs a place for the file."""
    return lambda content, rng: odd_store(content, rng, folder)
