"""Compiled parts of transport: bounded convection, stresses, divergence; arrays [z, y, x].

A control volume is a cell, or a cell shifted by half along one axis. ``q`` holds its values with
two more on every side; fluxes through control faces hold one more along their own axis. An axis
whose ``c`` (one over the spacing) is 0 has no extent.
"""

from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(inline="always", **_OPTIONS)
def _between(flux, a, b, c, d):
    """Value between b and c: upwind plus van Leer's half slope (J. Comput. Phys. 14 (1974) 361)."""
    forward = flux >= 0.0
    own = b if forward else c
    up = b - a if forward else c - d
    down = c - b if forward else b - c
    both = up * down
    return own + (both / (up + down) if both > 0.0 else 0.0)


@njit(**_OPTIONS)
def convect(q, fx, fy, fz, cx, cy, cz, out):
    """Minus div(F q) + q div F: exactly 0 where q is uniform."""
    nz, ny, nx = out.shape
    for k in range(nz):
        for j in range(ny):
            for i in range(nx):
                out[k, j, i] = 0.0
            if cx > 0.0:
                row = q[k + 2, j + 2]
                for i in range(nx):
                    a, b, c = row[i], row[i + 1], row[i + 2]
                    d, e = row[i + 3], row[i + 4]
                    west, east = fx[k, j, i], fx[k, j, i + 1]
                    out[k, j, i] += cx * (
                        west * (_between(west, a, b, c, d) - c)
                        - east * (_between(east, b, c, d, e) - c)
                    )
            if cy > 0.0:
                for i in range(nx):
                    a, b, c = q[k + 2, j, i + 2], q[k + 2, j + 1, i + 2], q[k + 2, j + 2, i + 2]
                    d, e = q[k + 2, j + 3, i + 2], q[k + 2, j + 4, i + 2]
                    west, east = fy[k, j, i], fy[k, j + 1, i]
                    out[k, j, i] += cy * (
                        west * (_between(west, a, b, c, d) - c)
                        - east * (_between(east, b, c, d, e) - c)
                    )
            if cz > 0.0:
                for i in range(nx):
                    a, b, c = q[k, j + 2, i + 2], q[k + 1, j + 2, i + 2], q[k + 2, j + 2, i + 2]
                    d, e = q[k + 3, j + 2, i + 2], q[k + 4, j + 2, i + 2]
                    west, east = fz[k, j, i], fz[k + 1, j, i]
                    out[k, j, i] += cz * (
                        west * (_between(west, a, b, c, d) - c)
                        - east * (_between(east, b, c, d, e) - c)
                    )


@njit(**_OPTIONS)
def divergence(fx, fy, fz, cx, cy, cz, factor, out):
    """Add factor times the divergence of fluxes through control faces."""
    nz, ny, nx = out.shape
    ax, ay, az = factor * cx, factor * cy, factor * cz
    for k in range(nz):
        for j in range(ny):
            for i in range(nx):
                out[k, j, i] += (
                    ax * (fx[k, j, i + 1] - fx[k, j, i])
                    + ay * (fy[k, j + 1, i] - fy[k, j, i])
                    + az * (fz[k + 1, j, i] - fz[k, j, i])
                )


@njit(**_OPTIONS)
def normal_stresses(u, v, w, m, cx, cy, cz, xx, yy, zz):
    """2 m (du/dx - div/3) of cells, one beyond each end of its axis; m is viscosity, padded."""
    third = 1.0 / 3.0
    nz, ny, nx = xx.shape
    for k in range(nz):
        for j in range(ny):
            for i in range(nx):
                du = cx * (u[k + 2, j + 2, i + 2] - u[k + 2, j + 2, i + 1])
                dv = cy * (v[k + 2, j + 3, i + 1] - v[k + 2, j + 2, i + 1])
                dw = cz * (w[k + 3, j + 2, i + 1] - w[k + 2, j + 2, i + 1])
                xx[k, j, i] = 2.0 * m[k + 2, j + 2, i + 1] * (du - third * (du + dv + dw))
    nz, ny, nx = yy.shape
    for k in range(nz):
        for j in range(ny):
            for i in range(nx):
                du = cx * (u[k + 2, j + 1, i + 3] - u[k + 2, j + 1, i + 2])
                dv = cy * (v[k + 2, j + 2, i + 2] - v[k + 2, j + 1, i + 2])
                dw = cz * (w[k + 3, j + 1, i + 2] - w[k + 2, j + 1, i + 2])
                yy[k, j, i] = 2.0 * m[k + 2, j + 1, i + 2] * (dv - third * (du + dv + dw))
    nz, ny, nx = zz.shape
    for k in range(nz):
        for j in range(ny):
            for i in range(nx):
                du = cx * (u[k + 1, j + 2, i + 3] - u[k + 1, j + 2, i + 2])
                dv = cy * (v[k + 1, j + 3, i + 2] - v[k + 1, j + 2, i + 2])
                dw = cz * (w[k + 2, j + 2, i + 2] - w[k + 1, j + 2, i + 2])
                zz[k, j, i] = 2.0 * m[k + 1, j + 2, i + 2] * (dw - third * (du + dv + dw))


@njit(**_OPTIONS)
def shear_stresses(u, v, w, m, cx, cy, cz, xy, xz, yz):
    """m (du/dy + dv/dx) and so on, on the edges of cells."""
    nz, ny, nx = xy.shape
    for k in range(nz):
        for j in range(ny):
            for i in range(nx):
                mean = 0.25 * (
                    m[k + 2, j + 1, i + 1] + m[k + 2, j + 1, i + 2]
                    + m[k + 2, j + 2, i + 1] + m[k + 2, j + 2, i + 2]
                )  # fmt: skip
                xy[k, j, i] = mean * (
                    cy * (u[k + 2, j + 2, i + 2] - u[k + 2, j + 1, i + 2])
                    + cx * (v[k + 2, j + 2, i + 2] - v[k + 2, j + 2, i + 1])
                )
    nz, ny, nx = xz.shape
    for k in range(nz):
        for j in range(ny):
            for i in range(nx):
                mean = 0.25 * (
                    m[k + 1, j + 2, i + 1] + m[k + 1, j + 2, i + 2]
                    + m[k + 2, j + 2, i + 1] + m[k + 2, j + 2, i + 2]
                )  # fmt: skip
                xz[k, j, i] = mean * (
                    cz * (u[k + 2, j + 2, i + 2] - u[k + 1, j + 2, i + 2])
                    + cx * (w[k + 2, j + 2, i + 2] - w[k + 2, j + 2, i + 1])
                )
    nz, ny, nx = yz.shape
    for k in range(nz):
        for j in range(ny):
            for i in range(nx):
                mean = 0.25 * (
                    m[k + 1, j + 1, i + 2] + m[k + 1, j + 2, i + 2]
                    + m[k + 2, j + 1, i + 2] + m[k + 2, j + 2, i + 2]
                )  # fmt: skip
                yz[k, j, i] = mean * (
                    cz * (v[k + 2, j + 2, i + 2] - v[k + 1, j + 2, i + 2])
                    + cy * (w[k + 2, j + 2, i + 2] - w[k + 2, j + 1, i + 2])
                )


@njit(**_OPTIONS)
def conduction(t, m, cx, cy, cz, fx, fy, fz):
    """Minus m dT/dx on faces: heat fluxes; t and m padded by two."""
    nz, ny, nx = fx.shape
    for k in range(nz):
        for j in range(ny):
            for i in range(nx):
                mean = 0.5 * (m[k + 2, j + 2, i + 1] + m[k + 2, j + 2, i + 2])
                fx[k, j, i] = -cx * mean * (t[k + 2, j + 2, i + 2] - t[k + 2, j + 2, i + 1])
    nz, ny, nx = fy.shape
    for k in range(nz):
        for j in range(ny):
            for i in range(nx):
                mean = 0.5 * (m[k + 2, j + 1, i + 2] + m[k + 2, j + 2, i + 2])
                fy[k, j, i] = -cy * mean * (t[k + 2, j + 2, i + 2] - t[k + 2, j + 1, i + 2])
    nz, ny, nx = fz.shape
    for k in range(nz):
        for j in range(ny):
            for i in range(nx):
                mean = 0.5 * (m[k + 1, j + 2, i + 2] + m[k + 2, j + 2, i + 2])
                fz[k, j, i] = -cz * mean * (t[k + 2, j + 2, i + 2] - t[k + 1, j + 2, i + 2])
