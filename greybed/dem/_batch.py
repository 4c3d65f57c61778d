"""Compiled contact laws, each a loop over a batch of contacts that the compiler can vectorise."""

import math

import numpy as np
from numba import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}

# Normal laws, rolling resistance and cohesion; 0 is none where there may be none.
LINEAR, HERTZ, HYSTERESIS = 0, 1, 2
NO_ROLLING, CONSTANT_TORQUE, EPSD, EPSD_MODIFIED = 0, 1, 2, 3
NO_COHESION, SJKR, DMT, VAN_DER_WAALS = 0, 1, 2, 3

# Columns of the table of material pairs.
MODULUS = 0  # E* [Pa]; stiffness [N/m] for linear laws
SHEAR = 1  # G* [Pa]; tangential stiffness [N/m] for linear laws
DAMPING = 2  # share of critical damping, in the units of each law [-]
TANGENTIAL_DAMPING = 3  # the same for tangential motion [-]
FRICTION = 4  # static friction [-]
SLIDING = 5  # dynamic friction [-]
ROLLING = 6  # rolling friction [-]
ROLLING_DAMPING = 7  # share of critical rolling damping [-]
COHESION = 8  # energy density [J/m3], surface energy [J/m2] or Hamaker constant [J]
UNLOADING = 9  # unloading over loading stiffness of the hysteretic law [-]
COLUMNS = 12
NEAREST = 10  # gap below which van der Waals forces no longer grow [m]
REACH = 11  # gap beyond which cohesion ends [m]

# Columns of the history of a contact.
SPRING, TWIST, PLASTIC = 0, 3, 6

# Contacts of a batch: its rows stay in the nearest cache.
SIZE = 96
# Rows of a batch: the columns of the table, then one number of each contact [SI]. The first body
# feels the force, N points to it from the second, U is its velocity relative to the second without
# spin, V that of the surfaces in contact, along them.
LAW_MODULUS, LAW_SHEAR, LAW_DAMPING, LAW_SIDEWAYS, LAW_FRICTION, LAW_SLIDING = range(6)
LAW_ROLLING, LAW_ROLLING_DAMPING, LAW_COHESION, LAW_UNLOADING, LAW_NEAREST = range(6, 11)
NX, NY, NZ, OVERLAP, R_EFF, M_EFF, INERTIA, ARM_I, ARM_J, AREA = range(12, 22)
UX, UY, UZ, IX, IY, IZ, JX, JY, JZ = range(22, 31)
UN, VX, VY, VZ, FORCE, K_N, K_T, DRAG = range(31, 39)
SX, SY, SZ, TX, TY, TZ, DEEP = range(39, 46)
FX, FY, FZ, BX, BY, BZ, RX, RY, RZ = range(46, 55)
RI, RJ, MI, MJ = range(55, 59)
ROWS = 59


@njit(**_OPTIONS)
def room(table):
    """An empty batch; with one pair of materials its numbers stand there for good."""
    work = np.zeros((ROWS, SIZE))
    if table.shape[0] == 1:
        for column in range(COLUMNS):
            work[column, :] = table[0, column]
    return work, np.empty(3 * SIZE, np.int64)


@njit(**_OPTIONS)
def solve(work, n, dt, normal, rolling, cohesion, limit):
    """Forces F on the first body, n x tangential force B, rolling torque R on the second."""
    surface_velocity(work, n)
    if normal == HERTZ:
        hertz(work, n)
    elif normal == LINEAR:
        linear(work, n)
    else:
        hysteresis(work, n)
    if limit:
        cut_attraction(work, n)
    if cohesion == SJKR:
        energy_density(work, n)
    elif cohesion == DMT:
        pull_off(work, n)
    elif cohesion == VAN_DER_WAALS:
        van_der_waals(work, n)
    stretch(work, n, dt)
    friction(work, n)
    lever(work, n)
    if rolling == CONSTANT_TORQUE:
        constant_torque(work, n)
    elif rolling != NO_ROLLING:
        rolling_spring(work, n, dt, rolling == EPSD)


@njit(**_OPTIONS)
def pair_geometry(work, n):
    """Normals and reduced numbers of sphere pairs, whose N holds the vector between the centres."""
    nx, ny, nz, overlap, ri, rj = work[NX], work[NY], work[NZ], work[OVERLAP], work[RI], work[RJ]
    arm_i, arm_j, r_eff, m_eff, mi, mj = work[ARM_I], work[ARM_J], work[R_EFF], work[M_EFF], work[MI], work[MJ]
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
        r_eff[c] = ri[c] * rj[c] / (ri[c] + rj[c])
    for c in range(n):
        m_eff[c] = mi[c] * mj[c] / (mi[c] + mj[c])


@njit(**_OPTIONS)
def pair_extras(work, n):
    """What only some laws need: the disc in which two spheres cut each other, m r2 reduced."""
    ri, rj, overlap, area, mi, mj = work[RI], work[RJ], work[OVERLAP], work[AREA], work[MI], work[MJ]
    inertia = work[INERTIA]
    for c in range(n):
        high, low = ri[c] + rj[c], ri[c] - rj[c]
        square = (high - overlap[c]) ** 2
        area[c] = 0.25 * math.pi * (high * high - square) * (square - low * low) / square
        own, theirs = mi[c] * ri[c] * ri[c], mj[c] * rj[c] * rj[c]
        inertia[c] = own * theirs / (own + theirs)


@njit(**_OPTIONS)
def surface_velocity(work, n):
    """UN along the normal, V of the surfaces along each other."""
    un, ux, nx, uy, ny, uz = work[UN], work[UX], work[NX], work[UY], work[NY], work[UZ]
    nz, arm_i, ix, arm_j, jx, iy = work[NZ], work[ARM_I], work[IX], work[ARM_J], work[JX], work[IY]
    jy, iz, jz, vx, vy, vz = work[JY], work[IZ], work[JZ], work[VX], work[VY], work[VZ]
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
    """Hertz's force with Tsuji's damping; Mindlin's tangential stiffness without slip."""
    r_eff, overlap, modulus, k_t, shear, k_n = work[R_EFF], work[OVERLAP], work[LAW_MODULUS], work[K_T], work[LAW_SHEAR], work[K_N]
    force, damping, m_eff, un, viscous, sideways = work[FORCE], work[LAW_DAMPING], work[M_EFF], work[UN], work[DRAG], work[LAW_SIDEWAYS]
    for c in range(n):
        width = math.sqrt(r_eff[c] * overlap[c])
        stiff = 2.0 * modulus[c] * width
        k_t[c] = 8.0 * shear[c] * width
        k_n[c] = stiff * (2.0 / 3.0)
        force[c] = k_n[c] * overlap[c] - 2.0 * damping[c] * math.sqrt(stiff * m_eff[c]) * un[c]
        viscous[c] = 2.0 * sideways[c] * math.sqrt(k_t[c] * m_eff[c])


@njit(**_OPTIONS)
def linear(work, n):
    """Spring and dashpot."""
    k_n, k_t, modulus, shear, force, overlap = work[K_N], work[K_T], work[LAW_MODULUS], work[LAW_SHEAR], work[FORCE], work[OVERLAP]
    damping, m_eff, un, viscous, sideways = work[LAW_DAMPING], work[M_EFF], work[UN], work[DRAG], work[LAW_SIDEWAYS]
    for c in range(n):
        k_n[c], k_t[c] = modulus[c], shear[c]
        force[c] = modulus[c] * overlap[c]
        force[c] -= 2.0 * damping[c] * math.sqrt(modulus[c] * m_eff[c]) * un[c]
        viscous[c] = 2.0 * sideways[c] * math.sqrt(shear[c] * m_eff[c])


@njit(**_OPTIONS)
def hysteresis(work, n):
    """Loading with one stiffness, unloading with a steeper one down to the plastic overlap."""
    k_n, k_t, modulus, shear, overlap, ratio = work[K_N], work[K_T], work[LAW_MODULUS], work[LAW_SHEAR], work[OVERLAP], work[LAW_UNLOADING]
    deep, force, viscous, sideways, m_eff = work[DEEP], work[FORCE], work[DRAG], work[LAW_SIDEWAYS], work[M_EFF]
    for c in range(n):
        k_n[c], k_t[c] = modulus[c], shear[c]
        loading = modulus[c] * overlap[c]
        unloading = ratio[c] * modulus[c] * (overlap[c] - deep[c])
        if unloading >= loading:
            force[c] = loading
            deep[c] = overlap[c] * (1.0 - 1.0 / ratio[c])
        else:
            force[c] = max(unloading, 0.0)
        viscous[c] = 2.0 * sideways[c] * math.sqrt(shear[c] * m_eff[c])


@njit(**_OPTIONS)
def cut_attraction(work, n):
    """No attraction from damping."""
    force = work[FORCE]
    for c in range(n):
        force[c] = max(force[c], 0.0)


@njit(**_OPTIONS)
def energy_density(work, n):
    """SJKR: attraction in proportion to the disc of contact."""
    force, cohesion, area = work[FORCE], work[LAW_COHESION], work[AREA]
    for c in range(n):
        force[c] -= cohesion[c] * area[c]


@njit(**_OPTIONS)
def pull_off(work, n):
    """DMT: a constant attraction of 4 pi gamma R* in contact."""
    force, cohesion, r_eff = work[FORCE], work[LAW_COHESION], work[R_EFF]
    for c in range(n):
        force[c] -= 4.0 * math.pi * cohesion[c] * r_eff[c]


@njit(**_OPTIONS)
def van_der_waals(work, n):
    """Hamaker's attraction at the nearest gap; across gaps see :func:`attraction`."""
    force, cohesion, r_eff, nearest = work[FORCE], work[LAW_COHESION], work[R_EFF], work[LAW_NEAREST]
    for c in range(n):
        force[c] -= cohesion[c] * r_eff[c] / (6.0 * nearest[c] * nearest[c])


@njit(**_OPTIONS)
def attraction(gap, r_eff, table, p):
    """Hamaker's attraction across a gap [N], at least 0."""
    if gap >= table[p, REACH]:
        return 0.0
    h = max(gap, table[p, NEAREST])
    return table[p, COHESION] * r_eff / (6.0 * h * h)


@njit(**_OPTIONS)
def stretch(work, n, dt):
    """The tangential spring grows with the way of the surfaces and stays in the contact plane."""
    sx, vx, sy, vy, sz, vz = work[SX], work[VX], work[SY], work[VY], work[SZ], work[VZ]
    nx, ny, nz = work[NX], work[NY], work[NZ]
    for c in range(n):
        x, y, z = sx[c] + vx[c] * dt, sy[c] + vy[c] * dt, sz[c] + vz[c] * dt
        along = x * nx[c] + y * ny[c] + z * nz[c]
        sx[c], sy[c], sz[c] = x - along * nx[c], y - along * ny[c], z - along * nz[c]


@njit(**_OPTIONS)
def friction(work, n):
    """Tangential force of spring and dashpot; where it slides the spring keeps what can be held."""
    k_t, sx, sy, sz, force, static = work[K_T], work[SX], work[SY], work[SZ], work[FORCE], work[LAW_FRICTION]
    sliding, viscous, fx, vx, fy, vy = work[LAW_SLIDING], work[DRAG], work[FX], work[VX], work[FY], work[VY]
    fz, vz = work[FZ], work[VZ]
    for c in range(n):
        held = k_t[c] * math.sqrt(sx[c] * sx[c] + sy[c] * sy[c] + sz[c] * sz[c])
        pressed = abs(force[c])
        slides = held > static[c] * pressed
        share = sliding[c] * pressed / held if slides else 1.0
        dashpot = 0.0 if slides else viscous[c]
        sx[c] *= share
        sy[c] *= share
        sz[c] *= share
        fx[c] = -k_t[c] * sx[c] - dashpot * vx[c]
        fy[c] = -k_t[c] * sy[c] - dashpot * vy[c]
        fz[c] = -k_t[c] * sz[c] - dashpot * vz[c]


@njit(**_OPTIONS)
def lever(work, n):
    """B = n x tangential force, then the whole force."""
    bx, ny, fz, nz, fy, by = work[BX], work[NY], work[FZ], work[NZ], work[FY], work[BY]
    fx, nx, bz, force = work[FX], work[NX], work[BZ], work[FORCE]
    for c in range(n):
        bx[c] = ny[c] * fz[c] - nz[c] * fy[c]
        by[c] = nz[c] * fx[c] - nx[c] * fz[c]
        bz[c] = nx[c] * fy[c] - ny[c] * fx[c]
    for c in range(n):
        fx[c] += force[c] * nx[c]
        fy[c] += force[c] * ny[c]
        fz[c] += force[c] * nz[c]


@njit(**_OPTIONS)
def roll_rate(work, n):
    """R holds the difference of the spins, without torsion about the normal."""
    ix, jx, iy, jy, iz, jz = work[IX], work[JX], work[IY], work[JY], work[IZ], work[JZ]
    nx, ny, nz, rx, ry, rz = work[NX], work[NY], work[NZ], work[RX], work[RY], work[RZ]
    for c in range(n):
        qx, qy, qz = ix[c] - jx[c], iy[c] - jy[c], iz[c] - jz[c]
        turn = qx * nx[c] + qy * ny[c] + qz * nz[c]
        rx[c], ry[c], rz[c] = qx - turn * nx[c], qy - turn * ny[c], qz - turn * nz[c]


@njit(**_OPTIONS)
def constant_torque(work, n):
    """A torque of constant size against the rolling."""
    roll_rate(work, n)
    rx, ry, rz, mu_r, force, r_eff = work[RX], work[RY], work[RZ], work[LAW_ROLLING], work[FORCE], work[R_EFF]
    for c in range(n):
        rate = math.sqrt(rx[c] * rx[c] + ry[c] * ry[c] + rz[c] * rz[c])
        size = mu_r[c] * abs(force[c]) * r_eff[c] / rate if rate > 0.0 else 0.0
        rx[c] *= size
        ry[c] *= size
        rz[c] *= size


@njit(**_OPTIONS)
def rolling_spring(work, n, dt, dashpot):
    """EPSD: a spring that yields, with a dashpot until then; or the modified one, without."""
    roll_rate(work, n)
    mu_r, force, r_eff, k_n, k_t, tx = work[LAW_ROLLING], work[FORCE], work[R_EFF], work[K_N], work[K_T], work[TX]
    rx, ty, ry, tz, rz, roll_damping = work[RX], work[TY], work[RY], work[TZ], work[RZ], work[LAW_ROLLING_DAMPING]
    inertia = work[INERTIA]
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
