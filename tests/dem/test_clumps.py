"""Rigid bodies of spheres: mass and inertia, free motion, contacts, walls, bits."""

import math

import numpy as np
import pytest
from scipy.integrate import trapezoid

from greybed.core.errors import InputError
from greybed.core.walls import Mesh, Plane
from greybed.dem import (
    Clumps,
    Contact,
    ContactLaw,
    Material,
    Simulation,
    SolidWall,
    fitted_clump,
    restore,
    save,
    sphere_union,
    spherocylinder,
    tetrapod,
)
from greybed.dem.bodies import random_orientations

STONE = Material(2500.0, 5e6, 0.3, "stone")
ELASTIC = Contact(1.0, 0.0)
ROUGH = Contact(0.5, 0.4)


def one(shape, **more):
    options = {"gravity": (0, 0, 0), **more}
    motion = {k: options.pop(k) for k in ("velocities", "spins") if k in options}
    place = options.pop("centres", [[0, 0, 0]])
    q = options.pop("orientations", None)
    contact = options.pop("contact", ELASTIC)
    return Simulation((), (), STONE, contact, clumps=[Clumps(shape, place, q, **motion)], **options)


def test_union_of_two_overlapping_spheres_has_the_volume_and_inertia_of_the_lens_counted_once():
    r, d = 1e-3, 1.2e-3
    clump = sphere_union([[0, 0, 0], [d, 0, 0]], [r, r])
    height = r - 0.5 * d
    cap = math.pi * height**2 * (3 * r - height) / 3
    assert clump.volume == pytest.approx(2 * (4 / 3 * math.pi * r**3 - cap), rel=2e-5)
    # About the axis: balls less twice the cap's own moment, by quadrature of its discs.
    x = np.linspace(r - height, r, 20001)
    disc = math.pi / 2 * (r**2 - x**2) ** 2
    twice = 2 * trapezoid(disc, x)
    along = 2 * (8 / 15 * math.pi * r**5) - twice
    assert np.sort(clump.moments)[0] == pytest.approx(along, rel=1e-4)
    assert clump.centres.mean(axis=0) == pytest.approx([0, 0, 0], abs=1e-9)


def test_tetrapod_has_the_inertia_of_four_points_with_their_own():
    d, a = 8e-3, 20e-3
    clump = tetrapod(d, a)
    mass = math.pi / 6 * d**3
    # Corners are sqrt(3/8) a from the centre; two thirds of their square each about any axis.
    expected = 4 * (0.1 * mass * d**2 + mass * (3 / 8 * a**2) * 2 / 3)
    assert clump.moments == pytest.approx([expected] * 3, rel=1e-12)
    apart = np.linalg.norm(clump.centres[:, None] - clump.centres[None], axis=2)
    assert apart[np.triu_indices(4, 1)] == pytest.approx([a] * 6)


def test_spherocylinder_is_the_smooth_shape_whatever_spheres_stand_for_it():
    coarse, fine = (spherocylinder(8.5e-3, 16.1e-3, spheres=n) for n in (3, 40))
    assert coarse.volume == fine.volume
    # What a union of many spheres weighs comes to the same.
    union = sphere_union(fine.centres, fine.radii)
    assert union.volume == pytest.approx(fine.volume, rel=2e-3)
    assert union.inertia == pytest.approx(fine.inertia, rel=5e-3, abs=1e-3 * fine.inertia.max())
    assert (
        coarse.shape_error["deepest_groove_over_radius"]
        > 10 * fine.shape_error["deepest_groove_over_radius"]
    )


def ellipsoid(a=3e-3, b=2e-3, c=1.5e-3):
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=3)
    return Mesh(ball.vertices * [a, b, c], ball.faces), (a, b, c)


def test_clump_fitted_to_an_ellipsoid_has_its_mass_and_reports_its_error():
    mesh, (a, b, c) = ellipsoid()
    clump = fitted_clump(mesh, spheres=25)
    volume = 4 / 3 * math.pi * a * b * c
    assert clump.volume == pytest.approx(volume, rel=0.02)  # of the facets
    exact = volume / 5 * np.array([b**2 + c**2, a**2 + c**2, a**2 + b**2])
    assert np.sort(clump.moments) == pytest.approx(np.sort(exact), rel=0.03)
    error = clump.shape_error
    assert 0.0 < error["rms_over_radius"] < 0.03
    assert error["rms_over_radius"] < error["largest_over_radius"] < 0.15
    assert 0.93 < error["volume_ratio"] < 1.03
    few = fitted_clump(mesh, spheres=3).shape_error
    assert few["rms_over_radius"] > 2 * error["rms_over_radius"]


def test_surface_with_a_hole_is_refused():
    mesh, _ = ellipsoid()
    with pytest.raises(InputError, match="has holes"):
        fitted_clump(Mesh(mesh.vertices, mesh.faces[:-1]))


def test_free_body_keeps_momentum_to_round_off_and_energy_without_drift():
    clump = sphere_union([[0, 0, 0], [2e-3, 0, 0], [0, 3.5e-3, 0]], [1e-3, 1.2e-3, 0.8e-3])
    spin = np.array([90.0, 25.0, -60.0])
    sim = one(clump, spins=spin, time_step=2e-5, orientations=[[0.3, 0.5, -0.2, 0.7]])
    momentum = sim.bodies.momenta[0]
    energies = []
    for _ in range(40):
        sim.run(2500)
        energies.append(sim.energies.rotational)
        assert sim.bodies.momenta[0] == pytest.approx(momentum, rel=1e-10)
    energies = np.array(energies)
    # It tumbles: the spin is not what it was.
    assert np.linalg.norm(sim.bodies.spins[0] - spin) > 10.0
    # 100,000 steps: the error stays what a step makes; a line through it has no slope.
    assert abs(energies / energies.mean() - 1).max() < 1e-6
    slope = np.polyfit(np.arange(40), energies / energies.mean(), 1)[0] * 40
    assert abs(slope) < 3e-7
    away = sim.centres - sim.anchors
    assert np.linalg.norm(away, axis=1) == pytest.approx(
        np.linalg.norm(clump.centres, axis=1), rel=1e-12
    )


def test_symmetric_top_precesses_at_its_own_rate():
    clump = spherocylinder(4e-3, 12e-3)
    spin = np.array([30.0, 0.0, 80.0])  # in the shape's frame, z along the axis
    sim = one(clump, spins=spin, time_step=1e-5)
    i1, _, i3 = clump.moments * STONE.density
    total = np.linalg.norm([i1 * spin[0], i3 * spin[2]])
    axis = np.array([i1 * spin[0], 0.0, i3 * spin[2]]) / total
    period = 2 * math.pi * i1 / total
    steps = round(0.37 * period / sim.time_step)
    angle = 2 * math.pi * steps * sim.time_step / period
    sim.run(steps)
    pointing = sim.centres[-1] - sim.centres[0]
    pointing /= np.linalg.norm(pointing)
    start = np.array([0.0, 0.0, 1.0])
    # Rodrigues' turn of the axis about the angular momentum.
    expected = (
        start * math.cos(angle)
        + np.cross(axis, start) * math.sin(angle)
        + axis * (axis @ start) * (1 - math.cos(angle))
    )
    assert pointing == pytest.approx(expected, abs=1e-5)


def test_collision_of_two_bodies_keeps_momenta_and_energy():
    clump = tetrapod(2e-3, 3e-3)
    sim = one(
        clump,
        centres=[[0, 0, 0], [7.5e-3, 0.8e-3, 0.4e-3]],
        orientations=random_orientations(2, 3),
        velocities=[[0.3, 0, 0], [-0.3, 0, 0]],
        time_step=4e-6,
    )

    def momenta():
        b = sim.bodies
        p = (b.masses[:, None] * b.velocities).sum(axis=0)
        spin = b.momenta.sum(axis=0)
        return p, spin + np.cross(b.centres, b.masses[:, None] * b.velocities).sum(axis=0)

    energy, (p, spin) = sim.energies.total, momenta()
    touched = 0
    for _ in range(60):
        sim.run(100)
        touched += len(sim.contacts) > 0
    after, turned = momenta()
    scale = 0.6 * sim.bodies.masses[0]
    assert touched
    assert len(sim.contacts) == 0
    assert after == pytest.approx(p, abs=1e-13 * scale)
    assert turned == pytest.approx(spin, abs=1e-12 * scale * 5e-3)
    assert sim.energies.total == pytest.approx(energy, rel=2e-4)
    assert sim.energies.rotational > 0.01 * energy


def test_rod_that_lands_on_one_end_starts_to_turn_as_impulse_theory_says():
    # Frictionless elastic end: v' = v + J/m, w = J x / I, and the end's speed turns round.
    clump = spherocylinder(2e-3, 10e-3, spheres=2)
    tilt = math.radians(35.0)
    q = [math.cos(tilt / 2), 0, math.sin(tilt / 2), 0]
    lever = 4e-3 * math.sin(tilt)
    sim = one(
        clump, centres=[[0, 0, 1.05e-3 + 4e-3 * math.cos(tilt)]], orientations=[q],
        velocities=[0, 0, -0.05], time_step=2e-6,
        walls=[SolidWall(Plane((0, 0, 0), (0, 0, 1), "floor"))],
    )  # fmt: skip
    mass, moment = sim.bodies.masses[0], sim.bodies.moments[0, 0]
    push = 2 * 0.05 / (1 / mass + lever**2 / moment)
    while not sim.wall_forces[0, 2]:
        sim.run(50)
    while sim.wall_forces[0, 2]:
        sim.run(50)
    assert sim.bodies.velocities[0, 2] == pytest.approx(-0.05 + push / mass, rel=0.02)
    assert abs(sim.bodies.spins[0, 1]) == pytest.approx(push * lever / moment, rel=0.02)
    assert abs(sim.bodies.spins[0, [0, 2]]).max() < 1e-9


def bed(threads=1, n=60):
    rng = np.random.default_rng(2)
    lattice = np.stack(np.meshgrid(np.arange(4), np.arange(4), np.arange(4), indexing="ij"), -1)
    at = 5.2e-3 * lattice.reshape(-1, 3)[:n] + 3e-3 + rng.uniform(-1e-4, 1e-4, (n, 3))
    half = n // 2
    rod, pod = spherocylinder(1.6e-3, 4e-3, spheres=4), tetrapod(1.6e-3, 1.8e-3)
    groups = [
        Clumps(rod, at[:half], random_orientations(half, 1)),
        Clumps(pod, at[half:], random_orientations(n - half, 2)),
    ]
    extra = np.array([[1.0e-3, 1.0e-3, 1.0e-3], [19e-3, 19e-3, 23e-3]])
    return Simulation(
        extra, 0.7e-3, STONE, Contact(0.4, 0.5, rolling_friction=0.05), clumps=groups,
        law=ContactLaw(rolling="epsd-modified"), box=[[0, 0, 0], [21e-3, 21e-3, 1]],
        periodic=(True, True, False), threads=threads,
        walls=[SolidWall(Plane((0, 0, 0), (0, 0, 1), "floor"))],
    )  # fmt: skip


def test_bed_of_bodies_settles_in_a_periodic_box_and_stays_rigid():
    sim = bed()
    weight = 9.81 * (sim.bodies.masses.sum() + sim.masses[sim.body_of < 0].sum())
    assert sim.masses.sum() == pytest.approx(weight / 9.81, rel=1e-12)
    sim.run(25000)
    assert sim.energies.kinetic < 1e-3 * weight * 1e-3
    assert sim.wall_forces[0, 2] == pytest.approx(-weight, rel=0.01)
    x, owner = sim.centres, sim.body_of
    for b in (0, 45):
        parts = x[owner == b]
        gap = parts - parts[0]
        gap[:, :2] -= 21e-3 * np.round(gap[:, :2] / 21e-3)
        shape = spherocylinder(1.6e-3, 4e-3, spheres=4) if b == 0 else tetrapod(1.6e-3, 1.8e-3)
        expected = shape.centres - shape.centres[0]
        assert np.linalg.norm(gap, axis=1) == pytest.approx(np.linalg.norm(expected, axis=1))
    pairs = sim.contacts
    assert len(pairs) > 62  # more than one for each body
    same = (owner[pairs[:, 0]] == owner[pairs[:, 1]]) & (owner[pairs[:, 0]] >= 0)
    assert not same.any()


def test_same_bits_on_two_threads_in_parts_and_from_a_checkpoint(tmp_path, monkeypatch):
    from greybed.dem import crew, lists

    # So few spheres are one block, and call nobody to help.
    monkeypatch.setattr(lists, "BLOCK", 64)
    monkeypatch.setattr(crew, "WORTH_HELP", 0)
    monkeypatch.setattr(crew, "WORTH_PARTS", 0)
    whole, parts, two = bed(), bed(), bed(threads=2)
    whole.run(2000)
    two.run(2000)
    parts.run(700)
    save(parts, tmp_path / "state.npz")
    again = bed(n=40)
    restore(again, tmp_path / "state.npz")
    again.run(1300)
    parts.run(1300)
    for other in (two, parts, again):
        np.testing.assert_array_equal(other.centres, whole.centres)
        np.testing.assert_array_equal(other.bodies.momenta, whole.bodies.momenta)


def test_bodies_come_and_go_whole():
    sim = bed()
    sim.run(500)
    shape = tetrapod(1.6e-3, 1.8e-3)
    sim.insert_clumps(Clumps(shape, [[10e-3, 10e-3, 40e-3]]))
    assert len(sim.bodies.masses) == 61
    with pytest.raises(InputError, match="touches"):
        sim.insert_clumps(Clumps(shape, [[10e-3, 10e-3, 40.5e-3]]))
    assert len(sim.bodies.masses) == 61
    owner = sim.body_of
    with pytest.raises(InputError, match="stay or go together"):
        sim.remove(np.arange(len(owner)) == int(np.flatnonzero(owner == 7)[0]))
    before = sim.bodies.centres
    sim.remove(np.isin(owner, [3, 50]))
    left = np.delete(np.arange(61), [3, 50])
    np.testing.assert_array_equal(sim.bodies.centres, before[left])
    assert sorted(set(sim.body_of)) == list(range(-1, 59))
    sim.run(500)
    assert np.isfinite(sim.centres).all()


def test_bad_bodies_are_refused():
    with pytest.raises(InputError, match="quaternions"):
        one(tetrapod(2e-3, 3e-3), orientations=[[0, 0, 0, 0]])
    with pytest.raises(InputError, match="at least the diameter"):
        spherocylinder(4e-3, 3e-3)
    with pytest.raises(InputError, match="radii"):
        sphere_union([[0, 0, 0]], [-1.0])
