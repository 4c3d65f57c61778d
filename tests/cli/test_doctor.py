"""The verb that looks at the installation."""

import importlib.metadata
import json

import pytest

from greybed.cli import doctor_checks, main


def test_a_sound_installation(tmp_path, capsys):
    assert main(["doctor", "--out", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    checks = json.loads((tmp_path / "summary.json").read_text())["checks"]
    named = {found["name"]: found for found in checks["packages"]}
    assert named["numba"]["found"] == importlib.metadata.version("numba")
    assert named["torch"]["mark"] == "✓"
    assert "pytest" not in named  # extras are no needs
    for engine in checks["engines"]:
        assert engine["purpose"] in told
        assert (engine["mark"] == "-") == bool(engine["remedy"])


def test_what_is_missing_or_old_is_said(monkeypatch, capsys):
    versions = {"numpy": "1.9.2", "scipy": "9.9"}

    def version(name):
        if name in versions:
            return versions[name]
        raise importlib.metadata.PackageNotFoundError(name)

    needs = ["numpy>=1.26", "scipy>=1.11", "numba>=0.60", 'pytest>=8; extra == "dev"']
    monkeypatch.setattr(doctor_checks.importlib.metadata, "version", version)
    monkeypatch.setattr(doctor_checks.importlib.metadata, "requires", lambda _: needs)
    monkeypatch.setenv("PATH", "/nowhere")
    assert main(["doctor"]) == 1
    told = capsys.readouterr().out
    assert "needed and not sound: numpy, numba" in told
    assert "pip install 'numba>=0.60'" in told
    assert "apt-get install liggghts" in told


@pytest.mark.parametrize(("one", "other"), [("1.9.2", "1.10"), ("2.13.0+cpu", "2.13.1")])
def test_versions_are_numbers(one, other):
    assert doctor_checks._numbers(one) < doctor_checks._numbers(other)


def test_a_newcomer_is_shown_the_way(capsys):
    assert main([]) == 0
    assert "greybed quickstart" in capsys.readouterr().out
