"""Growth of small vertical waves of a homogeneous suspension: an eigenvalue problem of its own.

Derived from the model's equations, not from the solver: with the slip W = u0 - v0 of the base,
gamma = beta / (phi eps) and K the solids pressure over density, at a given granular temperature,

    s phi' + ik (phi0 v' + v0 phi') = 0
    ik (eps0 u' + phi0 v' - W phi') = 0
    rho_g (s + ik u0) u' = -ik p' - phi0 W gamma' - gamma W phi' - gamma phi0 (u' - v')
                           - 4/3 mu k^2 u'
    rho_s (s + ik v0) v' = -ik p' + eps0 W gamma' - gamma W phi' + gamma eps0 (u' - v')
                           - ik P' phi' / phi0 - (4/3 mu_s + bulk) k^2 v' / phi0
"""

import numpy as np
from scipy.linalg import eig


def waves(k, phi, law, granular, *, particle_density, diameter, gas_density, gas_viscosity, g=9.81):
    """Growth rates (complex, fastest growing first), eigenvectors (phi, v, u, p), and the slip."""
    eps, theta = 1.0 - phi, granular.temperature

    def gamma(solid, slip):
        re = (1.0 - solid) * gas_density * diameter * abs(slip) / gas_viscosity
        return 18.0 * gas_viscosity / diameter**2 * float(law(np.array([solid]), np.array([re]))[0])

    slip = 0.1
    for _ in range(200):
        slip = (particle_density - gas_density) * g / gamma(phi, slip)
    base, dp, dw = gamma(phi, slip), 1e-6, 1e-6 * slip
    by_phi = (gamma(phi + dp, slip) - gamma(phi - dp, slip)) / (2 * dp)
    by_slip = (gamma(phi, slip + dw) - gamma(phi, slip - dw)) / (2 * dw)
    stiff = float(
        granular.pressure(phi + dp, theta, particle_density)
        - granular.pressure(phi - dp, theta, particle_density)
    ) / (2 * dp)  # fmt: skip
    shear, bulk = granular.viscosities(phi, theta, particle_density, diameter)
    # Velocities of the frame in which the solids rest.
    u0, v0, i = slip, 0.0, 1j * k
    a = np.zeros((4, 4), complex)
    b = np.diag([1.0, 0.0, gas_density, particle_density]).astype(complex)
    # Columns phi, v, u, p; rows mass, volume, gas, solids.
    b = np.zeros((4, 4), complex)
    a[0] = [-i * v0, -i * phi, 0, 0]
    b[0, 0] = 1.0
    a[1] = [-i * slip, i * phi, i * eps, 0]
    both = base + by_slip * slip
    a[2] = [
        -phi * slip * by_phi - base * slip, phi * both,
        -phi * both - 4 / 3 * gas_viscosity * k**2 - gas_density * i * u0, -i,
    ]  # fmt: skip
    b[2, 2] = gas_density
    a[3] = [
        eps * slip * by_phi - base * slip - i * stiff / phi,
        -eps * both - (4 / 3 * shear + bulk) * k**2 / phi - particle_density * i * v0,
        eps * both, -i,
    ]  # fmt: skip
    b[3, 1] = particle_density
    values, vectors = eig(a, b)
    keep = np.isfinite(values) & (abs(values) < 1e8)
    values, vectors = values[keep], vectors[:, keep]
    order = np.argsort(-values.real)
    return values[order], vectors[:, order], slip
