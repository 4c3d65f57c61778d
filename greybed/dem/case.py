"""The case ``particles``: what its TOML file may say."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field, fields

import numpy as np

from greybed.core.config import choice, quantity, read_case, rows, tables, vector, whole
from greybed.core.errors import InputError
from greybed.dem.case_heat import check_heat
from greybed.dem.case_tables import (
    NOWHERE,
    SHAPES,
    WALLS,
    BoundsTable,
    ContactTable,
    EffectsTable,
    FileTable,
    HeatTable,
    LawTable,
    MaterialTable,
    OutputTable,
    PackTable,
    PeriodicTable,
    PlaneTable,
    ShapeTable,
    SinkTable,
    StreamTable,
    WallTable,
)
from greybed.dem.laws import ContactLaw
from greybed.dem.materials import Contact
from greybed.dem.measure_tables import (
    MEASURES,
    ConductionTable,
    MeasureTable,
    ShearTable,
    SlipTable,
)
from greybed.dem.walls import SolidWall


@dataclass(frozen=True, kw_only=True)
class ParticleCase:
    """A whole case file."""

    kind: str = choice(("particles",))
    duration: float = quantity("time", above=0.0)  # [s]
    time_step: float | None = quantity("time", None, above=0.0)  # [s]
    gravity: tuple[float, float, float] = vector("acceleration", (0.0, 0.0, -9.81))  # [m/s2]
    seed: int = whole(0, at_least=0)
    most_overlap: float = quantity("dimensionless", 0.3, above=0.0, at_most=1.0)  # [-]
    # Times between two looks at streams, sinks and servo walls [s].
    look: float | None = quantity("time", None, above=0.0)
    # Pairs nearer than it are listed [m]; a quarter of the mean radius by default.
    skin: float | None = quantity("length", None, above=0.0)
    law: LawTable = field(default_factory=LawTable)
    material: tuple[MaterialTable, ...] = rows(MaterialTable)
    contact: tuple[ContactTable, ...] = rows(ContactTable)
    shape: tuple[ShapeTable, ...] = tables("kind", SHAPES, ())
    wall: tuple[WallTable, ...] = tables("kind", WALLS, ())
    particles: tuple[PackTable | StreamTable | FileTable, ...] = tables(
        "kind", {"pack": PackTable, "stream": StreamTable, "file": FileTable}
    )
    periodic: PeriodicTable | None = None
    bounds: BoundsTable | None = None
    sink: tuple[SinkTable, ...] = rows(SinkTable, ())
    measure: tuple[MeasureTable, ...] = tables("kind", MEASURES, ())
    heat: HeatTable | None = None
    # Particles that stand for the cube of this number of real ones; see greybed.dem.coarse.
    coarse_graining: float = quantity("dimensionless", 1.0, at_least=1.0)
    effects: EffectsTable = field(default_factory=EffectsTable)
    output: OutputTable

    def __post_init__(self) -> None:
        for what in ("material", "shape", "wall", "sink", "measure"):
            names = [item.name for item in getattr(self, what)]
            twice = sorted({name for name in names if names.count(name) > 1})
            if twice:
                raise InputError(f"{what}: name {twice[0]!r} is used twice; give each its own.")
        shared = {sink.name for sink in self.sink} & {table.name for table in self.measure}
        if shared:
            raise InputError(
                f"a sink and a measure are both called {min(shared)!r}; give each its own name."
            )
        known = [m.name for m in self.material]
        for part in (*self.particles, *self.wall):
            if part.material is not None and part.material not in known:
                raise InputError(
                    f"no material is called {part.material!r}; there are {', '.join(known)}."
                )
        shapes = [shape.name for shape in self.shape]
        for table in self.particles:
            shape = getattr(table, "shape", None)
            if shape is not None and shape not in shapes:
                raise InputError(
                    f"no shape is called {shape!r}; there are {', '.join(shapes) or 'none'}."
                )
        first = [getattr(p, "at", getattr(p, "starts", 0.0)) for p in self.particles]
        if not first or min(first) > 0.0:
            raise InputError(
                "no particles are there at the start; let one [[particles]] begin at time 0."
            )
        for number, table in enumerate(self.particles):
            # Those that come later must not stop the run then.
            if isinstance(table, PackTable) and table.at > 0.0 and table.sizes is not None:
                _check_room(number, table)
        self._check_walls_of_measures()
        check_heat(self)

    def _check_walls_of_measures(self) -> None:
        planes = [wall.name for wall in self.wall if isinstance(wall, PlaneTable)]
        walls = [wall.name for wall in self.wall]
        for table in self.measure:
            wanted: tuple[tuple[str, list[str]], ...] = ()
            if isinstance(table, ConductionTable):
                wanted = tuple((name, walls) for name in table.walls)
            elif isinstance(table, ShearTable):
                wanted = tuple((name, walls) for name in (*table.walls, table.load))
            elif isinstance(table, SlipTable):
                wanted = ((table.wall, planes),)
            for name, known in wanted:
                if name not in known:
                    what = "plane" if known is planes else "wall"
                    raise InputError(
                        f"measure {table.name!r}: no {what} is called {name!r}; there are "
                        f"{', '.join(known) or 'none'}."
                    )

    @property
    def contact_law(self) -> ContactLaw:
        """The law, less the effects that are off."""
        law, on = self.law, self.effects
        return ContactLaw(
            law.normal if law.normal != "viscoelastic" or on.velocity_restitution else "hertz",
            law.rolling if on.rolling_resistance else "none",
            law.cohesion if on.cohesion else "none",
            law.limit_force,
            law.tangential_damping,
        )

    def contacts(self, particles: set[str]) -> dict[tuple[str, str], Contact]:
        """Contacts by pairs of names; ``particles`` are materials that particles have."""
        result: dict[tuple[str, str], Contact] = {}
        for table in self.contact:
            a, b = table.between
            contact = table.contact
            if not self.effects.wall_friction and not {a, b} <= particles:
                values = {f.name: getattr(contact, f.name) for f in fields(Contact)}
                contact = Contact(**{**values, "friction": 0.0, "sliding_friction": None})
            result[a, b] = contact
        return result

    @property
    def walls(self) -> list[SolidWall]:
        """The walls, those that start later at rest."""
        return [
            SolidWall(
                wall.wall(),
                wall.material,
                wall.velocity if wall.starts == 0.0 else NOWHERE,
                wall.spin if wall.starts == 0.0 else NOWHERE,
                wall.centre,
            )
            for wall in self.wall
        ]


def _check_room(number: int, table: PackTable) -> None:
    """Refuse a pack that cannot fit, whatever the places: random ones fill a third."""
    size = np.array(table.upper) - np.array(table.lower)
    region = float(size.prod()) * (0.25 * math.pi if table.round else 1.0)
    solid = 4.0 / 3.0 * math.pi * float((table.distribution.radii(table.count) ** 3).sum())
    if solid > 0.6 * region:
        raise InputError(
            f"particles[{number}]: {table.count} particles of {solid:.3g} [m3] find no room in a "
            f"region of {region:.3g} [m3]; make it larger, or insert fewer."
        )


def load_particle_case(path: str | os.PathLike[str]) -> ParticleCase:
    """Read and check a case file.

    Raises
    ------
    InputError
        In one sentence with file, key, value, unit, bound and remedy.
    """
    return read_case(path, ParticleCase)
