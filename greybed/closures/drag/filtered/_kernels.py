"""Compiled filtered drag of a network with one layer: what features, closure and force compute."""

import math

import numpy as np

from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def _bend(x, bound):
    y = x / bound
    root = math.sqrt(1.0 + y * y)
    return x / root, 1.0 / (root * root * root)


@njit(**_OPTIONS)
def _log_positive(q, small):
    root = math.sqrt(q * q + small * small)
    size = root + abs(q)
    part = 0.5 * size if q >= 0.0 else 0.5 * small * small / size
    return math.log(part), 1.0 / root


@njit(**_OPTIONS)
def network_drag(
    phi, slip, fall, law, steep, size, parcels, up, numbers, gate, small, bounds, marked, linear,
    mean, scale, w0, b0, w1, b1, low, high, centre, precision, limit2, force, secant, diagonal,
    outside,
):  # fmt: skip
    """Force, drag over slip and diagonal of the derivative, each (n, 3), along x, y and z.

    ``numbers``: u_t, weight, terminal drag, log of the terminal Re, 18 mu / d^2; ``size``: of the
    filter over L_c; ``small`` and ``bounds`` as in features, closure and force.
    """
    u_t, weight, terminal, log_re, stokes = numbers
    dilute, small_filter, small_across, slip2, small_phi, ratio, slip_bend, gradient_bend = small
    log_bound, share_bound, rate, fade = bounds
    a, phi0, packing, power = gate
    n_features, n_hidden = w0.shape
    values = w1.shape[1] - 1
    f = np.zeros(n_features)
    hidden, slope = np.zeros(n_hidden), np.zeros(n_hidden)
    raw = np.zeros(values)
    back = np.zeros((3, 4))
    s, lateral, pull = np.zeros(3), np.zeros(3), np.zeros(3)
    kept, work_of = np.zeros(3), np.zeros(3)
    change = np.zeros((3, 3))
    jacobian = np.zeros((3, 3))
    size2 = size * size
    open_size = size2 / (size2 + a * a)
    for i in range(phi.size):
        p, s_up, speed2 = phi[i], 0.0, 0.0
        for j in range(3):
            s[j] = slip[i, j]
            s_up += s[j] * up[j]
            speed2 += s[j] * s[j]
        across2, work, fall_up = 0.0, 0.0, 0.0
        for j in range(3):
            lateral[j] = s[j] - s_up * up[j]
            across2 += lateral[j] * lateral[j]
            if marked or linear:
                fall_up += fall[i, j] * up[j]
                work += fall[i, j] * lateral[j]
        x, c2 = s_up / u_t, across2 / (u_t * u_t)
        f[0], f[1], f[2], f[3] = p, math.log(p + dilute), math.log(size + small_filter), log_re
        f[4], of_up = _bend(x, slip_bend)
        f[5] = math.log(c2 + small_across)
        of_across = 1.0 / (c2 + small_across)
        drag_ratio = law[i] / terminal
        up_slip = up_ratio = across_slip = across_work = across_ratio = 0.0
        if marked:
            g_up, g_work = fall_up / weight, work / (weight * u_t)
            base = (p + small_phi) * drag_ratio
            up2, wide = x * x + slip2, c2 + slip2
            q_up, q_across = g_up * x / (base * up2), g_work / (base * wide)
            f[6], of_q_up = _log_positive(q_up, ratio)
            f[7], of_q_across = _log_positive(q_across, ratio)
            f[8], _ = _bend(g_up, gradient_bend)
            up_slip = of_q_up * g_up * (slip2 - x * x) / (base * up2 * up2)
            up_ratio = -of_q_up * q_up / drag_ratio
            across_slip = -of_q_across * q_across / wide
            across_work = of_q_across / (base * wide)
            across_ratio = -of_q_across * q_across / drag_ratio
        relative = p / packing
        whole = relative
        for _ in range(int(power) - 1):
            whole *= relative
        dense = max(0.0, 1.0 - whole)
        gate_ = open_size * (p / (p + phi0)) * (dense * dense)

        away2, box = 0.0, False
        for k in range(n_features):
            box = box or f[k] < low[k] or f[k] > high[k]
            row = 0.0
            for j in range(n_features):
                row += precision[k, j] * (f[j] - centre[j])
            away2 += row * (f[k] - centre[k])
        outside[i] = gate_ > 0.0 and (box or away2 > limit2)

        for j in range(n_hidden):
            hidden[j] = b0[j]
        for k in range(n_features):
            scaled = (f[k] - mean[k]) / scale[k]
            for j in range(n_hidden):
                hidden[j] += scaled * w0[k, j]
        for j in range(n_hidden):
            inverse = 1.0 / math.sqrt(1.0 + hidden[j] * hidden[j])
            hidden[j] *= inverse
            slope[j] = inverse * inverse * inverse
        for v in range(values):
            raw[v] = b1[v]
            for j in range(n_hidden):
                raw[v] += hidden[j] * w1[j, v]
            for k in range(4, min(n_features, 8)):
                total = 0.0
                for j in range(n_hidden):
                    total += w1[j, v] * slope[j] * w0[k, j]
                back[v, k - 4] = total / scale[k]
        log_up, bent_up = _bend(raw[0], log_bound)
        log_across, bent_across = _bend(raw[1], log_bound)
        less = rate * (parcels - 1.0)
        h_up, h_across = math.exp(gate_ * (log_up - less)), math.exp(gate_ * (log_across - less))
        share0, of_share0 = 0.0, 0.0
        if linear:
            part = 1.0 / (1.0 + math.exp(-raw[2]))
            share0 = gate_ * share_bound * part
            of_share0 = share0 * (1.0 - part)

        steepness = steep[i] / (law[i] * max(speed2, 1e-300))
        of_ratio = drag_ratio * steepness
        for v in range(values):
            outer = gate_ * bent_up if v == 0 else (gate_ * bent_across if v == 1 else of_share0)
            d_up = outer * (back[v, 0] * of_up + back[v, 2] * up_slip)
            d_across = outer * (back[v, 1] * of_across + back[v, 3] * across_slip)
            d_work = outer * back[v, 3] * across_work
            d_ratio = outer * (back[v, 2] * up_ratio + back[v, 3] * across_ratio)
            for j in range(3):
                change[v, j] = d_up * up[j] / u_t + d_across * 2.0 * lateral[j] / (u_t * u_t)
                change[v, j] += d_ratio * of_ratio * s[j]
                if marked:
                    change[v, j] += d_work * (fall[i, j] - fall_up * up[j]) / (weight * u_t)
        beta = stokes * (1.0 - p) * p * law[i]
        b_up, b_across = beta * h_up, beta * h_across
        done, against, pull2 = 0.0, 0.0, 0.0
        for j in range(3):
            kept[j] = b_up * s_up * up[j] + b_across * lateral[j]
            done += kept[j] * s[j]
            for k in range(3):
                both = up[k] * up[j]
                along = steepness * s[j] + change[0, j]
                beside = steepness * s[j] + change[1, j]
                jacobian[k, j] = b_up * (both + s_up * up[k] * along) + b_across * (
                    (1.0 if k == j else 0.0) - both + lateral[k] * beside
                )
            if linear:
                pull[j] = (1.0 - p) * fall[i, j]
                against += pull[j] * s[j]
                pull2 += pull[j] * pull[j]
        share = 0.0
        if linear:
            square = (fade * u_t) ** 2 * pull2
            root = math.sqrt(against * against + square)
            total = root + abs(against) if root > 0.0 else 1.0
            opposed = 0.5 * total if against < 0.0 else 0.5 * square / total
            below = done + share0 * opposed
            safe = below if below > 0.0 else 1.0
            share = share0 * done / safe
            of_n = 0.5 * (against / (root if root > 0.0 else 1.0) - 1.0)
            for j in range(3):
                of_work = kept[j]
                for k in range(3):
                    of_work += jacobian[k, j] * s[k]
                work_of[j] = (done / safe) ** 2 * change[2, j] + (share0 / safe) ** 2 * (
                    opposed * of_work - done * of_n * pull[j]
                )
        for j in range(3):
            upward = up[j] * up[j]
            secant[i, j] = (1.0 - share) * (b_up * upward + b_across * (1.0 - upward))
            diagonal[i, j] = (1.0 - share) * jacobian[j, j] + (pull[j] - kept[j]) * work_of[j]
            force[i, j] = (1.0 - share) * kept[j] + share * pull[j]
