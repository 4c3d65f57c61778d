"""Contact laws by name: which of each kind a simulation uses."""

from __future__ import annotations

from dataclasses import dataclass

from greybed.core.errors import InputError
from greybed.dem import _columns

NORMAL = {
    "linear": _columns.LINEAR,
    "hertz": _columns.HERTZ,
    "hysteresis": _columns.HYSTERESIS,
    "viscoelastic": _columns.VISCOELASTIC,
}
ROLLING = {
    "none": _columns.NO_ROLLING,
    "constant-torque": _columns.CONSTANT_TORQUE,
    "epsd": _columns.EPSD,
    "epsd-modified": _columns.EPSD_MODIFIED,
    "viscous": _columns.VISCOUS,
}
COHESION = {
    "none": _columns.NO_COHESION,
    "sjkr": _columns.SJKR,
    "dmt": _columns.DMT,
    "van-der-waals": _columns.VAN_DER_WAALS,
    "jkr": _columns.JKR,
    "liquid-bridge": _columns.LIQUID,
}


@dataclass(frozen=True)
class ContactLaw:
    r"""Laws of a contact, one of each kind.

    Attributes
    ----------
    normal : {"hertz", "linear", "hysteresis", "viscoelastic"}
        ``hertz``: :math:`F = \tfrac43 E^* \sqrt{R^*}\,\delta^{3/2}` with the damping of Tsuji et
        al. 1992 [1]_, tangential stiffness :math:`8 G^* \sqrt{R^*\delta}` (Mindlin's limit
        without slip). ``linear``: spring and dashpot [2]_. ``hysteresis``: loading with k,
        unloading with k / e^2 down to the plastic overlap [3]_. ``viscoelastic``: Hertz with the
        dissipation :math:`2 A E^* \sqrt{R^*\delta}\,\dot\delta` of a viscous material [11]_:
        the faster the impact, the less comes back.
    rolling : {"none", "constant-torque", "epsd", "epsd-modified", "viscous"}
        Constant directional torque :math:`\mu_r R^* F`; elastic-plastic spring and dashpot with
        :math:`k_r = 2.25 k_n (\mu_r R^*)^2`; the same without dashpot and with
        :math:`k_r = k_t R^{*2}` [4]_, [5]_; the torque :math:`\tau F v` of a viscous material that
        rolls with velocity :math:`v = R^* |\omega_i - \omega_j|`, at most F times the radius of
        the contact [12]_.
    cohesion : {"none", "sjkr", "dmt", "van-der-waals", "jkr", "liquid-bridge"}
        Energy density times the disc of the contact; constant pull-off force
        :math:`4\pi\gamma R^*` [6]_; Hamaker's force :math:`A R^*/(6 h^2)` across gaps [7]_; a neck
        that pulls with up to :math:`3\pi\gamma R^*` and holds on a little way beyond the contact
        [8]_ (``hertz`` only); capillary bridges that form at contact, pull with
        :math:`2\pi R\,\sigma\cos\theta/(1 + 1.05 S + 2.5 S^2)`, R twice :math:`R^*`, S the gap
        times :math:`\sqrt{R/V}` [9]_, and break at a gap of :math:`(1 + \theta/2) V^{1/3}` [10]_.
    limit_force : bool
        Cut off the attraction that damping makes at the end of a contact. The damping is then
        another one, such that the restitution stays what was asked for.
    tangential_damping : bool
        Damp the tangential spring with the same share of critical damping.

    References
    ----------
    .. [1] Tsuji, Tanaka & Ishida, Powder Technol. 71 (1992) 239, doi 10.1016/0032-5910(92)88030-L.
    .. [2] Cundall & Strack, Geotechnique 29 (1979) 47, doi 10.1680/geot.1979.29.1.47.
    .. [3] Walton & Braun, J. Rheol. 30 (1986) 949, doi 10.1122/1.549893.
    .. [4] Ai, Chen, Rotter & Ooi, Powder Technol. 206 (2011) 269, doi 10.1016/j.powtec.2010.09.030.
    .. [5] Iwashita & Oda, J. Eng. Mech. 124 (1998) 285,
       doi 10.1061/(ASCE)0733-9399(1998)124:3(285).
    .. [6] Derjaguin, Muller & Toporov, J. Colloid Interface Sci. 53 (1975) 314.
    .. [7] Hamaker, Physica 4 (1937) 1058, doi 10.1016/S0031-8914(37)80203-7.
    .. [8] Johnson, Kendall & Roberts, Proc. R. Soc. A 324 (1971) 301, doi 10.1098/rspa.1971.0141.
    .. [9] Willett, Adams, Johnson & Seville, Langmuir 16 (2000) 9396, doi 10.1021/la000657y.
    .. [10] Lian, Thornton & Adams, J. Colloid Interface Sci. 161 (1993) 138.
    .. [11] Brilliantov, Spahn, Hertzsch & Poeschel, Phys. Rev. E 53 (1996) 5382.
    .. [12] Brilliantov & Poeschel, Europhys. Lett. 42 (1998) 511, doi 10.1209/epl/i1998-00281-7.
    """

    normal: str = "hertz"
    rolling: str = "none"
    cohesion: str = "none"
    limit_force: bool = False
    tangential_damping: bool = True

    def __post_init__(self) -> None:
        for part, known in (("normal", NORMAL), ("rolling", ROLLING), ("cohesion", COHESION)):
            if getattr(self, part) not in known:
                raise InputError(
                    f"{part} = {getattr(self, part)!r} is unknown; give one of {', '.join(known)}."
                )

        if self.cohesion == "jkr" and self.normal != "hertz":
            raise InputError(f"cohesion = 'jkr' needs normal = 'hertz', not {self.normal!r}.")

    @property
    def from_moduli(self) -> bool:
        """Whether stiffness comes from the moduli of the materials, as Hertz has it."""
        return self.normal in ("hertz", "viscoelastic")

    @property
    def columns(self) -> int:
        """Numbers that a contact remembers [-]."""
        if self.normal == "hysteresis":
            return 7
        return 6 if self.rolling.startswith("epsd") else 3
