"""The deck: text of LAMMPS' input for a case, stretch by stretch of its time."""

from __future__ import annotations

import itertools
import math

import numpy as np

from greybed.core.errors import InputError
from greybed.core.walls import Cone, Cylinder, Disc, Plane
from greybed.dem.case_tables import WallTable
from greybed.dem.damping import damping
from greybed.dem.lammps.limits import NORMAL
from greybed.dem.lammps.warmth import conduction, temperatures
from greybed.dem.liggghts.deck import DATA, TOLD, Deck
from greybed.dem.liggghts.places import box_of, region_of
from greybed.dem.liggghts.sources import data_text
from greybed.dem.materials import Contact, Material
from greybed.dem.runner import ParticleRun

DECK, LOG = "in.lammps", "log.lammps"
FIELDS = "id type x y z vx vy vz omegax omegay omegaz radius mass c_touch"
WARM = " c_warm"  # one more where particles have temperatures
_SKIN = 0.25
# Half the height over the radius of what stands for a disc.
_THIN = 1e-8


def deck_of(run: ParticleRun, extra: tuple[str, ...] = ()) -> Deck:
    """The deck of a case that is ready to run.

    Parameters
    ----------
    run : ParticleRun
        The case with the spheres that it starts with.
    extra : tuple of str
        Lines after the contact law: a plugin and its fixes.

    Raises
    ------
    InputError
        For what LAMMPS cannot do.
    """
    case, sim = run.case, run.simulation
    periodic = case.periodic
    axes = "" if periodic is None else periodic.axes
    edges = " ".join("p" if axis in axes else "m" for axis in "xyz")
    region = region_of(case, sim.centres, sim.radii)
    box = box_of(case, region, [], sim.time_step, float(sim.radii.max()))
    down = int(np.abs(sim.gravity).argmax()) if sim.gravity.any() else -1
    cut = " ".join("1" if axis == down else "*" for axis in range(3))
    size = float(np.linalg.norm(sim.gravity))
    lines = [
        "# A case of particles, written by greybed simulate --engine lammps.",
        "units si", "atom_style sphere", "atom_modify map array", f"boundary {edges}",
        "newton off", "comm_modify vel yes", f"processors {cut}",
        *(["fix warm all property/atom temperature heatflow ghost yes"] if case.heat else []),
        f"read_data {DATA}",
        f"neighbor {_SKIN * float(sim.radii.mean())!r} bin",
        "neigh_modify delay 0 every 1 check yes",
        *_laws(run), f"timestep {sim.time_step!r}",
    ]  # fmt: skip
    if size > 0.0:
        way = " ".join(f"{g!r}" for g in (sim.gravity / size).tolist())
        lines.append(f"fix gravity all gravity {size!r} vector {way}")
    ends = [_look_at(run, wall.removed) for wall in case.wall]
    for k, wall in enumerate(case.wall):
        lines += _wall(run, k, wall, box)
    for k, sink in enumerate(case.sink):
        sides = " ".join(f"{a!r} {b!r}" for a, b in zip(sink.lower, sink.upper, strict=True))
        lines += [
            f"region sink_{k} block {sides} units box",
            f"variable mass_in_{k} equal mass(all,sink_{k})",
            f"variable count_in_{k} equal count(all,sink_{k})",
        ]
    every = 0
    if case.output.frames is not None:
        every = max(1, round(case.output.frames / sim.time_step))
    fields = FIELDS + (WARM if case.heat else "")
    lines += [
        *temperatures(run), *extra, "fix integrate all nve/sphere",
        "compute touch all contact/atom",
        "variable nothing equal 0", "variable now equal step",
        f'fix tell all print {run.look} "{TOLD} ${{now}}"',
        f"dump samples all custom {run._sample} sample.*.dump {fields}",
        "dump_modify samples format float %.17g",
    ]  # fmt: skip
    if every:
        lines += [
            f"dump frames all custom {every} frame.*.dump {fields}",
            "dump_modify frames format float %.17g",
        ]
    stops = sorted({0, run.steps} | {int(end) for end in ends if end < run.steps})
    gone: set[int] = set()
    for step, end in itertools.pairwise(stops):
        for k in [k for k, last in enumerate(ends) if last <= step and k not in gone]:
            gone.add(k)
            lines += [f"uncompute push_{k}", f"unfix wall_{k}"]
        lines += _thermo(run, gone)
        looks = [f"delete_atoms region sink_{k} compress no" for k in range(len(case.sink))]
        words = "".join(f' "{line}"' for line in looks)
        lines.append(f"run {end - step}" + (f" every {run.look}{words}" if looks else ""))
    lines += [
        "undump samples", f"dump last all custom 1 last.*.dump {fields}",
        "dump_modify last format float %.17g", "run 0",
    ]  # fmt: skip
    density = np.array([material.density for material in sim.materials])[sim.kinds]
    data = data_text(
        sim.centres, sim.radii, sim.kinds + 1, density, sim.velocities, box, len(sim.materials)
    )
    columns = 2 + 3 * len(case.wall) + 2 * len(case.sink)
    return Deck("\n".join(lines) + "\n", {DATA: data}, columns, every)


def _look_at(run: ParticleRun, time: float) -> float:
    """The first look at or after a time, as in our own engine; infinite after the end."""
    if not math.isfinite(time):
        return math.inf
    step = math.ceil(time / run.simulation.time_step - 1e-9)
    look = math.ceil(step / run.look) * run.look
    return look if look < run.steps else math.inf


def _laws(run: ParticleRun) -> list[str]:
    """Pairs of types of particles; pairs that never meet take the law of the first one."""
    sim, case = run.simulation, run.case
    contacts = case.contacts({table.material for table in case.particles})
    limit = " limit_damping" if case.contact_law.limit_force else ""
    lines = ["pair_style granular"]
    names = [material.name for material in sim.materials]
    for i, a in enumerate(names):
        for j, b in enumerate(names[i:], i):
            contact = contacts.get((a, b), contacts.get((b, a)))
            if contact is None:
                contact = next(iter(contacts.values()))
            words = _law(run, sim.materials[i], sim.materials[j], contact)
            words += conduction(run, i, j)
            lines.append(f"pair_coeff {i + 1} {j + 1} {words}{limit}")
    return lines


def _law(run: ParticleRun, first: Material, second: Material, contact: Contact) -> str:
    """Normal law, damping and tangential law of two materials in the words of LAMMPS."""
    law = run.case.contact_law
    assert law.normal in NORMAL
    told = _told(contact, law.normal, limit=law.limit_force)
    if law.normal == "linear":
        assert contact.stiffness is not None  # the case has been checked
        tangential = contact.stiffness * contact.tangential_ratio
        share = math.sqrt(contact.tangential_ratio)
        normal = f"hooke {contact.stiffness!r} {told!r}"
        sheared = f"linear_history {tangential!r}"
    else:
        pairs = ((m.youngs_modulus, m.poissons_ratio) for m in (first, second))
        soft = [((1.0 - nu**2) / e, 2.0 * (2.0 - nu) * (1.0 + nu) / e) for e, nu in pairs]
        modulus, shear = 1.0 / (soft[0][0] + soft[1][0]), 1.0 / (soft[0][1] + soft[1][1])
        # Stiffness 2 E* a along the normal and 8 G* a across it, a the radius of the contact.
        share = math.sqrt(4.0 * shear / modulus)
        normal = f"hertz {4.0 / 3.0 * modulus!r} {told!r}"
        sheared = f"mindlin {8.0 * shear!r}"
    damped = share if law.tangential_damping else 0.0
    return (
        f"{normal} damping coeff_restitution tangential {sheared} {damped!r} {contact.friction!r}"
    )


def _told(contact: Contact, normal: str, *, limit: bool) -> float:
    """The restitution that LAMMPS is told, for its formula knows no cut of the force."""
    if not limit or contact.restitution == 1.0:
        return contact.restitution
    zeta = damping(contact.restitution, normal, limit_force=True)
    free = zeta * (math.sqrt(6.0 / 5.0) if normal == "hertz" else 1.0)
    if free >= 1.0:
        raise InputError(
            f"LAMMPS cannot do restitution = {contact.restitution:g} [-] with limit_force: its "
            "damping ends before; take a larger one, limit_force = false, or --engine greybed."
        )
    return math.exp(-math.pi * free / math.sqrt(1.0 - free**2))


def _wall(run: ParticleRun, k: int, wall: WallTable, box: np.ndarray) -> list[str]:
    """A wall as a region that particles are inside of."""
    sim, case = run.simulation, run.case
    names = [material.name for material in sim.materials]
    used = {table.material for table in case.particles}
    of_wall = wall.material or names[0]
    contacts = case.contacts(used)
    kinds = sorted(names.index(name) for name in used)
    pairs = [(names[i], of_wall) for i in kinds]
    found = [contacts.get((a, b), contacts.get((b, a))) for a, b in pairs]
    if len({_law_words(run, i, of_wall, c) for i, c in zip(kinds, found, strict=True)}) > 1:
        raise InputError(
            f"LAMMPS cannot do wall {wall.name!r} with particles of several materials, which would "
            "need laws of their own; take --engine greybed or liggghts."
        )
    words = _law_words(run, kinds[0], of_wall, found[0])
    if wall.temperature is not None:
        words += conduction(run, kinds[0], kinds[0])
    if case.contact_law.limit_force:
        words += " limit_damping"
    warm = "" if wall.temperature is None else f" temperature {wall.temperature!r}"
    shape = wall.wall()
    region = f"region wall_{k} "
    if isinstance(shape, Plane):
        region += "plane " + " ".join(f"{c!r}" for c in (*shape.point, *shape.normal))
        region += " units box"
    elif isinstance(shape, Disc):
        region += _disc(shape)
    else:
        assert isinstance(shape, Cylinder | Cone)
        region += _round(shape, box)
    return [
        region,
        f"fix wall_{k} all wall/gran/region granular {words} region wall_{k}{warm} contacts",
        f"compute push_{k} all reduce sum f_wall_{k}[2] f_wall_{k}[3] f_wall_{k}[4]",
    ]


def _law_words(run: ParticleRun, kind: int, of_wall: str, contact: Contact | None) -> str:
    assert contact is not None  # the case has been checked
    materials = {material.name: material for material in run.simulation.materials}
    return _law(run, run.simulation.materials[kind], materials[of_wall], contact)


def _disc(shape: Disc) -> str:
    """A disc across an axis: a cylinder of almost no height, from without."""
    axis = int(np.abs(shape.normal).argmax())
    others = [float(shape.point[other]) for other in range(3) if other != axis]
    half, at = _THIN * shape.radius, float(shape.point[axis])
    return (
        f"cylinder {'xyz'[axis]} {others[0]!r} {others[1]!r} {shape.radius!r} {at - half!r} "
        f"{at + half!r} side out units box"
    )


def _round(shape: Cylinder | Cone, box: np.ndarray) -> str:
    """A cylinder or cone along an axis, open at its ends."""
    axis = int(np.abs(shape.axis).argmax())
    others = [float(shape.point[other]) for other in range(3) if other != axis]
    centre = f"{others[0]!r} {others[1]!r}"
    if shape.length is None:
        # As far as things go, and further: ends that nothing reaches.
        reach = float(box[1, axis] - box[0, axis])
        low, high = float(box[0, axis]) - reach, float(box[1, axis]) + reach
    else:
        ends = sorted((shape.point[axis], shape.point[axis] + shape.axis[axis] * shape.length))
        low, high = float(ends[0]), float(ends[1])
    tail = f"{low!r} {high!r} units box open 1 open 2"
    if isinstance(shape, Cone):
        radii = (shape.radius, shape.end_radius)
        first, last = radii if shape.axis[axis] > 0.0 else radii[::-1]
        return f"cone {'xyz'[axis]} {centre} {first!r} {last!r} {tail}"
    return f"cylinder {'xyz'[axis]} {centre} {shape.radius!r} {tail}"


def _thermo(run: ParticleRun, gone: set[int]) -> list[str]:
    words = ["step atoms"]
    for k in range(len(run.case.wall)):
        there = f"c_push_{k}[1] c_push_{k}[2] c_push_{k}[3]"
        words.append("v_nothing v_nothing v_nothing" if k in gone else there)
    words += [f"v_mass_in_{k} v_count_in_{k}" for k in range(len(run.case.sink))]
    return [
        f"thermo_style custom {' '.join(words)}",
        "thermo_modify norm no flush yes format float %.15g lost ignore",
        f"thermo {run._sample}",
    ]
