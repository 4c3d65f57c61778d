"""Compiled parts of the two-fluid solver: flat arrays with rims, any number of axes.

All arrays of a grid have one padded shape and are passed flat; a neighbour along an axis is a
stride away. Values of faces stand at the cell above the face. Loops run over rims too: what they
leave there is filled again afterwards. A face velocity of axis ``a`` has a control volume of its
own, whose lower face along ``b`` lies half way between the cell faces ``n`` and ``n - sa`` of
axis ``b``; a stride ``sa`` of 0 is a cell.
"""

import numpy as np

from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def carried(q, velocity, sa, sb, courant, out):
    """Velocity times the value that it carries through faces (van Leer, second order in time)."""
    o = max(2 * sb, sa)
    n = q.size - o - sb
    far, low, high, beyond = q[o - 2 * sb :], q[o - sb :], q[o:], q[o + sb :]
    here, there, to = velocity[o:], velocity[o - sa :], out[o:]
    for i in range(n):
        w = 0.5 * (here[i] + there[i])
        forth = w > 0.0
        d = high[i] - low[i]
        a = low[i] - far[i] if forth else beyond[i] - high[i]
        product = a * d
        slope = 2.0 * product / (a + d) if product > 0.0 else 0.0
        half = 0.5 - 0.5 * courant * abs(w)
        to[i] = w * (low[i] + half * slope if forth else high[i] - half * slope)


@njit(**_OPTIONS)
def carried_by(q, flux, velocity, sa, sb, courant, out):
    """The same with a flux that is given; the velocity is for the order in time only."""
    o = max(2 * sb, sa)
    n = q.size - o - sb
    far, low, high, beyond = q[o - 2 * sb :], q[o - sb :], q[o:], q[o + sb :]
    here, there, to = flux[o:], flux[o - sa :], out[o:]
    fast, slow = velocity[o:], velocity[o - sa :]
    for i in range(n):
        w = 0.5 * (here[i] + there[i])
        forth = w > 0.0
        d = high[i] - low[i]
        a = low[i] - far[i] if forth else beyond[i] - high[i]
        product = a * d
        slope = 2.0 * product / (a + d) if product > 0.0 else 0.0
        half = 0.5 - 0.25 * courant * abs(fast[i] + slow[i])
        to[i] = w * (low[i] + half * slope if forth else high[i] - half * slope)


@njit(**_OPTIONS)
def gather(flux, s, scale, first, out):
    """Net flux out along one axis times ``scale``, onto ``out`` or into it."""
    n = flux.size - s
    above = flux[s:]
    if first:
        for i in range(n):
            out[i] = scale * (above[i] - flux[i])
    else:
        for i in range(n):
            out[i] += scale * (above[i] - flux[i])


@njit(**_OPTIONS)
def edges(va, vb, sa, sb, ha, hb, out):
    """Rate of shear at the edges below ``n`` along both axes."""
    o = sa + sb
    n = va.size - o
    a0, a1, b0, b1, to = va[o:], va[o - sb :], vb[o:], vb[o - sa :], out[o:]
    for i in range(n):
        to[i] = (a0[i] - a1[i]) / hb + (b0[i] - b1[i]) / ha


@njit(**_OPTIONS)
def stretch(v, s, h, first, dilation, square):
    """Rates of stretching of one axis: their sum, and twice their squares."""
    n = v.size - s
    above = v[s:]
    if first:
        dilation[:] = 0.0
        square[:] = 0.0
    for i in range(n):
        rate = (above[i] - v[i]) / h
        dilation[i] += rate
        square[i] += 2.0 * rate * rate


@njit(**_OPTIONS)
def shear_square(e, sa, sb, square):
    """Squares of the rates of shear: the mean of the four edges of a cell."""
    n = e.size - sa - sb
    e1, e2, e3 = e[sa:], e[sb:], e[sa + sb :]
    for i in range(n):
        square[i] += 0.25 * (e[i] * e[i] + e1[i] * e1[i] + e2[i] * e2[i] + e3[i] * e3[i])


@njit(**_OPTIONS)
def slip(ug, us, s, first, component, square):
    """Slip in the cells along one axis, and the sum of squares."""
    n = ug.size - s
    g1, s1 = ug[s:], us[s:]
    if first:
        square[:] = 0.0
    for i in range(n):
        mean = 0.5 * (ug[i] - us[i] + g1[i] - s1[i])
        component[i] = mean
        square[i] += mean * mean


@njit(**_OPTIONS)
def bounded(total, most):
    """Add up to a bound, in place."""
    for i in range(total.size):
        total[i] = min(total[i], most)


@njit(**_OPTIONS)
def normal_stress(v, dilation, phi, shear, second, pressure, s, h, flux):
    """Momentum flux per density through the faces of a control volume across its own axis.

    ``shear`` and ``second`` are kinematic; the face below ``n`` lies in the cell ``n - s``.
    """
    n = v.size - s
    above, to = v[s:], flux[s:]
    for i in range(n):
        rate = (above[i] - v[i]) / h
        to[i] += pressure[i] - phi[i] * (2.0 * shear[i] * rate + second[i] * dilation[i])


@njit(**_OPTIONS)
def shear_stress(e, phi, shear, sa, sb, stress):
    """Stress per density at the edges; harmonic means, so that dilute faces are not overpulled."""
    o = sa + sb
    n = e.size - o
    p0, p1, p2, p3 = phi[o:], phi[o - sa :], phi[o - sb :], phi[: phi.size - o]
    m0, m1, m2, m3 = shear[o:], shear[o - sa :], shear[o - sb :], shear[: shear.size - o]
    rate, to = e[o:], stress[o:]
    for i in range(n):
        f0, f1 = p0[i] + p1[i], p2[i] + p3[i]
        g0, g1 = p0[i] + p2[i], p1[i] + p3[i]
        total = f0 + f1 + 1e-300
        content = min(f0 * f1, g0 * g1) / total
        to[i] = 0.25 * (m0[i] + m1[i] + m2[i] + m3[i]) * content * rate[i]


@njit(**_OPTIONS)
def take(stress, flux):
    """Subtract."""
    for i in range(flux.size):
        flux[i] -= stress[i]


@njit(**_OPTIONS)
def predict(
    s, dt, density, gas_density, acceleration, gas_acceleration, tiny,
    phi0, phi1, gamma, us, ug, outs, outg, hats, hatg, give_s, give_g, volume, mobility,
):  # fmt: skip
    """Velocities of both phases but for the pressure, and how they yield to its gradient.

    ``outs`` and ``outg`` are momentum per density that leaves in the step. Both phases are solved
    together: per mass, (A + bg) u - bg v = A u* - G, (B + bs) v - bs u = B v* - G.
    """
    n = phi0.size - s
    pl, ph, ql, qh, cl, ch = phi0, phi0[s:], phi1, phi1[s:], gamma, gamma[s:]
    us, ug, outs, outg = us[s:], ug[s:], outs[s:], outg[s:]
    hats, hatg, give_s, give_g = hats[s:], hatg[s:], give_s[s:], give_g[s:]
    volume, mobility = volume[s:], mobility[s:]
    a, b = gas_density / dt, density / dt
    for i in range(n):
        old, new = 0.5 * (pl[i] + ph[i]), 0.5 * (ql[i] + qh[i])
        void = 1.0 - new
        drag = 0.5 * (cl[i] + ch[i])
        v = us[i] - (outs[i] + (new - old) * us[i]) / max(new, tiny) + dt * acceleration
        u = ug[i] - (outg[i] - (new - old) * ug[i]) / void + dt * gas_acceleration
        bg, bs = drag * new, drag * void
        inverse = 1.0 / (a * b + a * bs + b * bg)
        top, low = a * u, b * v
        hat_g = ((b + bs) * top + bg * low) * inverse
        hat_s = (bs * top + (a + bg) * low) * inverse
        hatg[i] = hat_g
        hats[i] = hat_s
        give_g[i] = (b + drag) * inverse
        give_s[i] = (a + drag) * inverse
        volume[i] = void * hat_g + new * hat_s
        mobility[i] = (void * b + new * a + drag) * inverse


@njit(**_OPTIONS)
def yielded(p, s, h, phi, hats, hatg, give_s, give_g, us, ug, volume):
    """Velocities after the pressure, and the flux of both phases."""
    n = p.size - s
    high, ph = p[s:], phi[s:]
    hats, hatg, give_s, give_g = hats[s:], hatg[s:], give_s[s:], give_g[s:]
    us, ug, volume = us[s:], ug[s:], volume[s:]
    for i in range(n):
        gradient = (high[i] - p[i]) / h
        u = hatg[i] - give_g[i] * gradient
        v = hats[i] - give_s[i] * gradient
        ug[i] = u
        us[i] = v
        solid = 0.5 * (phi[i] + ph[i])
        volume[i] = (1.0 - solid) * u + solid * v


@njit(**_OPTIONS)
def yielding(gamma, phi, s, dt, density, out):
    """How far a solids pressure moves the solids in a step, on the faces: dt / (rho + dt bs)."""
    n = gamma.size - s
    gh, ph, to = gamma[s:], phi[s:], out[s:]
    for i in range(n):
        bs = 0.5 * (gamma[i] + gh[i]) * (1.0 - 0.5 * (phi[i] + ph[i]))
        to[i] = dt / (density + dt * bs)


@njit(**_OPTIONS)
def around(face, s, scale, first, total):
    """Sum of the two faces of each cell times ``scale``."""
    n = face.size - s
    above = face[s:]
    if first:
        total[:] = 0.0
    for i in range(n):
        total[i] += scale * (face[i] + above[i])


@njit(**_OPTIONS)
def neighbours(face, x, s, scale, first, total):
    """Sum of face times the value beyond it times ``scale``."""
    n = x.size - 2 * s
    low, high, x_low, x_high, to = face[s:], face[2 * s :], x, x[2 * s :], total[s:]
    if first:
        total[:] = 0.0
    for i in range(n):
        to[i] += scale * (low[i] * x_low[i] + high[i] * x_high[i])


@njit(**_OPTIONS)
def relax(slope, excess, total, nearby, omega, old):
    """A Chebyshev step of x (1 + slope total) = slope (excess + nearby), into ``old``."""
    for i in range(old.size):
        fresh = slope[i] * (excess[i] + nearby[i]) / (1.0 + slope[i] * total[i])
        old[i] += omega * (fresh - old[i])


@njit(**_OPTIONS)
def push(face, x, s, h, flux):
    """Add the flux that a pressure drives."""
    n = x.size - s
    high, k, to = x[s:], face[s:], flux[s:]
    for i in range(n):
        to[i] -= k[i] * (high[i] - x[i]) / h


@njit(**_OPTIONS)
def leaving(flux, s, scale, first, out, come):
    """What leaves and what enters each cell through the faces of one axis."""
    n = flux.size - s
    above = flux[s:]
    if first:
        out[:] = 0.0
        come[:] = 0.0
    for i in range(n):
        out[i] += scale * (max(above[i], 0.0) - min(flux[i], 0.0))
        come[i] += scale * (max(flux[i], 0.0) - min(above[i], 0.0))


@njit(**_OPTIONS)
def shares(have, need, out):
    """Share of what is needed that is there."""
    for i in range(out.size):
        out[i] = min(1.0, max(have[i], 0.0) / need[i]) if need[i] > 0.0 else 1.0


@njit(**_OPTIONS)
def by_donor(flux, share, s):
    """Faces let through that share of the cell that gives."""
    n = flux.size - s
    high, to = share[s:], flux[s:]
    for i in range(n):
        to[i] *= share[i] if to[i] > 0.0 else high[i]


@njit(**_OPTIONS)
def by_receiver(flux, share, s, out):
    """Faces let through that share of the cell that takes."""
    n = flux.size - s
    high, given, to = share[s:], flux[s:], out[s:]
    for i in range(n):
        to[i] = given[i] * (high[i] if given[i] > 0.0 else share[i])


@njit(**_OPTIONS)
def fastest(v, s, scale, first, out):
    """Largest speed of the two faces of each cell times ``scale``, summed over axes."""
    n = v.size - s
    above = v[s:]
    if first:
        out[:] = 0.0
    for i in range(n):
        out[i] += scale * max(abs(v[i]), abs(above[i]))


@njit(**_OPTIONS)
def largest(box):
    """Largest number of a box of any strides; nan if there is one."""
    most = -np.inf
    for k in range(box.shape[0]):
        for j in range(box.shape[1]):
            for i in range(box.shape[2]):
                if not box[k, j, i] <= most:
                    most = box[k, j, i]
                    if most != most:
                        return most
    return most


@njit(**_OPTIONS)
def greatest(box):
    """Largest magnitude of a box of any strides."""
    most = 0.0
    for k in range(box.shape[0]):
        for j in range(box.shape[1]):
            for i in range(box.shape[2]):
                most = max(most, abs(box[k, j, i]))
    return most
