"""What hosts share, without any host: laws, compile checks, texts, refusals."""

import shutil
import subprocess

import numpy as np
import pytest

from greybed.cli.main import main
from greybed.closures.drag.laws import drag_law
from greybed.core.errors import InputError
from greybed.export import find_compiler
from greybed.hosts import cfdem, host_model, lammps, liggghts, mfix, openfoam
from greybed.hosts.model import LAWS

MODEL = "shipped:filtered_drag_mlp_plain"
WARNINGS = ("-std=c++11", "-Wall", "-Wextra", "-Wpedantic", "-Werror")
needs_compiler = pytest.mark.skipif(find_compiler() is None, reason="no C++ compiler")
PROGRAM = """
#include "greybed_drag.hpp"
#include <cstdio>
int main() {
  const double gravity[3] = {0.0, 0.0, -9.81};
  greybed_host::Drag drag(1.2, 1.8e-5, gravity, 1.0);
  for (int i = 0; i < 7; ++i) {
    for (int k = 0; k < 6; ++k) {
      const double phi = 0.1 * i;
      const double re = k == 0 ? 0.0 : 0.01 * (k == 1 ? 1 : k * k * k * k * 100.0);
      std::printf("%.17g %.17g %.17g\\n", phi, re,
                  greybed_host::law(greybed_host::swarm_of(phi), re));
    }
  }
  return drag.policy("other") || !drag.policy("clamp") || greybed_host::self_test() != 0;
}
"""


def compiled(folder, *words):
    done = subprocess.run(
        [*find_compiler(), *WARNINGS, "-I", str(folder), *words], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr


@needs_compiler
@pytest.mark.parametrize("name", LAWS)
def test_laws_are_those_of_greybed(tmp_path, name):
    openfoam.generate(host_model(f"law:{name}"), tmp_path)
    (tmp_path / "main.cpp").write_text(PROGRAM)
    compiled(tmp_path, str(tmp_path / "main.cpp"), "-o", str(tmp_path / "main"))
    done = subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True)
    phi, re, force = np.array([line.split() for line in done.stdout.splitlines()], float).T
    assert np.allclose(force, drag_law(name)(phi, re), rtol=1e-13)


@needs_compiler
@pytest.mark.parametrize("model", ["shipped:viewfactor_mlp_published", "law:exact"])
def test_headers_of_radiation_compile_without_a_warning(tmp_path, model):
    lammps.generate(host_model(model), tmp_path)
    (tmp_path / "main.cpp").write_text(
        '#include "greybed_radiation.hpp"\nint main() { greybed_host::Radiation r(1, 1, 0.5, 0);'
        " return r.reach() < 0 || greybed_host::self_test() != 0; }\n"
    )
    compiled(tmp_path, str(tmp_path / "main.cpp"), "-o", str(tmp_path / "main"))
    subprocess.run([tmp_path / "main"], check=True)


@needs_compiler
def test_the_text_for_mfix_compiles(tmp_path):
    mfix.generate(host_model(MODEL), tmp_path)
    compiled(tmp_path, "-c", str(tmp_path / "greybed_mfix.cpp"), "-o", str(tmp_path / "a.o"))
    if shutil.which("gfortran") is None:
        pytest.skip("no gfortran for usr_drag.f")
    subprocess.run(
        ["gfortran", "-Wall", "-Werror", "-ffree-form", "-c", "usr_drag.f"], cwd=tmp_path,
        check=True,
    )  # fmt: skip


def test_texts_say_that_they_are_only_texts(tmp_path):
    cfdem.generate(host_model(MODEL), tmp_path / "cfdem")
    mfix.generate(host_model(MODEL), tmp_path / "mfix")
    assert "TEXT ONLY" in (tmp_path / "cfdem" / "GreybedDrag.H").read_text().splitlines()[0]
    assert "never run" in (tmp_path / "mfix" / "usr_drag.f").read_text().splitlines()[0]


def test_every_file_names_model_and_hash(tmp_path):
    model = host_model(MODEL)
    for host in (lammps, liggghts, openfoam, cfdem, mfix):
        files = host.generate(model, tmp_path)
        assert f"{model.name}.hpp" in files
        text = "".join((tmp_path / file).read_text() for file in files)
        assert model.hash in text
        assert "{{" not in text.replace("{{0", "").replace("{{1", "")


def test_the_verb_writes_and_says_what(tmp_path, capsys):
    assert main(["host", "lammps", MODEL, "--out", str(tmp_path)]) == 0
    said = capsys.readouterr().out
    assert host_model(MODEL).hash in said
    assert (tmp_path / "summary.json").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["mfix", MODEL, "--build"], "host of text only"),
        (["lammps", MODEL, "--ranks", "2"], "--ranks is for --run only"),
        (["lammps", "shipped:filtered_drag_mlp_full"], "needs the gradient"),
        (["lammps", "shipped:wallfactor_mlp_wall"], "closure of wallfactor"),
        (["openfoam", "law:exact"], "models of drag only"),
        (["lammps", "law:tang"], "has no form in hosts"),
        (["lammps", "law:wen-yu", "--law", "ergun"], "is a law itself"),
    ],
)
def test_what_a_host_cannot_take_is_refused(tmp_path, capsys, words, said):
    assert main(["host", *words, "--out", str(tmp_path)]) == 2
    assert said in capsys.readouterr().err


def test_lammps_that_is_missing_is_named(tmp_path, monkeypatch):
    monkeypatch.setenv("GREYBED_LAMMPS", str(tmp_path))
    lammps.generate(host_model("law:wen-yu"), tmp_path)
    with pytest.raises(InputError, match="LAMMPS is not installed"):
        lammps.build(tmp_path)
