"""The data set of filtered drag that is shipped: what it covers, and what must hold in it."""

from importlib.resources import files

import numpy as np

from greybed.datasets.filtered_drag import shipped_filtered_drag


def test_it_is_small_and_covers_two_and_three_dimensions_and_particles():
    path = files("greybed.datasets").joinpath("filtered_drag.h5")
    assert len(path.read_bytes()) < 20e6
    data = shipped_filtered_drag()
    kinds = [(case.source, case.dimension) for case in data.cases]
    assert kinds.count(("two-fluid", 2)) >= 10
    assert kinds.count(("two-fluid", 3)) >= 1
    assert kinds.count(("cfd-dem", 3)) >= 2
    means = [case.mean_solid_fraction for case in data.cases]
    assert min(means) <= 0.02
    assert max(means) >= 0.5


def test_its_numbers_are_finite_and_within_what_fractions_allow():
    data = shipped_filtered_drag()
    for name in ("slip", "drag_force", "drift_velocity", "pressure_gradient"):
        assert np.isfinite(getattr(data, name)).all(), name
    packing = np.array([case.packing for case in data.cases])[data.case]
    # Bhatia and Davis, to single precision of both.
    bound = data.solid_fraction * (packing - data.solid_fraction)
    assert (data.scalar_variance <= bound + 1e-6).all()
    # Gas drives particles up: on the whole the filtered drag is along the filtered slip.
    assert (data.drag_force[:, 1] * data.slip[:, 1] > 0.0).mean() > 0.98
