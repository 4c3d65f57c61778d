"""Compiled lubrication between spheres that near each other."""

import math

from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def films(pairs, place, motion, edge, periodic, viscosity, reach, rough, dt, force):
    """Add the forces of the films between ``pairs`` (m, 2) to ``force`` (n, 3).

    ``edge`` (3,) is that of the box along axes that repeat. Returns the fastest approach over the
    film's thickness [1/s].
    """
    fastest = 0.0
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        x, y, z = (
            place[i, 0] - place[j, 0], place[i, 1] - place[j, 1], place[i, 2] - place[j, 2]
        )  # fmt: skip
        if periodic[0]:
            x -= edge[0] * round(x / edge[0])
        if periodic[1]:
            y -= edge[1] * round(y / edge[1])
        if periodic[2]:
            z -= edge[2] * round(z / edge[2])
        distance = math.sqrt(x * x + y * y + z * z)
        ri, rj = place[i, 3], place[j, 3]
        gap = distance - ri - rj
        if gap <= 0.0 or gap >= reach:
            continue
        x, y, z = x / distance, y / distance, z / distance
        apart = (motion[i, 0] - motion[j, 0]) * x + (motion[i, 1] - motion[j, 1]) * y
        apart += (motion[i, 2] - motion[j, 2]) * z
        film, radius = max(gap, rough), ri * rj / (ri + rj)
        drag = 6.0 * math.pi * viscosity * radius * radius * (1.0 / film - 1.0 / reach)
        mass = motion[i, 6] * motion[j, 6] / (motion[i, 6] + motion[j, 6])
        # Of the pair's new velocity: no film is too stiff for the step.
        pull = -drag * apart / (1.0 + drag * dt / mass)
        force[i, 0] += pull * x
        force[i, 1] += pull * y
        force[i, 2] += pull * z
        force[j, 0] -= pull * x
        force[j, 1] -= pull * y
        force[j, 2] -= pull * z
        fastest = max(fastest, -apart / film)
    return fastest
