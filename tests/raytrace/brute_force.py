"""Reference tracer for the tests: every sphere, image and wall against every ray, plain NumPy."""

from __future__ import annotations

from itertools import product

import numpy as np

from greybed.core import Plane


def emitted(rng, centre, radius, m):
    """Uniform points of a sphere and directions with a cosine law about their normals."""
    z, turn = rng.uniform(-1, 1, m), rng.uniform(0, 2 * np.pi, m)
    rho = np.sqrt(1 - z**2)
    normal = np.stack([rho * np.cos(turn), rho * np.sin(turn), z], axis=1)
    # Cosine law: the normal plus a uniform point of the unit sphere, scaled to length 1.
    z, turn = rng.uniform(-1, 1, m), rng.uniform(0, 2 * np.pi, m)
    rho = np.sqrt(1 - z**2)
    d = normal + np.stack([rho * np.cos(turn), rho * np.sin(turn), z], axis=1)
    return centre + radius * normal, d / np.linalg.norm(d, axis=1, keepdims=True)


def first_hits(packing, origins, directions, reach=2):
    """Distance and hit (-1 - k: wall k, -1 - n_walls: nothing), images ``reach`` boxes away."""
    n = len(packing)
    steps = [range(-reach, reach + 1) if wraps else (0,) for wraps in packing.periodic]
    shifts = np.array(list(product(*steps))) * packing.edges
    centres = (packing.centres[None] + shifts[:, None]).reshape(-1, 3)
    radii = np.tile(packing.radii, len(shifts))
    best = np.full(len(origins), np.inf)
    hit = np.full(len(origins), -1 - packing.n_walls)
    for k in range(len(centres)):
        to = centres[k] - origins
        along = (to * directions).sum(axis=1)
        root = radii[k] ** 2 - (to**2).sum(axis=1) + along**2
        t = along - np.sqrt(np.maximum(root, 0.0))
        ahead = (root > 0.0) & (t > 1e-9 * radii[k]) & (t < best)
        best[ahead], hit[ahead] = t[ahead], k % n
    for k, wall in enumerate(packing.walls):
        offset = origins - np.array(wall.point)
        if isinstance(wall, Plane):
            normal = np.array(wall.normal)
            towards = -directions @ normal
            with np.errstate(divide="ignore", invalid="ignore"):
                t = np.where(towards > 0.0, (offset @ normal) / towards, np.inf)
        else:
            axis = np.array(wall.axis)
            u = directions - np.outer(directions @ axis, axis)
            q = offset - np.outer(offset @ axis, axis)
            a, b = (u**2).sum(axis=1), (u * q).sum(axis=1)
            t = (np.sqrt(b**2 - a * ((q**2).sum(axis=1) - wall.radius**2)) - b) / a
        near = t < best
        best[near], hit[near] = t[near], -1 - k
    return best, hit
