"""Scrambled Sobol points: the published sequence, nested scrambling, and the rays made of them."""

from __future__ import annotations

import numpy as np
from scipy.stats import qmc

from greybed.raytrace import _sobol


def points(n):
    out = np.zeros((4, n), np.uint32)
    _sobol.sequence(n, _sobol.direction_numbers(), out)
    return out


def reversed_bits(values):
    text = [f"{int(v):032b}"[::-1] for v in values.ravel()]
    return np.array([int(t, 2) for t in text], dtype=np.uint64).reshape(values.shape)


def test_the_sequence_is_sobol_s():
    ours = reversed_bits(points(1024)).T * 2.0**-32
    theirs = qmc.Sobol(4, scramble=False, bits=32).random(1024)
    # Another order within blocks of two to the k is allowed (Gray code); the points are the same.
    for n in (16, 256, 1024):
        np.testing.assert_array_equal(
            ours[:n][np.lexsort(ours[:n].T)], theirs[:n][np.lexsort(theirs[:n].T)]
        )


def scrambled(n, dimension, seed):
    raw = points(n)[dimension]
    return np.array([_sobol.scrambled(x, np.uint32(seed)) for x in raw])


def test_scrambling_is_nested():
    """Intervals of every binary level keep their share of the points, and move as wholes."""
    for dimension in range(4):
        values = scrambled(256, dimension, 12345 + dimension)
        for level in (1, 2, 4, 6, 8):
            counts = np.bincount((values * 2**level).astype(int), minlength=2**level)
            assert (counts == 256 >> level).all()
    a, b = scrambled(256, 1, 1), scrambled(256, 1, 2)
    plain = reversed_bits(points(256)[1]) * 2.0**-32
    assert not np.allclose(a, b)
    # Two points that share the leading k bits share them after scrambling too, and no more.
    for k in (1, 3, 5):
        cell, mine = (plain * 2**k).astype(int), (a * 2**k).astype(int)
        assert all(len(set(mine[cell == c])) == 1 for c in range(2**k))


def test_scrambled_points_are_uniform_over_seeds():
    first = np.array([scrambled(1, 0, seed)[0] for seed in range(1, 4001)])
    counts = np.bincount((first * 16).astype(int), minlength=16)
    # Chi-square with 15 degrees of freedom: 37.7 in one of a thousand.
    assert ((counts - 250) ** 2 / 250).sum() < 37.7


def test_cosine_and_sine_of_a_turn():
    for u in np.linspace(0.0, 1.0, 97, endpoint=False):
        cosine, sine = _sobol.turn(u)
        np.testing.assert_allclose(
            [cosine, sine], [np.cos(2 * np.pi * u), np.sin(2 * np.pi * u)], atol=2e-14
        )


def test_rays_follow_the_cosine_law():
    n = 4096
    rays = np.empty((6, n))
    _sobol.sphere_rays(points(n), n, np.array([5, 6, 7, 8], np.uint32), rays, 0)
    direction, place = rays[:3], rays[3:]
    np.testing.assert_allclose((direction**2).sum(axis=0), 1.0, atol=1e-12)
    np.testing.assert_allclose((place**2).sum(axis=0), 1.0, atol=1e-12)
    cosine = (direction * place).sum(axis=0)
    assert cosine.min() >= 0.0
    # Of a cosine law the square of the cosine is uniform: all moments of it in steps of 1 / 4096.
    share = np.sort(cosine**2)
    assert np.abs(share - (np.arange(n) + 0.5) / n).max() < 2e-3
    assert np.abs(direction.mean(axis=1)).max() < 1e-3
    assert np.abs(place.mean(axis=1)).max() < 1e-3
    # The place turns about the direction evenly: no mean sideways.
    assert np.abs(np.cross(direction.T, place.T).mean(axis=0)).max() < 2e-3
