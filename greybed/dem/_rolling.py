"""Compiled rolling resistance: torques of a batch of contacts against the rolling."""

import math

from greybed.core.jit import njit
from greybed.dem import _columns as col

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def roll_rate(work, n):
    """R holds the difference of the spins, without torsion about the normal."""
    ix, jx, iy, jy, iz, jz = (
        work[col.IX],
        work[col.JX],
        work[col.IY],
        work[col.JY],
        work[col.IZ],
        work[col.JZ],
    )
    nx, ny, nz, rx, ry, rz = (
        work[col.NX],
        work[col.NY],
        work[col.NZ],
        work[col.RX],
        work[col.RY],
        work[col.RZ],
    )
    for c in range(n):
        qx, qy, qz = ix[c] - jx[c], iy[c] - jy[c], iz[c] - jz[c]
        turn = qx * nx[c] + qy * ny[c] + qz * nz[c]
        rx[c], ry[c], rz[c] = qx - turn * nx[c], qy - turn * ny[c], qz - turn * nz[c]


@njit(**_OPTIONS)
def constant_torque(work, n):
    """A torque of constant size against the rolling."""
    roll_rate(work, n)
    rx, ry, rz, mu_r, force, r_eff = (
        work[col.RX],
        work[col.RY],
        work[col.RZ],
        work[col.LAW_ROLLING],
        work[col.FORCE],
        work[col.R_EFF],
    )
    for c in range(n):
        rate = math.sqrt(rx[c] * rx[c] + ry[c] * ry[c] + rz[c] * rz[c])
        size = mu_r[c] * abs(force[c]) * r_eff[c] / rate if rate > 0.0 else 0.0
        rx[c] *= size
        ry[c] *= size
        rz[c] *= size


@njit(**_OPTIONS)
def viscous_torque(work, n):
    """A torque in proportion to the normal force and the rolling velocity R* |difference of spins|.

    The pressure cannot lie outside the contact, so the torque ends at force times its radius.
    """
    roll_rate(work, n)
    rx, ry, rz, time, force, r_eff, overlap = (
        work[col.RX],
        work[col.RY],
        work[col.RZ],
        work[col.LAW_ROLLING],
        work[col.FORCE],
        work[col.R_EFF],
        work[col.OVERLAP],
    )
    for c in range(n):
        speed = r_eff[c] * math.sqrt(rx[c] * rx[c] + ry[c] * ry[c] + rz[c] * rz[c])
        radius = math.sqrt(r_eff[c] * max(overlap[c], 0.0))
        lag = time[c] * speed
        share = radius / lag if lag > radius else 1.0
        size = abs(force[c]) * time[c] * r_eff[c] * share
        rx[c] *= size
        ry[c] *= size
        rz[c] *= size


@njit(**_OPTIONS)
def rolling_spring(work, n, dt, dashpot):
    """EPSD: a spring that yields, with a dashpot until then; or the modified one, without."""
    roll_rate(work, n)
    mu_r, force, r_eff, k_n, k_t, tx = (
        work[col.LAW_ROLLING],
        work[col.FORCE],
        work[col.R_EFF],
        work[col.K_N],
        work[col.K_T],
        work[col.TX],
    )
    rx, ty, ry, tz, rz, roll_damping = (
        work[col.RX],
        work[col.TY],
        work[col.RY],
        work[col.TZ],
        work[col.RZ],
        work[col.LAW_ROLLING_DAMPING],
    )
    inertia = work[col.INERTIA]
    for c in range(n):
        most = mu_r[c] * abs(force[c]) * r_eff[c]
        if dashpot:
            stiff = 2.25 * k_n[c] * (mu_r[c] * r_eff[c]) ** 2
        else:
            stiff = k_t[c] * r_eff[c] * r_eff[c]
        x, y, z = tx[c] + stiff * dt * rx[c], ty[c] + stiff * dt * ry[c], tz[c] + stiff * dt * rz[c]
        size = math.sqrt(x * x + y * y + z * z)
        full = size > most
        share = most / size if full else 1.0
        tx[c], ty[c], tz[c] = x * share, y * share, z * share
        # 7/5 m r2: a sphere about its contact.
        drag = 2.0 * roll_damping[c] * math.sqrt(1.4 * inertia[c] * stiff)
        drag = drag if dashpot and not full else 0.0
        rx[c] = tx[c] + drag * rx[c]
        ry[c] = ty[c] + drag * ry[c]
        rz[c] = tz[c] + drag * rz[c]
