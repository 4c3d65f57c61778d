"""The deck: text of LIGGGHTS' input for a case, stretch by stretch of its time."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from greybed.core.files import atomic_path
from greybed.dem.case_tables import FileTable, PackTable, StreamTable
from greybed.dem.liggghts import models
from greybed.dem.liggghts.dump import FIELDS
from greybed.dem.liggghts.meshes import stl
from greybed.dem.liggghts.places import box_of, region_of
from greybed.dem.liggghts.sources import data_text, insertion
from greybed.dem.liggghts.walls import Span, WallPlan, plan
from greybed.dem.runner import ParticleRun

Array = NDArray[np.float64]

DECK, DATA, LOG = "in.liggghts", "start.data", "log.liggghts"
TOLD = "greybed: step"
# A pair that has parted by so much of its distance has lost its spring: it stays otherwise.
_PARTED = 1.05
# Pairs nearer than so many mean radii are listed, as in our own engine.
_SKIN = 0.25


@dataclass(frozen=True)
class Deck:
    """Input of one run.

    Attributes
    ----------
    text : str
        The deck.
    files : dict of str
        Data and meshes, by name.
    columns : int
        Numbers in a line of its output: step, particles, three for each wall, two for each sink.
    frames : int
        Steps between two frames, or 0.
    """

    text: str
    files: dict[str, str]
    columns: int
    frames: int

    def write(self, folder: Path, deck: str = DECK) -> None:
        """Write deck and files into a folder."""
        for name, text in {**self.files, deck: self.text}.items():
            with atomic_path(folder / name) as part:
                part.write_text(text)


def deck_of(run: ParticleRun, extra: tuple[str, ...] = ()) -> Deck:
    """The deck of a case that is ready to run, with the spheres that it starts with.

    Parameters
    ----------
    run : ParticleRun
        The case.
    extra : tuple of str
        Lines with fixes of a host.

    Raises
    ------
    InputError
        For what LIGGGHTS cannot do.
    """
    return _Writer(run, extra).deck()


class _Writer:
    """Writes a deck; ``lines`` grow from top to bottom."""

    def __init__(self, run: ParticleRun, extra: tuple[str, ...]) -> None:
        self.extra = extra
        self.run, self.case, self.sim = run, run.case, run.simulation
        case, sim = self.case, self.sim
        self.law = case.contact_law
        materials = list(sim.materials)
        used = {table.material for table in case.particles}
        names = [material.name for material in materials]
        self.names = names
        of_walls = [wall.material or names[0] for wall in case.wall]
        self.types = models.Types(
            materials[: len(used)], [m for m in materials if m.name in of_walls]
        )
        self.contacts = case.contacts(used)
        periodic = case.periodic
        axes = "" if periodic is None else periodic.axes
        self.periodic = ("x" in axes, "y" in axes, "z" in axes)
        region = region_of(case, sim.centres, sim.radii)
        smallest = float(sim.radii.min())
        for table in case.particles:
            if not isinstance(table, FileTable) and table.sizes is not None:
                smallest = min(smallest, float(table.distribution.radii(1000).min()))
        self.walls = [
            plan(
                k, wall, self.types.of_wall(name), self._span(k), region, self.periodic, smallest
            )
            for k, (wall, name) in enumerate(zip(case.wall, of_walls, strict=True))
        ]  # fmt: skip
        self.box = box_of(case, region, self.walls, sim.time_step, float(sim.radii.max()))
        self.lines: list[str] = []
        self.gone: set[int] = set()
        self.moving: set[int] = set()

    def deck(self) -> Deck:
        """The whole deck."""
        self._start()
        times = {0, self.run.steps} | {step for w in self.walls for step in self._times(w)}
        times |= {self._look_at(t) for t in self._sources().values()}
        stops = sorted(int(t) for t in times if t <= self.run.steps)
        for step, end in itertools.pairwise(stops):
            self._change(step)
            self._stretch(end - step)
        # The end as it is, whatever the steps between two dumps.
        self.lines += ["undump samples", f"dump last all custom 1 last.*.bin {FIELDS}", "run 0"]
        files = {w.file: stl(w.mesh, f"wall_{w.number}") for w in self.walls if not w.primitive}
        files[DATA] = self._data()
        columns = 2 + 3 * len(self.walls) + 2 * len(self.case.sink)
        return Deck("\n".join(self.lines) + "\n", files, columns, self._frames())

    # -- times ------------------------------------------------------------------------------

    def _look_at(self, time: float) -> float:
        """The first look at or after a time, as in our own engine; infinite after the end."""
        step = math.ceil(time / self.sim.time_step - 1e-9)
        look = math.ceil(step / self.run.look) * self.run.look
        return look if look < self.run.steps else math.inf

    def _span(self, k: int) -> Span:
        wall = self.case.wall[k]
        return Span(*(self._look_at(t) for t in (wall.starts, wall.stops, wall.removed)))

    @staticmethod
    def _times(wall: WallPlan) -> list[float]:
        span = wall.span
        moves = [span.starts, span.stops] if wall.motion != "none" else []
        return [*moves, span.removed]

    def _sources(self) -> dict[int, float]:
        """Times at which tables of particles begin to put in what is not there at the start."""
        found = {}
        for number, table in enumerate(self.case.particles):
            if isinstance(table, StreamTable):
                if table.mass > self.run.tally.streamed[number]:
                    found[number] = table.starts
            elif isinstance(table, PackTable) and table.at > 0.0:
                found[number] = table.at
        return found

    def _frames(self) -> int:
        every = self.case.output.frames
        return 0 if every is None else max(1, round(every / self.sim.time_step))

    # -- parts ------------------------------------------------------------------------------

    def _start(self) -> None:
        sim, law, run = self.sim, self.law, self.run
        edges = " ".join("p" if repeats else "m" for repeats in self.periodic)
        # Ranks beside each other, not above each other: a bed fills the lower part only.
        down = int(np.abs(sim.gravity).argmax()) if sim.gravity.any() else -1
        cut = " ".join("1" if axis == down else "*" for axis in range(3))
        linear = law.normal == "linear"
        masses = [self._mass(m.name) for m in self.types.particles] if linear else []
        size = float(np.linalg.norm(sim.gravity))
        self.lines += [
            "# A case of particles, written by greybed simulate --engine liggghts.",
            "atom_style granular", "atom_modify map array", f"boundary {edges}", "newton off",
            "communicate single vel yes", "units si", "soft_particles yes", f"processors {cut}",
            f"read_data {DATA}", f"neighbor {_SKIN * float(sim.radii.mean())!r} bin",
            f"neigh_modify delay 0 contact_distance_factor {_PARTED}",
            *models.properties(law, self.types, self.contacts, masses),
            f"pair_style gran {models.model(law)} {models.settings(law)}".rstrip(),
            "pair_coeff * *", f"timestep {sim.time_step!r}",
        ]  # fmt: skip
        if size > 0.0:
            way = " ".join(f"{g!r}" for g in (sim.gravity / size).tolist())
            self.lines.append(f"fix gravity all gravity {size!r} vector {way}")
        for wall in self.walls:
            if wall.primitive:
                k = wall.number
                self.lines.append(
                    f"fix wall_{k} all wall/gran {models.model(law)} primitive type {wall.kind} "
                    f"{wall.primitive} store_force yes {models.settings(law)}".rstrip()
                )
                self.lines += [
                    f"compute push_{k}_{a} all reduce sum f_force_wall_{k}[{a}]" for a in (1, 2, 3)
                ]
        for k, sink in enumerate(self.case.sink):
            sides = " ".join(f"{a!r} {b!r}" for a, b in zip(sink.lower, sink.upper, strict=True))
            self.lines += [
                f"region sink_{k} block {sides} units box",
                f"variable mass_in_{k} equal mass(all,sink_{k})",
                f"variable count_in_{k} equal count(all,sink_{k})",
            ]
        self.lines += [
            *self.extra, "fix integrate all nve/sphere", "compute touch all contact/atom",
            "variable nothing equal 0", "variable now equal step",
            f'fix tell all print {run.look} "{TOLD} ${{now}}"',
            f"dump samples all custom {run._sample} sample.*.bin {FIELDS}",
        ]  # fmt: skip
        if every := self._frames():
            self.lines.append(f"dump frames all custom {every} frame.*.bin {FIELDS}")

    def _change(self, step: int) -> None:
        """What begins, comes or goes at a step."""
        renewed, lines = step == 0, []
        for wall in self.walls:
            k, span = wall.number, wall.span
            ends = step in (span.removed, span.stops)
            if ends and k in self.moving:
                lines += wall.stop()
            if step == span.removed and k not in self.gone:
                if wall.primitive:
                    lines += [f"uncompute push_{k}_{a}" for a in (1, 2, 3)] + [f"unfix wall_{k}"]
                renewed = renewed or not wall.primitive
            begins = wall.motion != "none" and step == span.starts and step < span.stops
            renewed = renewed or (wall.motion == "surface" and (begins or step == span.stops))
        if renewed and step > 0:
            lines += ["unfix walls"] * bool(self._meshes())
        for wall in self.walls:
            k, span = wall.number, wall.span
            was_there = k not in self.gone
            if step >= span.removed:
                if was_there and not wall.primitive and step > 0:
                    lines.append(f"unfix mesh_{k}")
                self.gone.add(k)
                self.moving.discard(k)
                continue
            moves = wall.motion != "none" and span.starts <= step < span.stops
            if not wall.primitive:
                changed = wall.motion == "surface" and moves != (k in self.moving)
                if step == 0 or changed:
                    lines += [f"unfix mesh_{k}"] * (step > 0) + [wall.define(moving=moves)]
            if moves and k not in self.moving:
                lines += wall.move()
            (self.moving.add if moves else self.moving.discard)(k)
        if renewed and (meshes := self._meshes()):
            names = " ".join(f"mesh_{k}" for k in meshes)
            lines.append(
                f"fix walls all wall/gran {models.model(self.law)} mesh n_meshes {len(meshes)} "
                f"meshes {names} {models.settings(self.law)}".rstrip()
            )
        self.lines += lines
        self._insert(step)
        self._thermo()

    def _meshes(self) -> list[int]:
        return [w.number for w in self.walls if not w.primitive and w.number not in self.gone]

    def _insert(self, step: int) -> None:
        for number, time in self._sources().items():
            if self._look_at(time) == step:
                table = self.case.particles[number]
                assert not isinstance(table, FileTable)
                kind = self.names.index(table.material)
                mass = 0.0
                if isinstance(table, StreamTable):
                    mass = table.mass - self.run.tally.streamed[number]
                self.lines += insertion(
                    number, table, kind + 1, self.sim.materials[kind].density,
                    table.distribution, mass, self.run.look, self.case.seed,
                )  # fmt: skip

    def _thermo(self) -> None:
        words = ["step atoms"]
        for wall in self.walls:
            k = wall.number
            if k in self.gone:
                words.append("v_nothing v_nothing v_nothing")
            elif wall.primitive:
                words.append(f"c_push_{k}_1 c_push_{k}_2 c_push_{k}_3")
            else:
                words.append(f"f_mesh_{k}[1] f_mesh_{k}[2] f_mesh_{k}[3]")
        words += [f"v_mass_in_{k} v_count_in_{k}" for k in range(len(self.case.sink))]
        self.lines += [
            f"thermo_style custom {' '.join(words)}",
            "thermo_modify norm no flush yes format float %.15g",
            f"thermo {self.run._sample}",
        ]

    def _stretch(self, steps: int) -> None:
        looks = [f"delete_atoms region sink_{k} compress no" for k in range(len(self.case.sink))]
        for wall in self.walls:
            if wall.number in self.moving:
                looks += wall.look()
        every = "".join(f' "{line}"' for line in looks)
        self.lines.append(f"run {steps}" + (f" every {self.run.look}{every}" if looks else ""))

    def _mass(self, name: str) -> float:
        """Of a particle of a material: they are of one size, as linear laws need it [kg]."""
        sim = self.sim
        kind = self.names.index(name)
        radii = [float(sim.radii[sim.kinds == kind].max(initial=0.0))]
        for table in self.case.particles:
            if table.material == name and not isinstance(table, FileTable) and table.sizes:
                radii.append(float(table.distribution.radii(1)[0]))
        return 4.0 / 3.0 * math.pi * max(radii) ** 3 * sim.materials[kind].density

    def _data(self) -> str:
        sim = self.sim
        density = np.array([material.density for material in sim.materials])[sim.kinds]
        return data_text(
            sim.centres, sim.radii, sim.kinds + 1, density, sim.velocities, self.box,
            len(self.types.all),
        )  # fmt: skip
