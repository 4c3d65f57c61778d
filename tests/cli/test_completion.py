"""Completion of shells: what it offers is what the parsers take."""

import re
import shutil
import subprocess

import pytest

from greybed.cli import main
from greybed.cli.completion import SHELLS
from greybed.cli.main import VERBS

ASK = r"""
ask() {
  COMP_WORDS=("$@"); COMP_CWORD=$(( $# - 1 )); COMPREPLY=()
  _greybed
  echo "${COMPREPLY[*]}"
}
ask greybed dia
ask greybed train ''
ask greybed train viewfactor --mo
ask greybed train viewfactor data.h5 --model ''
ask greybed host ''
ask greybed simulate ''
ask greybed trace bed.h5 --out ''
"""


def script(shell, capsys):
    assert main(["completion", shell]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("shell", SHELLS)
def test_every_verb_and_option_is_offered(shell, capsys):
    text = script(shell, capsys)
    for verb in VERBS:
        assert re.search(rf"\b{verb}\b", text)
        with pytest.raises(SystemExit):
            main([verb, "--help"])
        for option in re.findall(r"--([a-z][a-z-]+)", capsys.readouterr().out.split("options:")[1]):
            assert re.search(rf"(--|-l ){option}\b", text), (verb, option)


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash")
def test_bash_completes(tmp_path, capsys):
    text = script("bash", capsys)
    done = subprocess.run(
        ["bash", "-uc", text + ASK], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "diagnose",
        "viewfactor drag",
        "--model",
        "mlp forest",
        "lammps liggghts openfoam cfdem mfix",
        "",  # a file of the user's, which the shell completes by itself
        "",
    ]


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_others_read_the_script(shell, tmp_path, capsys):
    if shutil.which(shell) is None:
        pytest.skip(f"no {shell}")
    file = tmp_path / "greybed"
    file.write_text(script(shell, capsys))
    words = [shell, "--no-execute", str(file)] if shell == "fish" else [shell, "-fn", str(file)]
    done = subprocess.run(words, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")
