"""Tables of the case ``particles``: laws, materials, walls, particles, measures, output."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

from greybed.core.config import choice, quantity, vector, whole, words
from greybed.core.errors import InputError
from greybed.core.sizes import Sizes, parse_sizes
from greybed.core.wall_tables import (
    ConeShape,
    CylinderShape,
    DiscShape,
    MeshShape,
    PlaneShape,
    RectangleShape,
)
from greybed.core.walls import Mesh, Wall
from greybed.dem.clump import Clump, sphere_union
from greybed.dem.clump_shapes import fitted_clump, spherocylinder, tetrapod
from greybed.dem.insertion import Region
from greybed.dem.laws import COHESION, NORMAL, ROLLING
from greybed.dem.materials import Contact, Material

NOWHERE = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class LawTable:
    """``[law]``."""

    normal: str = choice(tuple(NORMAL), "hertz")
    rolling: str = choice(tuple(ROLLING), "none")
    cohesion: str = choice(tuple(COHESION), "none")
    limit_force: bool = False
    tangential_damping: bool = True


@dataclass(frozen=True, kw_only=True)
class MaterialTable:
    """``[[material]]``."""

    name: str
    density: float = quantity("density", above=0.0)  # [kg/m3]
    youngs_modulus: float = quantity("pressure", above=0.0)  # [Pa]
    poissons_ratio: float = quantity("dimensionless", above=-1.0, at_most=0.5)  # [-]
    conductivity: float | None = quantity("conductivity", None, above=0.0)  # [W/m/K]
    heat_capacity: float | None = quantity("heat capacity", None, above=0.0)  # [J/kg/K]

    @property
    def material(self) -> Material:
        """The material itself."""
        return Material(self.density, self.youngs_modulus, self.poissons_ratio, self.name)


@dataclass(frozen=True, kw_only=True)
class ContactTable:
    """``[[contact]]`` of two materials; see :class:`greybed.dem.Contact`."""

    between: tuple[str, ...] = words()
    name: str | None = None  # for the studies that vary it
    restitution: float = quantity("dimensionless", above=0.0, at_most=1.0)  # [-]
    friction: float = quantity("dimensionless", at_least=0.0)  # [-]
    sliding_friction: float | None = quantity("dimensionless", None, at_least=0.0)  # [-]
    rolling_friction: float = quantity("dimensionless", 0.0, at_least=0.0)  # [-]
    rolling_damping: float = quantity("dimensionless", 0.0, at_least=0.0, at_most=1.0)  # [-]
    # In the SI unit of the law: J/m3 (sjkr), J/m2 (dmt, jkr), J (van-der-waals), N/m (bridges).
    cohesion: float = quantity("dimensionless", 0.0, at_least=0.0)
    nearest: float = quantity("length", 0.0, at_least=0.0)  # [m]
    reach: float = quantity("length", 0.0, at_least=0.0)  # [m]
    bridge_volume: float = quantity("volume", 0.0, at_least=0.0)  # [m3]
    contact_angle: float = quantity("angle", 0.0, at_least=0.0)  # [rad]
    stiffness: float | None = quantity("stiffness", None, above=0.0)  # [N/m]
    tangential_ratio: float = quantity("dimensionless", 2.0 / 7.0, above=0.0)  # [-]
    rolling_time: float = quantity("time", 0.0, at_least=0.0)  # of viscous rolling [s]
    # The impact that restitution is of, and what the slowest ones return (viscoelastic).
    reference_speed: float | None = quantity("velocity", None, above=0.0)  # [m/s]
    reference_radius: float | None = quantity("length", None, above=0.0)  # [m]
    slow_restitution: float = quantity("dimensionless", 1.0, above=0.0, at_most=1.0)  # [-]

    def __post_init__(self) -> None:
        if len(self.between) != 2:
            raise InputError(f'between = {list(self.between)} must be two names, ["a", "b"].')

    @property
    def contact(self) -> Contact:
        """The contact itself."""
        names = [field.name for field in fields(Contact)]
        return Contact(**{name: getattr(self, name) for name in names})


@dataclass(frozen=True, kw_only=True)
class _Solid:
    """What every wall of particles has."""

    name: str
    material: str | None = None
    velocity: tuple[float, float, float] = vector("velocity", NOWHERE)  # [m/s]
    spin: tuple[float, float, float] = vector("angular velocity", NOWHERE)  # [rad/s]
    centre: tuple[float, float, float] | None = vector("length", None)  # of the spin [m]
    starts: float = quantity("time", 0.0, at_least=0.0)  # of the motion [s]
    stops: float = quantity("time", 1e30, above=0.0)  # [s]
    removed: float = quantity("time", 1e30, above=0.0)  # [s]
    # Force of the particles on the wall along its velocity that moves it no further [N]: the
    # wall goes at its velocity where nothing holds it, and back where more than that pushes.
    servo: float | None = quantity("force", None, above=0.0)
    temperature: float | None = quantity("temperature", None, above=0.0)  # [K]


@dataclass(frozen=True, kw_only=True)
class PlaneTable(PlaneShape, _Solid):
    """``[[wall]]`` with ``kind = "plane"``."""


@dataclass(frozen=True, kw_only=True)
class CylinderTable(CylinderShape, _Solid):
    """``[[wall]]`` with ``kind = "cylinder"``."""


@dataclass(frozen=True, kw_only=True)
class ConeTable(ConeShape, _Solid):
    """``[[wall]]`` with ``kind = "cone"``."""


@dataclass(frozen=True, kw_only=True)
class DiscTable(DiscShape, _Solid):
    """``[[wall]]`` with ``kind = "disc"``."""


@dataclass(frozen=True, kw_only=True)
class RectangleTable(RectangleShape, _Solid):
    """``[[wall]]`` with ``kind = "rectangle"``."""


@dataclass(frozen=True, kw_only=True)
class MeshTable(MeshShape, _Solid):
    """``[[wall]]`` with ``kind = "mesh"``: closed, or said to be open."""

    open: bool = False

    def wall(self) -> Wall:
        """The wall itself.

        Raises
        ------
        InputError
            If the file has holes and nobody said so: particles would fall through.
        """
        mesh = super().wall()
        if isinstance(mesh, Mesh) and not (self.open or mesh.watertight):
            raise InputError(
                f"wall {self.name!r}: the mesh {self.file} has holes or open rims, where particles "
                "fall through; mend it, or say open = true if that is its shape."
            )
        return mesh


WallTable = PlaneTable | CylinderTable | ConeTable | DiscTable | RectangleTable | MeshTable
WALLS = {
    "plane": PlaneTable,
    "cylinder": CylinderTable,
    "cone": ConeTable,
    "disc": DiscTable,
    "rectangle": RectangleTable,
    "mesh": MeshTable,
}


@dataclass(frozen=True, kw_only=True)
class _Shape:
    """What every shape of particles has."""

    name: str


@dataclass(frozen=True, kw_only=True)
class TetrapodTable(_Shape):
    """``[[shape]]`` with ``kind = "tetrapod"``."""

    diameter: float = quantity("length", above=0.0)  # of each of the four spheres [m]
    spacing: float = quantity("length", above=0.0)  # between their centres [m]

    def clump(self) -> Clump:
        """The shape itself."""
        return tetrapod(self.diameter, self.spacing, name=self.name)


@dataclass(frozen=True, kw_only=True)
class SpherocylinderTable(_Shape):
    """``[[shape]]`` with ``kind = "spherocylinder"``."""

    diameter: float = quantity("length", above=0.0)  # [m]
    length: float = quantity("length", above=0.0)  # overall [m]
    spheres: int = whole(5, at_least=2)

    def clump(self) -> Clump:
        """The shape itself."""
        return spherocylinder(self.diameter, self.length, spheres=self.spheres, name=self.name)


@dataclass(frozen=True, kw_only=True)
class UnionTable(_Shape):
    """``[[shape]]`` with ``kind = "union"``: the spheres of a CSV table with units."""

    file: Path  # relative to the case

    def clump(self) -> Clump:
        """The shape itself."""
        from greybed.core.readers.assembling import Options
        from greybed.core.readers.table import read

        try:
            data = self.file.read_bytes()
        except OSError as error:
            raise InputError(f"{self.file}: cannot read this table ({error.strerror}).") from None
        spheres = read(self.file, data, Options())
        return sphere_union(spheres.centres, spheres.radii, name=self.name)


@dataclass(frozen=True, kw_only=True)
class ScanTable(_Shape):
    """``[[shape]]`` with ``kind = "scan"``: spheres fitted into a closed surface."""

    file: Path  # STL, OBJ or PLY, relative to the case
    unit: str = "m"  # of the file
    spheres: int = whole(20, at_least=1)
    bulge: float = quantity("dimensionless", 0.02, at_least=0.0, at_most=0.5)  # [-]

    def clump(self) -> Clump:
        """The shape itself."""
        from greybed.core.readers.mesh import joined, read_mesh

        mesh = joined(read_mesh(self.file, self.unit), self.name)
        return fitted_clump(mesh, spheres=self.spheres, bulge=self.bulge, name=self.name)


ShapeTable = TetrapodTable | SpherocylinderTable | UnionTable | ScanTable
SHAPES = {
    "tetrapod": TetrapodTable,
    "spherocylinder": SpherocylinderTable,
    "union": UnionTable,
    "scan": ScanTable,
}


@dataclass(frozen=True, kw_only=True)
class _Sourced:
    """What every table of particles has."""

    material: str
    velocity: tuple[float, float, float] = vector("velocity", NOWHERE)  # [m/s]
    temperature: float | None = quantity("temperature", None, above=0.0)  # [K]


@dataclass(frozen=True, kw_only=True)
class _Drawn(_Sourced):
    """Particles in a region, spheres of drawn sizes or clumps of one shape."""

    sizes: str | None = None  # as of ``greybed pack --sizes``
    shape: str | None = None  # name of a ``[[shape]]``
    lower: tuple[float, float, float] = vector("length")  # [m]
    upper: tuple[float, float, float] = vector("length")  # [m]
    round: bool = False

    def __post_init__(self) -> None:
        if (self.sizes is None) == (self.shape is None):
            raise InputError("give sizes of spheres or the name of a shape, one of the two.")
        if self.sizes is not None:
            parse_sizes(self.sizes)
        Region(self.lower, self.upper, self.round)

    @property
    def distribution(self) -> Sizes:
        """Of the radii of spheres."""
        assert self.sizes is not None
        return parse_sizes(self.sizes)

    @property
    def region(self) -> Region:
        """Where they go."""
        return Region(self.lower, self.upper, self.round)


@dataclass(frozen=True, kw_only=True)
class PackTable(_Drawn):
    """``[[particles]]`` with ``kind = "pack"``: all at once, at random places that are free."""

    count: int = whole(at_least=1, at_most=10**8)
    at: float = quantity("time", 0.0, at_least=0.0)  # [s]


@dataclass(frozen=True, kw_only=True)
class StreamTable(_Drawn):
    """``[[particles]]`` with ``kind = "stream"``: at a rate, as there is room in the region."""

    rate: float = quantity("mass flow", above=0.0)  # [kg/s]
    mass: float = quantity("mass", above=0.0)  # in all [kg]
    starts: float = quantity("time", 0.0, at_least=0.0)  # [s]


@dataclass(frozen=True, kw_only=True)
class FileTable(_Sourced):
    """``[[particles]]`` with ``kind = "file"``: any file that ``greybed info`` reads, at time 0."""

    file: Path  # relative to the case


@dataclass(frozen=True, kw_only=True)
class SinkTable:
    """``[[sink]]``: what comes into this box is counted and taken away."""

    name: str
    lower: tuple[float, float, float] = vector("length")  # [m]
    upper: tuple[float, float, float] = vector("length")  # [m]

    def __post_init__(self) -> None:
        Region(self.lower, self.upper)


@dataclass(frozen=True, kw_only=True)
class HeatTable:
    """``[heat]``: particles have temperatures, and heat flows through contacts."""

    temperature: float = quantity("temperature", above=0.0)  # where a table says no other [K]
    stiffness_ratio: float = quantity("dimensionless", 1.0, above=0.0)  # real over simulated [-]


@dataclass(frozen=True, kw_only=True)
class BoundsTable:
    """``[bounds]``: the box that no particle may leave, looked after at each look."""

    lower: tuple[float, float, float] = vector("length")  # [m]
    upper: tuple[float, float, float] = vector("length")  # [m]

    def __post_init__(self) -> None:
        Region(self.lower, self.upper)


@dataclass(frozen=True, kw_only=True)
class PeriodicTable:
    """``[periodic]``: the box that repeats along the axes that are named."""

    lower: tuple[float, float, float] = vector("length")  # [m]
    upper: tuple[float, float, float] = vector("length")  # [m]
    axes: str = choice(("x", "y", "z", "xy", "xz", "yz", "xyz"))


@dataclass(frozen=True, kw_only=True)
class OutputTable:
    """``[output]``: times between two of them."""

    samples: float = quantity("time", above=0.0)  # rows of history.csv [s]
    frames: float | None = quantity("time", None, above=0.0)  # VTU files; none by default [s]
    checkpoints: float | None = quantity("time", None, above=0.0)  # a tenth of the run [s]
    format: str = choice(("vtu", "vtkhdf"), "vtu")  # of the frames


@dataclass(frozen=True, kw_only=True)
class EffectsTable:
    """``[effects]``: switches; an effect that is off is as if its numbers were not there."""

    rolling_resistance: bool = True
    cohesion: bool = True
    wall_friction: bool = True
    particle_shape: bool = True  # off: spheres of the same volume
    velocity_restitution: bool = True  # off: restitution is that of the reference impact
