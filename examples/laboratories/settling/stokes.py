"""What the study of spheres believes, as an experiment of ``greybed calibrate``."""

DIAMETERS = (0.3e-3, 0.4e-3, 0.55e-3, 0.75e-3, 1.0e-3, 1.3e-3, 1.7e-3, 2.2e-3, 3.0e-3)  # m


def fall(parameters, seed, settings):
    """Stokes' velocity [m/s] of glass spheres of each size in the liquid."""
    weight = (2500.0 - 1150.0) * 9.80665 / (18.0 * parameters["viscosity"])
    return {"velocity": [list(DIAMETERS), [weight * d**2 for d in DIAMETERS]]}
