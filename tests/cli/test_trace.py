"""``greybed trace`` as a process: results, resuming after a kill, Ctrl-C, refusals."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from greybed.cli.main import main
from greybed.cli.trace import parse_walls
from greybed.core import Cone, Cylinder, Disc, InputError, Packing, Plane, Polygon, box_walls
from greybed.core.sizes import Uniform
from greybed.core.writers import write_packing
from greybed.datasets.factors_file import read_factors
from greybed.datasets.generate import random_packing
from greybed.datasets.tracing import STATE
from greybed.raytrace import view_factors

# Six chunks of some tenths of a second: time to kill between them.
SPHERES, RAYS = 48, 500_000
WORDS = ("trace", "bed.h5", "--rays", RAYS, "--seed", 5, "--threads", 1, "--out", "out")


@pytest.fixture(scope="module")
def bed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bed")
    write_packing(random_packing(SPHERES, 0.4, Uniform(1e-3, 2e-3), seed=3), folder / "bed.h5")
    return folder


def command(*words):
    return [sys.executable, "-m", "greybed", *map(str, words)]


def files(out):
    return sorted(out.glob(f"{STATE}/*/[!.]*.npz"))


def stopped(folder, how, chunks=1):
    """Start the run, send it a signal once so many chunks are kept, and wait for its end."""
    process = subprocess.Popen(
        command(*WORDS),
        cwd=folder,
        stderr=subprocess.PIPE,
        text=True,
        # A shell that runs the tests in the background may have turned Ctrl-C off for them.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    end = time.monotonic() + 60
    while len(files(folder / "out")) < chunks and time.monotonic() < end:
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.005)
    process.send_signal(how)
    _, printed = process.communicate(timeout=60)
    return process.returncode, printed


@pytest.fixture(scope="module")
def uninterrupted(bed, tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    words = [*WORDS[:-1], folder / "out"]
    result = subprocess.run(command(*words), cwd=bed, capture_output=True, text=True, check=True)
    assert "tracing rays: 100%" in result.stderr
    assert not (folder / "out" / STATE).exists()
    return folder / "out"


def test_a_killed_run_goes_on_with_the_same_bits(bed, uninterrupted, tmp_path):
    (tmp_path / "bed.h5").write_bytes((bed / "bed.h5").read_bytes())
    code, _ = stopped(tmp_path, signal.SIGKILL, chunks=2)
    assert code == -signal.SIGKILL
    out = tmp_path / "out"
    kept = files(out)
    assert 2 <= len(kept) < 6
    assert not (out / "view_factors.h5").exists()
    kept[0].write_bytes(kept[0].read_bytes()[:1000])  # as after a power cut: traced again
    # Two threads now: no bit depends on them.
    words = [2 if word == 1 else word for word in WORDS]
    again = subprocess.run(
        command(*words), cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert "went on from a stopped run" in again.stdout
    summary = json.loads((out / "summary.json").read_text())
    assert 8 * (len(kept) - 1) == summary["spheres_found_from_stopped_run"]
    assert (out / "view_factors.h5").read_bytes() == (
        uninterrupted / "view_factors.h5"
    ).read_bytes()
    assert not (out / STATE).exists()


@pytest.mark.skipif(os.name == "nt", reason="no SIGINT to another process")
def test_ctrl_c_keeps_what_is_done(bed, uninterrupted, tmp_path):
    (tmp_path / "bed.h5").write_bytes((bed / "bed.h5").read_bytes())
    code, printed = stopped(tmp_path, signal.SIGINT)
    assert code == 130, printed
    assert "greybed trace: interrupted; what was finished is kept." in printed
    assert "Traceback" not in printed
    assert files(tmp_path / "out")
    subprocess.run(command(*WORDS), cwd=tmp_path, capture_output=True, check=True)
    final = "out/view_factors.h5"
    assert (tmp_path / final).read_bytes() == (uninterrupted / "view_factors.h5").read_bytes()


def test_the_library_gives_the_same_bits(bed, uninterrupted):
    from greybed.core.readers import read_packing

    packing = read_packing(bed / "bed.h5")
    stored = read_factors(uninterrupted / "view_factors.h5")
    stored.check(packing)
    some = [0, 8, 47]
    direct = view_factors(packing, rays=RAYS, seed=5, emitters=some)
    np.testing.assert_array_equal(
        stored.result.factors[some].toarray(), direct.factors[some].toarray()
    )
    np.testing.assert_array_equal(
        stored.result.stderr[some].toarray(), direct.stderr[some].toarray()
    )


def test_a_state_of_other_settings_is_removed(bed, tmp_path, monkeypatch):
    monkeypatch.chdir(bed)
    stale = tmp_path / "out" / STATE / "0123" / "0-8.npz"
    stale.parent.mkdir(parents=True)
    stale.write_bytes(b"PK")
    assert main(["trace", "bed.h5", "--rays", "20", "--out", str(tmp_path / "out")]) == 0
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "summary.json",
        "view_factors.h5",
    ]


def test_summary_walls_and_overlaps(tmp_path, capsys):
    (tmp_path / "two.csv").write_text("x [mm],y [mm],z [mm],radius [mm]\n0,0,1,1\n0,0,2.8,1\n")
    words = ["trace", str(tmp_path / "two.csv"), "--rays", "4000", "--quiet"]
    walls = ["--wall", "plane:0,0,0:0,0,1", "--wall", "cylinder:0,0,0:0,0,1:4mm"]
    assert main([*words, *walls, "--out", str(tmp_path / "a"), "--max-distance", "9mm"]) == 0
    assert capsys.readouterr().err == ""
    summary = json.loads((tmp_path / "a/summary.json").read_text())
    assert summary["verb"] == "trace"
    assert summary["rays_per_sphere"] == 4000
    assert summary["provenance"]["seed"] == summary["seed"] == 0
    assert set(summary["mean_to_walls"]) == {"plane_1", "cylinder_2"}
    parts = summary["mean_row_sum_to_spheres"] + sum(summary["mean_to_walls"].values())
    parts += summary["mean_escaped"] + summary["mean_environment"]
    assert parts == pytest.approx(1.0, abs=1e-12)
    assert summary["overlapping_pairs"] == 1
    # A cap of height 0.1 r buries 5 % of each sphere.
    assert summary["buried_fraction_mean"] == pytest.approx(0.05, abs=0.01)
    assert summary["spheres_partly_buried"] == 2
    assert summary["max_distance_m"] == pytest.approx(9e-3)
    assert summary["mrays_per_second"] > 0
    stored = read_factors(tmp_path / "a/view_factors.h5")
    assert stored.max_distance == pytest.approx(9e-3)
    assert stored.wall_names == ("plane_1", "cylinder_2")


def test_walls_as_they_are_typed(tmp_path):
    up = ((0, 0, 0), (0, 0, 1))
    for text, wall in (
        ("plane:0,0,-1mm:0,0,2", Plane((0, 0, -1e-3), (0, 0, 1), "a")),
        ("cylinder:0,0,0:0,0,1:0.03", Cylinder(*up, 0.03, "a")),
        ("cylinder:0,0,0:0,0,1:0.03:50cm", Cylinder(*up, 0.03, "a", 0.5)),
        ("cone:0,0,0:0,0,1:0:0.03:2", Cone(*up, 0.0, 0.03, 2.0, "a")),
        ("disc:0,0,0:0,0,1:0.03", Disc(*up, 0.03, "a")),
        (
            "polygon:0,0,0:1,0,0:1,1,0:0,100cm,0",
            Polygon([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], "a"),
        ),
    ):
        assert parse_walls(text, "a") == (wall,)
    assert parse_walls("box:0,0,0:1,2,300cm", "b") == box_walls((0, 0, 0), (1, 2, 3), "b")
    path = tmp_path / "c:d.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    assert parse_walls(f"mesh:{path}", "c")[0].area == 0.5
    (mesh,) = parse_walls(f"mesh:{path}:mm", "c")
    assert (mesh.name, math.isclose(mesh.area, 0.5e-6)) == ("c", True)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("plane:0,0,0", "give plane:X,Y,Z:NX,NY,NZ, such as plane:0,0,0:0,0,1"),
        ("plane:0,0:0,0,1", "give plane:"),
        ("cylinder:0,0,0:0,0,1", "give cylinder:"),
        ("cone:0,0,0:0,0,1", "give cone:"),
        ("disc:0,0,0:0,0,1:1:1", "give disc:"),
        ("box:0,0,0", "give box:"),
        ("polygon:0,0,0:1,0,0", "give polygon:"),
        ("mesh:", "give mesh:FILE"),
        ("mesh:none.stl:mm", "no such file"),
        ("torus:0,0,0", "give plane:.* or mesh:FILE"),
        ("", "give plane:"),
    ],
)
def test_walls_mistyped(text, says):
    with pytest.raises(InputError, match=says):
        parse_walls(text, "c")


def test_trace_in_a_box_of_walls(tmp_path):
    bed = Packing([[0.5, 0.5, 0.5], [1.5, 0.5, 0.5]], 0.3)
    write_packing(bed, tmp_path / "bed.csv")
    words = [
        "trace",
        str(tmp_path / "bed.csv"),
        "--rays",
        "500",
        "--quiet",
        "--out",
        str(tmp_path / "o"),
    ]
    assert main([*words, "--wall", "box:0,0,0:2,1,1", "--wall", "disc:1,0.5,0.5:1,0,0:0.1"]) == 0
    stored = read_factors(tmp_path / "o/view_factors.h5")
    assert stored.wall_names[0] == "box_1_x_low"
    assert stored.wall_names[-1] == "disc_2"
    assert (stored.result.escaped == 0.0).all()
    stored.check(
        Packing(
            bed.centres,
            bed.radii,
            walls=[*box_walls((0, 0, 0), (2, 1, 1)), Disc((1, 0.5, 0.5), (1, 0, 0), 0.1)],
        )
    )
    with pytest.raises(InputError, match="another packing"):
        stored.check(
            Packing(
                bed.centres,
                bed.radii,
                walls=[*box_walls((0, 0, 0), (2, 1, 1)), Disc((1, 0.5, 0.5), (1, 0, 0), 0.2)],
            )
        )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("--rays", "0"), "rays = 0 must be a whole number of at least 1"),
        (("--seed", "-1"), "seed = -1 must be"),
        (("--threads", "0"), "threads = 0 must be"),
        (("--wall", "plane:0,0,x:0,0,1"), "--wall plane:0,0,x:0,0,1: 'x' is not a number"),
        (("--wall", "plane:0,0,0:0,0,1mm"), "'1mm' is not a number"),
        (("--wall", "plane:0,0,0:0,0,0"), "has no length"),
        (("--wall", "cylinder:0,0,0:0,0,1:-1"), "must be finite and above 0"),
        (("--wall", "plane:0,0,0:0,0,1"), "does not repeat along the periodic direction z"),
        (("--max-distance", "9"), "has no unit"),
        (("--length-unit", "mm"), "states its own units"),
    ],
)
def test_refusals_are_one_sentence_and_exit_code_2(bed, tmp_path, capsys, change, message):
    words = ["trace", str(bed / "bed.h5"), "--rays", "10", "--out", str(tmp_path / "out")]
    assert main([*words, *change]) == 2
    printed = capsys.readouterr().err
    assert message in printed
    assert "Traceback" not in printed
    assert not list(Path(tmp_path).rglob("*.h5"))


def test_a_duplicate_is_named(tmp_path, capsys):
    write_packing(Packing([[0, 0, 0], [0, 0, 0]], [1.0, 0.9]), tmp_path / "bed.h5")
    words = ["trace", str(tmp_path / "bed.h5"), "--rays", "10", "--out", str(tmp_path / "out")]
    assert main(words) == 2
    assert "bed.h5: sphere 1 lies wholly inside" in capsys.readouterr().err


def test_accuracy_on_request_and_smooth_rows(tmp_path):
    bed = tmp_path / "bed.h5"
    words = ["pack", "--count", "60", "--fraction", "0.4", "--sizes", "mono:1mm", "--out"]
    assert main([*words, str(bed)]) == 0
    out = tmp_path / "out"
    words = ["trace", str(bed), "--rays", "500", "--rel-error", "0.05", "--least", "0.02"]
    assert main([*words, "--smooth", "--quiet", "--out", str(out)]) == 0
    result = read_factors(out / "view_factors.h5").result
    # Smoothing moves factors by their errors, also across the least one.
    large = result.factors.data >= 0.024
    assert (result.stderr.data[large] <= 0.05 * result.factors.data[large]).all()
    sums = result.factors.sum(axis=1) + result.escaped
    assert abs(sums - 1.0).max() <= 1e-12
    summary = json.loads((out / "summary.json").read_text())
    assert summary["rays_and_lines"] == int(result.cost.sum())
    assert main(["trace", str(bed), "--rel-error", "0", "--out", str(out)]) == 2
