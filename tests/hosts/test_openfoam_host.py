"""Force and drag model in OpenFOAM: tutorial cases run, and move as with OpenFOAM's own law."""

import re
import shutil

import numpy as np
import pytest

from greybed.core.errors import InputError
from greybed.hosts import host_model, openfoam
from greybed.hosts.openfoam_source import area, missing_openfoam, tree_of

MODEL = "shipped:filtered_drag_mlp_plain"


@pytest.fixture(scope="module")
def adapter(tmp_path_factory):
    """Closure on the law of OpenFOAM's tutorials, built once."""
    if reason := missing_openfoam(tutorials=True):
        pytest.skip(f"OpenFOAM: needs {reason}")
    if tree_of(area()) is None:
        pytest.skip("no source tree of OpenFOAM; greybed host openfoam MODEL --build fetches it")
    folder = tmp_path_factory.mktemp("openfoam")
    openfoam.generate(host_model(MODEL, law="gidaspow"), folder)
    openfoam.build(folder)
    return folder


def end_of(case, field):
    """A field of a case that has ended, shape (cells or parcels, 3)."""
    last = max((p for p in case.iterdir() if re.fullmatch(r"[0-9.e-]+", p.name)), key=_time)
    text = (last / field).read_text()
    rows = re.findall(r"\(([-0-9.e+]+) ([-0-9.e+]+) ([-0-9.e+]+)\)", text)
    return np.array(rows, dtype=float)


def _time(path):
    return float(path.name)


def ran(solver, case, library, *, own=False, steps=3, text=(), **entries):
    openfoam.lay_out(solver, case, steps, own=own, **entries)
    control = case / "system" / "controlDict"
    words = control.read_text().replace("binary", "ascii")
    words = re.sub(r"writeControl\s+\w+;", "writeControl timeStep;", words)
    words = re.sub(r"writeInterval\s+[^;]+;", f"writeInterval {steps};", words)
    words = re.sub(r"writePrecision\s+\d+;", "writePrecision 14;", words)
    control.write_text(words)
    for file, old, new in text:
        path = case / file
        assert old in path.read_text()
        path.write_text(path.read_text().replace(old, new))
    openfoam.run_case(solver, case, library)
    return (case / "log").read_text()


def counts(log):
    found = re.search(r"([0-9.e+]+) evaluations, ([0-9.e+]+) outside the training data", log)
    return float(found[1]), float(found[2])


def test_parcels_move_as_with_openfoams_own_law_where_the_closure_is_outside(adapter, tmp_path):
    library = adapter / openfoam.LIBRARIES
    log = ran("DPMFoam", tmp_path / "ours", library)
    ran("DPMFoam", tmp_path / "theirs", library, own=True)
    evaluated, outside = counts(log)
    # Spheres of 2.5 mm are far from the closure's training data; the first step has no solids yet.
    assert evaluated > 10 * 24750
    assert outside > 4 * 24750
    ours = end_of(tmp_path / "ours", "lagrangian/kinematicCloud/U")
    theirs = end_of(tmp_path / "theirs", "lagrangian/kinematicCloud/U")
    assert ours.shape == theirs.shape == (24750, 3)
    assert np.abs(theirs).max() > 1e-4
    # Gidaspow's law is the same as ErgunWenYu but for rounding, and the pressure solver's residual.
    assert np.abs(ours - theirs).max() < 1e-7 * np.abs(theirs).max()


def test_mppicfoam_runs_with_the_closure(adapter, tmp_path):
    log = ran("MPPICFoam", tmp_path / "case", adapter / openfoam.LIBRARIES)
    assert "Selecting particle force greybedDrag" in log
    assert counts(log)[0] > 0.0


@pytest.mark.skipif(shutil.which("mpirun") is None, reason="mpirun is not installed")
def test_two_ranks_count_what_both_have_done(adapter, tmp_path):
    library = adapter / openfoam.LIBRARIES
    openfoam.lay_out("twoPhaseEulerFoam", tmp_path / "case", 1)
    openfoam.run_case("twoPhaseEulerFoam", tmp_path / "case", library, ranks=2)
    both = counts((tmp_path / "case" / "log").read_text())
    one = counts(ran("twoPhaseEulerFoam", tmp_path / "one", library, steps=1))
    assert both[0] == one[0]
    # The pressure solver's residual may move a cell over the edge of the training data.
    assert both[1] == pytest.approx(one[1], abs=20)


def test_two_fluids_use_the_closure_where_it_was_trained(adapter, tmp_path):
    library = adapter / openfoam.LIBRARIES
    # Fine powder, fluidised: a packed bed shuts the gate, and coarse grains are outside.
    fine = [
        ("constant/phaseProperties", "3e-4", "7.5e-5"),
        ("0/alpha.particles", "0.55", "0.3"),
    ]
    kept = ran("twoPhaseEulerFoam", tmp_path / "kept", library, steps=1, text=fine)
    ran("twoPhaseEulerFoam", tmp_path / "law", library, steps=1, text=fine, own=True)
    evaluated, outside = counts(kept)
    assert 0.0 < outside < 0.5 * evaluated
    slips = []
    for name in ("kept", "law"):
        gas, solids = (end_of(tmp_path / name, f"U.{phase}") for phase in ("air", "particles"))
        # The lower half of the cells holds the bed; sides follow the cells in the file.
        slips.append(np.abs((gas[:3000] - solids[:3000])[:, 1]).mean())
    # Less of the drag is kept but where the law stays, so gas passes the particles faster.
    assert slips[0] > 1.1 * slips[1]


def test_models_of_radiation_are_refused(tmp_path):
    with pytest.raises(InputError, match="models of drag only"):
        openfoam.generate(host_model("law:exact"), tmp_path)
