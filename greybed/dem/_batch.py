"""Compiled contact laws, each a loop over a batch of contacts that the compiler can vectorise.

``work`` is the batch: row ``col.NX`` holds one number for each of its contacts c, the first n of
which are filled. What each row is stands in ``_columns.py``.
"""

import math

import numpy as np

from greybed.core.jit import njit
from greybed.dem import _columns as col
from greybed.dem._cohesion import bridges, energy_density, jkr, pull_off, van_der_waals
from greybed.dem._rolling import constant_torque, rolling_spring, viscous_torque

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def empty_batch(table):
    """A batch before its first contact; with one pair of materials its numbers stay in there."""
    work = np.empty((col.ROWS, col.SIZE))
    if table.shape[0] == 1:
        for column in range(col.COLUMNS):
            work[column, :] = table[0, column]
    # What not every law fills in. To fill in all rows would take as long as many contacts.
    for row in (col.INERTIA, col.AREA, col.HELD):
        work[row, :] = 0.0
    work[col.TX : col.DEEP + 1, :] = 0.0
    work[col.RX : col.RZ + 1, :] = 0.0
    return work


@njit(**_OPTIONS)
def solve(work, n, dt, normal, rolling, cohesion, limit):
    """Forces F on the first body, n x tangential force B, rolling torque R on the second."""
    surface_velocity(work, n)
    if cohesion == col.JKR:
        jkr(work, n, limit)
    elif normal == col.HERTZ:
        hertz(work, n)
    elif normal == col.LINEAR:
        linear(work, n)
    elif normal == col.VISCOELASTIC:
        viscoelastic(work, n)
    else:
        hysteresis(work, n)
    if limit and cohesion != col.JKR:
        cut_attraction(work, n)
    if cohesion == col.SJKR:
        energy_density(work, n)
    elif cohesion == col.DMT:
        pull_off(work, n)
    elif cohesion == col.VAN_DER_WAALS:
        van_der_waals(work, n)
    elif cohesion == col.LIQUID:
        bridges(work, n)
    stretch(work, n, dt)
    friction(work, n)
    lever(work, n)
    if rolling == col.CONSTANT_TORQUE:
        constant_torque(work, n)
    elif rolling == col.VISCOUS:
        viscous_torque(work, n)
    elif rolling != col.NO_ROLLING:
        rolling_spring(work, n, dt, rolling == col.EPSD)


@njit(**_OPTIONS)
def pair_geometry(work, n):
    """Normals and reduced numbers of sphere pairs, whose N holds the vector between the centres."""
    nx, ny, nz, overlap, ri, rj = (
        work[col.NX],
        work[col.NY],
        work[col.NZ],
        work[col.OVERLAP],
        work[col.RI],
        work[col.RJ],
    )
    arm_i, arm_j, r_eff, m_eff, mi, mj = (
        work[col.ARM_I],
        work[col.ARM_J],
        work[col.R_EFF],
        work[col.M_EFF],
        work[col.MI],
        work[col.MJ],
    )
    for c in range(n):
        distance = math.sqrt(nx[c] * nx[c] + ny[c] * ny[c] + nz[c] * nz[c])
        inverse = 1.0 / distance
        nx[c] *= inverse
        ny[c] *= inverse
        nz[c] *= inverse
        overlap[c] = ri[c] + rj[c] - distance
    for c in range(n):
        arm_i[c] = ri[c] - 0.5 * overlap[c]
        arm_j[c] = rj[c] - 0.5 * overlap[c]
    for c in range(n):
        # One division for both: it is what this loop takes longest for.
        r_sum, m_sum = ri[c] + rj[c], mi[c] + mj[c]
        inverse = 1.0 / (r_sum * m_sum)
        r_eff[c] = ri[c] * rj[c] * (m_sum * inverse)
        m_eff[c] = mi[c] * mj[c] * (r_sum * inverse)


@njit(**_OPTIONS)
def pair_extras(work, n):
    """What only some laws need: the disc in which two spheres cut each other, m r2 reduced."""
    ri, rj, overlap, area, mi, mj = (
        work[col.RI],
        work[col.RJ],
        work[col.OVERLAP],
        work[col.AREA],
        work[col.MI],
        work[col.MJ],
    )
    inertia = work[col.INERTIA]
    for c in range(n):
        high, low = ri[c] + rj[c], ri[c] - rj[c]
        square = (high - overlap[c]) ** 2
        area[c] = 0.25 * math.pi * (high * high - square) * (square - low * low) / square
        own, theirs = mi[c] * ri[c] * ri[c], mj[c] * rj[c] * rj[c]
        inertia[c] = own * theirs / (own + theirs)


@njit(**_OPTIONS)
def surface_velocity(work, n):
    """UN along the normal, V of the surfaces along each other."""
    un, ux, nx, uy, ny, uz = (
        work[col.UN],
        work[col.UX],
        work[col.NX],
        work[col.UY],
        work[col.NY],
        work[col.UZ],
    )
    nz, arm_i, ix, arm_j, jx, iy = (
        work[col.NZ],
        work[col.ARM_I],
        work[col.IX],
        work[col.ARM_J],
        work[col.JX],
        work[col.IY],
    )
    jy, iz, jz, vx, vy, vz = (
        work[col.JY],
        work[col.IZ],
        work[col.JZ],
        work[col.VX],
        work[col.VY],
        work[col.VZ],
    )
    for c in range(n):
        un[c] = ux[c] * nx[c] + uy[c] * ny[c] + uz[c] * nz[c]
    for c in range(n):
        wx = arm_i[c] * ix[c] + arm_j[c] * jx[c]
        wy = arm_i[c] * iy[c] + arm_j[c] * jy[c]
        wz = arm_i[c] * iz[c] + arm_j[c] * jz[c]
        vx[c] = ux[c] - un[c] * nx[c] + ny[c] * wz - nz[c] * wy
        vy[c] = uy[c] - un[c] * ny[c] + nz[c] * wx - nx[c] * wz
        vz[c] = uz[c] - un[c] * nz[c] + nx[c] * wy - ny[c] * wx


@njit(**_OPTIONS)
def hertz(work, n):
    """Hertz's force with Tsuji's damping; Mindlin's tangential stiffness without slip.

    ``stiff`` is S = 2 E* sqrt(R* d), ``critical`` the dashpot of critical damping, 2 sqrt(S m*).
    """
    r_eff, overlap, modulus, k_t, shear, k_n = (
        work[col.R_EFF],
        work[col.OVERLAP],
        work[col.LAW_MODULUS],
        work[col.K_T],
        work[col.LAW_SHEAR],
        work[col.K_N],
    )
    force, damping, m_eff, un, dashpot_t, tangential = (
        work[col.FORCE],
        work[col.LAW_DAMPING],
        work[col.M_EFF],
        work[col.UN],
        work[col.DASHPOT],
        work[col.LAW_TANGENTIAL],
    )
    for c in range(n):
        width = math.sqrt(r_eff[c] * overlap[c])
        stiff = 2.0 * modulus[c] * width
        k_t[c] = 8.0 * shear[c] * width
        k_n[c] = stiff * (2.0 / 3.0)
        critical = 2.0 * math.sqrt(stiff * m_eff[c])
        force[c] = k_n[c] * overlap[c] - damping[c] * critical * un[c]
        dashpot_t[c] = tangential[c] * critical


@njit(**_OPTIONS)
def viscoelastic(work, n):
    """Hertz's force with the dissipation 3/2 A k sqrt(d) v of a viscous material beside Tsuji's."""
    r_eff, overlap, modulus, k_t, shear, k_n, relaxation = (
        work[col.R_EFF],
        work[col.OVERLAP],
        work[col.LAW_MODULUS],
        work[col.K_T],
        work[col.LAW_SHEAR],
        work[col.K_N],
        work[col.LAW_UNLOADING],
    )
    force, damping, m_eff, un, dashpot_t, tangential = (
        work[col.FORCE],
        work[col.LAW_DAMPING],
        work[col.M_EFF],
        work[col.UN],
        work[col.DASHPOT],
        work[col.LAW_TANGENTIAL],
    )
    for c in range(n):
        width = math.sqrt(r_eff[c] * overlap[c])
        stiff = 2.0 * modulus[c] * width
        k_t[c] = 8.0 * shear[c] * width
        k_n[c] = stiff * (2.0 / 3.0)
        # The force of Hertz is 2/3 S d, so 3/2 A k sqrt(d) is A times S.
        critical = 2.0 * math.sqrt(stiff * m_eff[c])
        drag = damping[c] * critical + relaxation[c] * stiff
        force[c] = k_n[c] * overlap[c] - drag * un[c]
        dashpot_t[c] = tangential[c] * critical


@njit(**_OPTIONS)
def linear(work, n):
    """Spring and dashpot."""
    k_n, k_t, modulus, shear, force, overlap = (
        work[col.K_N],
        work[col.K_T],
        work[col.LAW_MODULUS],
        work[col.LAW_SHEAR],
        work[col.FORCE],
        work[col.OVERLAP],
    )
    damping, m_eff, un, dashpot_t, tangential = (
        work[col.LAW_DAMPING],
        work[col.M_EFF],
        work[col.UN],
        work[col.DASHPOT],
        work[col.LAW_TANGENTIAL],
    )
    for c in range(n):
        k_n[c], k_t[c] = modulus[c], shear[c]
        force[c] = modulus[c] * overlap[c]
        force[c] -= 2.0 * damping[c] * math.sqrt(modulus[c] * m_eff[c]) * un[c]
        dashpot_t[c] = 2.0 * tangential[c] * math.sqrt(shear[c] * m_eff[c])


@njit(**_OPTIONS)
def hysteresis(work, n):
    """Loading with one stiffness, unloading with a steeper one down to the plastic overlap."""
    k_n, k_t, modulus, shear, overlap, ratio = (
        work[col.K_N],
        work[col.K_T],
        work[col.LAW_MODULUS],
        work[col.LAW_SHEAR],
        work[col.OVERLAP],
        work[col.LAW_UNLOADING],
    )
    deep, force, dashpot_t, tangential, m_eff = (
        work[col.DEEP],
        work[col.FORCE],
        work[col.DASHPOT],
        work[col.LAW_TANGENTIAL],
        work[col.M_EFF],
    )
    for c in range(n):
        k_n[c], k_t[c] = modulus[c], shear[c]
        loading = modulus[c] * overlap[c]
        unloading = ratio[c] * modulus[c] * (overlap[c] - deep[c])
        if unloading >= loading:
            force[c] = loading
            deep[c] = overlap[c] * (1.0 - 1.0 / ratio[c])
        else:
            force[c] = max(unloading, 0.0)
        dashpot_t[c] = 2.0 * tangential[c] * math.sqrt(shear[c] * m_eff[c])


@njit(**_OPTIONS)
def cut_attraction(work, n):
    """No attraction from damping."""
    force = work[col.FORCE]
    for c in range(n):
        force[c] = max(force[c], 0.0)


@njit(**_OPTIONS)
def stretch(work, n, dt):
    """The tangential spring grows with the way of the surfaces and stays in the contact plane."""
    sx, vx, sy, vy, sz, vz = (
        work[col.SX],
        work[col.VX],
        work[col.SY],
        work[col.VY],
        work[col.SZ],
        work[col.VZ],
    )
    nx, ny, nz = work[col.NX], work[col.NY], work[col.NZ]
    for c in range(n):
        x, y, z = sx[c] + vx[c] * dt, sy[c] + vy[c] * dt, sz[c] + vz[c] * dt
        along = x * nx[c] + y * ny[c] + z * nz[c]
        sx[c], sy[c], sz[c] = x - along * nx[c], y - along * ny[c], z - along * nz[c]


@njit(**_OPTIONS)
def friction(work, n):
    """Tangential force of spring and dashpot; where it slides the spring keeps what can be held."""
    k_t, sx, sy, sz, force, static = (
        work[col.K_T],
        work[col.SX],
        work[col.SY],
        work[col.SZ],
        work[col.FORCE],
        work[col.LAW_FRICTION],
    )
    sliding, dashpot_t, fx, vx, fy, vy = (
        work[col.LAW_SLIDING],
        work[col.DASHPOT],
        work[col.FX],
        work[col.VX],
        work[col.FY],
        work[col.VY],
    )
    fz, vz, extra = work[col.FZ], work[col.VZ], work[col.HELD]
    for c in range(n):
        held = k_t[c] * math.sqrt(sx[c] * sx[c] + sy[c] * sy[c] + sz[c] * sz[c])
        pressed = abs(force[c] + extra[c])
        slides = held > static[c] * pressed
        share = sliding[c] * pressed / held if slides else 1.0
        dashpot = 0.0 if slides else dashpot_t[c]
        sx[c] *= share
        sy[c] *= share
        sz[c] *= share
        fx[c] = -k_t[c] * sx[c] - dashpot * vx[c]
        fy[c] = -k_t[c] * sy[c] - dashpot * vy[c]
        fz[c] = -k_t[c] * sz[c] - dashpot * vz[c]


@njit(**_OPTIONS)
def lever(work, n):
    """B = n x tangential force, then the whole force."""
    bx, ny, fz, nz, fy, by = (
        work[col.BX],
        work[col.NY],
        work[col.FZ],
        work[col.NZ],
        work[col.FY],
        work[col.BY],
    )
    fx, nx, bz, force = work[col.FX], work[col.NX], work[col.BZ], work[col.FORCE]
    for c in range(n):
        bx[c] = ny[c] * fz[c] - nz[c] * fy[c]
        by[c] = nz[c] * fx[c] - nx[c] * fz[c]
        bz[c] = nx[c] * fy[c] - ny[c] * fx[c]
    for c in range(n):
        fx[c] += force[c] * nx[c]
        fy[c] += force[c] * ny[c]
        fz[c] += force[c] * nz[c]
