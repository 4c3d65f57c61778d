"""Box filters of a resolved flow: identities and bounds that hold to round-off."""

import numpy as np
import pytest

from greybed.datasets.drag_filters import Resolved, box_mean, filtered, sampled

PACKING = 0.63


def made_up(shape=(1, 12, 10), seed=0):
    random = np.random.default_rng(seed)
    phi = random.uniform(0.0, PACKING, shape)
    gas, solids, gradient = (random.normal(size=(3, *shape)) for _ in range(3))
    return Resolved(
        solid_fraction=phi, gas=gas, solids=solids, gradient=gradient,
        drag=100.0 * phi * (gas - solids), edge=1e-3, dimension=2 if shape[0] == 1 else 3,
    )  # fmt: skip


@pytest.mark.parametrize("shape", [(1, 12, 10), (6, 8, 10)])
@pytest.mark.parametrize("cells", [2, 3, 5])
def test_means_are_those_of_the_cells_in_each_box(shape, cells):
    field = np.random.default_rng(1).normal(size=shape)
    mean = box_mean(field, cells, 2 if shape[0] == 1 else 3)
    low = cells // 2
    for z, y, x in ((0, 0, 0), (0, 7, 4), (0, 3, 9)):
        picks = [
            np.arange(k - low, k - low + cells) % n if n > 1 else [0]
            for k, n in zip((z, y, x), shape, strict=True)
        ]
        assert mean[z, y, x] == pytest.approx(field[np.ix_(*picks)].mean(), abs=1e-14)


@pytest.mark.parametrize("cells", [1, 2, 5])
def test_drift_is_the_covariance_of_solids_and_gas(cells):
    flow = made_up()
    found = filtered(flow, cells)
    phi, u = flow.solid_fraction, flow.gas
    mean = found["solid_fraction"]
    covariance = box_mean(phi * u, cells, 2) - mean * box_mean(u, cells, 2)
    np.testing.assert_allclose(
        found["drift_velocity"], covariance / (mean * (1.0 - mean)), atol=1e-12
    )


def test_a_filter_of_one_cell_takes_nothing_away():
    flow = made_up()
    found = filtered(flow, 1)
    np.testing.assert_allclose(found["slip"], flow.gas - flow.solids, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(found["drag_force"], flow.drag)
    for name in ("scalar_variance", "drift_velocity", "gas_stress", "solids_stress"):
        assert np.abs(found[name]).max() < 1e-13, name


@pytest.mark.parametrize("cells", [2, 3, 6])
def test_drift_stays_within_what_fractions_and_velocities_can_correlate(cells):
    # Cauchy and Schwarz, and Bhatia and Davis for a fraction between 0 and the packing.
    flow = made_up(seed=3)
    found = filtered(flow, cells)
    phi, u = found["solid_fraction"], flow.gas
    spread = np.sqrt(np.maximum(box_mean(u * u, cells, 2) - box_mean(u, cells, 2) ** 2, 0.0))
    bound = spread * np.sqrt(phi * (PACKING - phi)) / (1.0 - phi)
    assert (np.abs(phi * found["drift_velocity"]) <= bound + 1e-12).all()
    assert (found["scalar_variance"] <= phi * (PACKING - phi) + 1e-12).all()


def test_means_of_the_whole_box_are_kept():
    flow = made_up()
    for cells in (2, 5):
        found = filtered(flow, cells)
        assert found["solid_fraction"].mean() == pytest.approx(flow.solid_fraction.mean())
        np.testing.assert_allclose(
            found["drag_force"].mean(axis=(1, 2, 3)), flow.drag.mean(axis=(1, 2, 3)), atol=1e-12
        )


def test_samples_are_few_spread_over_the_fractions_and_the_same_for_a_seed():
    flow = made_up((1, 96, 64))
    flow.solid_fraction[:] = flow.solid_fraction**4  # most of it is dilute
    first, again = (sampled(flow, 2, 200, np.random.default_rng(5)) for _ in range(2))
    for name in first:
        np.testing.assert_array_equal(first[name], again[name])
    assert len(first["filter_size"]) == 200
    assert first["slip"].shape == (200, 3)
    assert (first["filter_size"] == 2e-3).all()
    every = sampled(flow, 2, 10**6, np.random.default_rng(5))["solid_fraction"]
    high = every.min() + 0.5 * np.ptp(every)
    assert (first["solid_fraction"] > high).mean() > 2.0 * (every > high).mean()
