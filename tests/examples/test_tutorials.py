"""docs/tutorials/: every command as printed, on smaller inputs; numbers on the pages as recorded.

A page runs in a folder that looks like a checkout. Its commands are those of the page; what is
smaller is in ``SMALLER``, inputs by their text and options by their words, and each of these must
be there to be replaced. Commands run in this process, for starting one takes seconds.
"""

import json
import re
import shlex
import shutil
from pathlib import Path

import pytest

from greybed.cli import main
from greybed.cli.main import VERBS
from greybed.closures.drag.filtered import limits

ROOT = Path(__file__).parents[2]
PAGES = ("combustion", "fluidisation")
INPUTS = Path("examples/tutorials")
BLOCK = re.compile(
    r"(?:<!-- not run: (?P<reason>[^\n]+?) -->\n)?```(?P<kind>sh|bash|python)\n(?P<code>.*?)^```",
    re.DOTALL | re.MULTILINE,
)
# File of the inputs -> what is replaced in it; and words of a page's commands.
SMALLER = {
    "combustion/contacts.toml": (('"0.2 s"', '"2 ms"'), ('"10 ms"', '"1 ms"')),
    "combustion/radiation.toml": (('"0.2 s"', '"5 ms"'),),
    "combustion/gas.toml": (('"0.2 s"', '"2 ms"'), ('"10 ms"', '"1 ms"')),
    "fluidisation/design.toml": (
        ("each = 300", "each = 60"),
        ("[32, 96, 1]\nsamples = 4", "[16, 32, 1]\nsamples = 1\ndevelop = 0.05"),
    ),
    **{
        f"fluidisation/{name}.toml": (('"0.3 s"', '"2 ms"'), ('"50 ms"', '"2 ms"'))
        for name in ("fine", "coarse", "coarse_mine", "coarse_shipped")
    },
}
WORDS = {
    "combustion": {"--rays 20000": "--rays 300"},
    "fluidisation": {"--no-curve": "--no-curve --epochs 1"},
}
PLACES = 20_000  # where the limits of filtered drag are checked, instead of a million


def blocks_of(page: str) -> list[re.Match[str]]:
    """The fenced blocks of code of a page."""
    return list(BLOCK.finditer((ROOT / "docs/tutorials" / f"{page}.md").read_text()))


def commands_of(code: str) -> list[str]:
    """Lines of a block of shell, continued ones joined."""
    return [line for line in code.replace("\\\n", " ").splitlines() if line.strip()]


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """A folder with the inputs of the tutorials, made smaller."""
    shutil.copytree(ROOT / INPUTS, tmp_path / INPUTS)
    for name, changes in SMALLER.items():
        file = tmp_path / INPUTS / name
        text = file.read_text()
        for old, new in changes:
            assert old in text, f"{name}: {old}"
            text = text.replace(old, new)
        file.write_text(text)
    all_limits = limits.check_limits

    def fewer(closure, predict=None, *, n=PLACES, **more):
        return all_limits(closure, predict, n=min(n, PLACES), **more)

    monkeypatch.setattr(limits, "check_limits", fewer)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("page", PAGES)
def test_commands_run_as_printed(page, checkout, capsys):
    space: dict[str, object] = {"__name__": "__main__"}
    smaller = dict(WORDS[page])
    for block in blocks_of(page):
        if block["kind"] == "python":
            if block["reason"] is None:
                exec(compile(block["code"], page, "exec"), space)
            continue
        for line in commands_of(block["code"]):
            for old in [word for word in smaller if word in line]:
                line = line.replace(old, WORDS[page][old])
                smaller.pop(old)
            words = shlex.split(line, comments=True)
            if words[0] != "greybed" or block["reason"] is not None:
                assert block["reason"] is not None, f"{page}: {line} needs a reason not to run"
                assert words[0] != "greybed" or words[1] in VERBS
                continue
            assert main(words[1:]) == 0, f"{page}: {line}\n{capsys.readouterr().err}"
    assert not smaller, f"{page} no longer says {list(smaller)}"


@pytest.mark.parametrize("page", PAGES)
def test_files_that_a_page_names_are_there(page):
    text = (ROOT / "docs/tutorials" / f"{page}.md").read_text()
    named = set(re.findall(r"examples/tutorials/[\w/.]*\w", text))
    assert named
    for file in named:
        assert (ROOT / file).exists(), file


@pytest.mark.parametrize("page", PAGES)
def test_recorded_numbers_stand_on_the_page(page):
    """``recorded.json`` holds the full runs: each of its numbers, as the page prints it."""
    text = (ROOT / "docs/tutorials" / f"{page}.md").read_text()
    recorded = json.loads((ROOT / INPUTS / page / "recorded.json").read_text())
    assert recorded["numbers"]
    for name, entry in recorded["numbers"].items():
        printed = format(entry["value"], entry["as"])
        assert printed in text, f"{name}: {printed} of recorded.json is not on the page"


def test_both_engines_took_the_same_heat():
    """Recorded full runs: LAMMPS on two ranks beside greybed, with the errors that the page states.

    Through contacts both integrate one equation, greybed's bed in steps of a look, so a thousandth
    is the bound; with radiation factors are balanced here, and there cut off at eight radii and
    held for 50 steps: half a per cent.
    """
    numbers = json.loads((ROOT / INPUTS / "combustion/recorded.json").read_text())["numbers"]
    values = {name: entry["value"] for name, entry in numbers.items()}
    contacts = values["floor, contacts, LAMMPS [J]"] / values["floor, contacts, greybed [J]"]
    assert contacts == pytest.approx(1.0, abs=1e-3)
    light = values["all walls, radiation, LAMMPS [J]"] / values["all walls, radiation, greybed [J]"]
    assert light == pytest.approx(1.0, abs=0.005)
