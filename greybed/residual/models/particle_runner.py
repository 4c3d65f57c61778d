"""Cases of particles as forward models: how they run, and which contact effects they switch."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from greybed.core.config import build
from greybed.core.readers import read_packing
from greybed.core.sizes import Mono, parse_sizes
from greybed.core.units import parse_quantity
from greybed.dem.case import ParticleCase
from greybed.dem.case_tables import FileTable
from greybed.dem.results import results_of
from greybed.dem.runner import ParticleRun
from greybed.residual.effect import Array, Columns, Effect
from greybed.residual.models.runner import Runner, Switch


class ParticleRunner(Runner):
    """``kind = "particles"``: results as ``greybed simulate`` writes them."""

    kind = "particles"
    paths = ()
    lacks = "no case of particles can have it"

    def simulate(self, content: dict[str, Any]) -> dict[str, Any]:
        """Run the particles from the start to the end."""
        case = build(ParticleCase, content, self.path)
        files = {k: t.file for k, t in enumerate(case.particles) if isinstance(t, FileTable)}
        run = ParticleRun(case, {k: read_packing(path) for k, path in files.items()})
        for _ in run.go_on():
            pass
        plain: dict[str, Any] = json.loads(json.dumps(results_of(run), default=float))
        return plain

    def reseed(self, content: dict[str, Any], seed: int) -> dict[str, Any]:
        """Other places at the start."""
        return {**content, "seed": seed}

    def switches(self) -> dict[str, Switch]:
        """Rolling, cohesion, friction of the walls, losses that grow with the speed, shape."""
        return {
            "rolling-resistance": Switch(ROLLING, _roll, _rolls),
            "cohesion": Switch(COHESION, _stick, _sticks),
            "wall-friction": Switch(WALLS, _rub, _rubs),
            "velocity-dependent-restitution": Switch(IMPACTS, _lose, _loses),
            "particle-shape": Switch(SHAPE, _stretch, _stretches),
        }


def _inside(columns: Columns, amplitude: float) -> Array:
    """The solver has these effects itself."""
    raise AssertionError("effects of a case are switched in the case")


ROLLING = Effect(
    name="rolling-resistance",
    law="elastic-plastic rolling spring that yields at A times normal force times radius",
    source="Ai, Chen, Rotter & Ooi, Powder Technol. 206 (2011) 269",
    group="rolling friction",
    theory=None,
    low=0.05,
    high=0.8,
    stage="outcome",
    change=_inside,
    switch='law.rolling = "epsd-modified", contact.rolling_friction = A',
)
COHESION = Effect(
    name="cohesion",
    law="attraction of A times the disc of a contact between particles",
    source="energy density of contact area (SJKR)",
    group="cohesion energy density over rho g d",
    theory=None,
    low=1.0,
    high=1e6,
    stage="outcome",
    change=_inside,
    switch='law.cohesion = "sjkr", contact.cohesion = A',
)
WALLS = Effect(
    name="wall-friction",
    law="friction A between particles and walls, where the base has none",
    source="Coulomb",
    group="wall friction",
    theory=None,
    low=0.02,
    high=1.0,
    stage="outcome",
    change=_inside,
    switch="contact.friction = A for contacts with walls",
)
IMPACTS = Effect(
    name="velocity-dependent-restitution",
    law="viscous losses beside those of the base, so that spheres of the mean radius return "
    "restitution / (1 + A v^(1/5)) at v = 1 m/s, A in (s/m)^(1/5)",
    source="viscoelastic spheres (Brilliantov et al., Phys. Rev. E 53 (1996) 5382) lose C v^(1/5) "
    "at first order (Ramirez et al., Phys. Rev. E 60 (1999) 4465)",
    group="impact velocity over that of dissipation",
    theory=None,
    low=0.005,
    high=5.0,
    stage="outcome",
    change=_inside,
    switch='law.normal = "viscoelastic", contact.slow_restitution = that of the case, '
    "contact.restitution = it / (1 + A), contact.reference_speed = 1",
)

SHAPE = Effect(
    name="particle-shape",
    law="spherocylinders of the spheres' volume, 1 + A times as long as thick",
    source="rigid bodies of five spheres with the inertia of the smooth shape",
    group="length over diameter",
    theory=None,
    low=0.05,
    high=3.0,
    stage="outcome",
    change=_inside,
    switch='shape.kind = "spherocylinder", shape.length = (1 + A) shape.diameter',
)


def _own(content: Mapping[str, Any]) -> set[str]:
    """Materials of the particles."""
    return {str(table.get("material")) for table in content.get("particles", ())}


def _contacts(content: Mapping[str, Any], walls: bool) -> list[dict[str, Any]]:
    own = _own(content)
    return [
        table
        for table in content.get("contact", ())
        if (set(table.get("between", ())) <= own) != walls
    ]


def _roll(content: dict[str, Any], amplitude: float) -> None:
    content.setdefault("law", {})["rolling"] = "epsd-modified"
    for table in content.get("contact", ()):
        table["rolling_friction"] = amplitude


def _rolls(content: Mapping[str, Any]) -> str | None:
    rolling = content.get("law", {}).get("rolling", "none")
    return None if rolling == "none" else f"the case has it (law.rolling = {rolling!r})"


def _stick(content: dict[str, Any], amplitude: float) -> None:
    content.setdefault("law", {})["cohesion"] = "sjkr"
    for table in _contacts(content, walls=False):
        table["cohesion"] = amplitude


def _sticks(content: Mapping[str, Any]) -> str | None:
    cohesion = content.get("law", {}).get("cohesion", "none")
    return None if cohesion == "none" else f"the case has it (law.cohesion = {cohesion!r})"


def _rub(content: dict[str, Any], amplitude: float) -> None:
    for table in _contacts(content, walls=True):
        table["friction"] = amplitude


def _rubs(content: Mapping[str, Any]) -> str | None:
    walls = _contacts(content, walls=True)
    if not walls:
        return "walls have no material of their own, so no contact of theirs can change"
    if any(table.get("friction", 0.0) != 0.0 for table in walls):
        return "the case has it (contact.friction of the walls)"
    return None


def _mean_radius(content: Mapping[str, Any]) -> float | None:
    """Of the first particles that have sizes [m]."""
    for table in content.get("particles", ()):
        if "sizes" in table:
            return float(parse_sizes(table["sizes"]).radii(1000).mean())
    return None


def _lose(content: dict[str, Any], amplitude: float) -> None:
    content.setdefault("law", {})["normal"] = "viscoelastic"
    for table in content.get("contact", ()):
        stated = table["restitution"]
        slow = parse_quantity(stated, "dimensionless") if isinstance(stated, str) else stated
        table["slow_restitution"] = slow
        table["restitution"] = slow / (1.0 + amplitude)
        table["reference_speed"] = 1.0
        table["reference_radius"] = _mean_radius(content)


def _loses(content: Mapping[str, Any]) -> str | None:
    law = content.get("law", {})
    normal = law.get("normal", "hertz")
    if normal == "viscoelastic":
        return "the case has it (law.normal = 'viscoelastic')"
    if normal != "hertz" or law.get("cohesion") == "jkr":
        return "it goes with law.normal = 'hertz', without 'jkr'"
    if _mean_radius(content) is None:
        return "no particles have sizes, whose mean the impacts at 1 m/s need"
    return None


def _drawn(content: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Tables whose particles are drawn, not read."""
    return [table for table in content.get("particles", ()) if table.get("kind") != "file"]


def _stretch(content: dict[str, Any], amplitude: float) -> None:
    for number, table in enumerate(_drawn(content)):
        sizes = parse_sizes(table.pop("sizes"))
        assert isinstance(sizes, Mono)
        # Of a ball and of a tube A diameters long with half balls on its ends, the same volume.
        diameter = 2.0 * sizes.radius * (1.0 + 1.5 * amplitude) ** (-1.0 / 3.0)
        name = f"stretched-{number}"
        table["shape"] = name
        shape = {"kind": "spherocylinder", "name": name, "diameter": diameter}
        shape["length"] = (1.0 + amplitude) * diameter
        content.setdefault("shape", []).append(shape)


def _stretches(content: Mapping[str, Any]) -> str | None:
    drawn = _drawn(content)
    if not drawn or len(drawn) < len(content.get("particles", ())):
        return "its particles come from a file, as spheres"
    if any("shape" in table for table in drawn):
        return "the case has it (particles.shape)"
    if not all(isinstance(parse_sizes(table["sizes"]), Mono) for table in drawn):
        return "it goes with spheres of one size in each table (sizes = 'mono:...')"
    return None
