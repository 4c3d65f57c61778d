"""Standard drag coefficients of spheres and of disks across the flow, and what may be added."""

import numpy as np


def sphere(columns, parameters, amplitudes):
    """Clift and Gauvin (1970): C_D of a smooth sphere in steady flow, Re below 3e5 [-]."""
    re = columns["reynolds"]
    drag = 24.0 / re * (1.0 + 0.15 * re**0.687) + 0.42 / (1.0 + 42500.0 * re**-1.16)
    return _with(drag, re, columns, amplitudes)


def disk(columns, parameters, amplitudes):
    """Clift, Grace and Weber (1978), chapter 6: C_D of a thin disk, face on [-].

    64 (1 + 0.138 Re^0.792) / (pi Re) to Re = 133 and 1.17 beyond 1000. In between, where the wake
    begins to swing, they give no law: not a number there, and the rows are left out.
    """
    re = columns["reynolds"]
    low = 64.0 / (np.pi * re) * (1.0 + 0.138 * re**0.792)
    drag = np.where(re <= 133.0, low, np.where(re > 1000.0, 1.17, np.nan))
    return _with(drag, re, columns, amplitudes)


def _with(drag, re, columns, amplitudes):
    """Effects that an experiment in a tow tank could show."""
    if amplitudes.get("blockage"):
        drag = drag * (1.0 + amplitudes["blockage"] * columns["blockage_ratio"])
    if amplitudes.get("turbulence"):
        drag = drag * (1.0 + amplitudes["turbulence"] * columns["turbulence_intensity"])
    if amplitudes.get("surface-waves"):  # a tow close below a free surface loses energy to waves
        drag = drag * (1.0 + amplitudes["surface-waves"] * columns["depth_ratio"])
    return drag
