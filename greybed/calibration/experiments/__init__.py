"""Virtual experiments by the word that studies name them with."""

from greybed.calibration.experiments.drum import Drum
from greybed.calibration.experiments.flows import Drop, Hopper
from greybed.calibration.experiments.heaps import DrawDownBox, Ledge, LiftingCylinder
from greybed.calibration.experiments.listed import (
    CaseTable,
    CommandTable,
    Listed,
    PythonTable,
    TwinTable,
)
from greybed.calibration.experiments.pressed import (
    Compression,
    DirectShear,
    HeatedBox,
    Penetration,
)
from greybed.calibration.experiments.single import InclinedWall, RestitutionDrop

LIBRARY: dict[str, type[Listed]] = {
    kind.kind: kind
    for kind in (
        LiftingCylinder, DrawDownBox, Ledge, Hopper, Drop, Drum, Compression, DirectShear,
        Penetration, HeatedBox, InclinedWall, RestitutionDrop,
    )
}  # fmt: skip
KINDS: dict[str, type[Listed]] = {
    **LIBRARY, "case": CaseTable, "command": CommandTable, "python": PythonTable,
    "twin": TwinTable,
}  # fmt: skip
