"""README.md and docs/: every block of shell and Python is run as printed, page by page.

A page starts in an empty folder with links to ``greybed`` and ``examples``, as in a checkout. Its
blocks run in order, Python blocks in one namespace. ``<!-- not run: reason -->`` before a block
keeps it from running; then its ``make`` targets and verbs must exist. Pages that speak of the
user's own files and names find those of ``lay_out`` and ``NAMES``; what takes long for its size
alone is run smaller, by ``SMALLER``. Lines that call a verb run in this process, for starting one
takes seconds; tests/cli starts each as a process.
"""

import itertools
import os
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from greybed.cli import main
from greybed.cli.main import VERBS

ROOT = Path(__file__).parents[1]
FOUND = (*ROOT.glob("docs/*.md"), *ROOT.glob("docs/tutorials/*.md"))
# Those two are run on smaller inputs, by tests/examples/test_tutorials.py.
FOUND = [p for p in FOUND if p.name not in ("combustion.md", "fluidisation.md")]
PAGES = ["README.md", "CONTRIBUTING.md", *sorted(str(p.relative_to(ROOT)) for p in FOUND)]
BLOCK = re.compile(
    r"(?:<!-- not run: (?P<reason>[^\n]+?) -->\n)?```(?P<kind>sh|bash|python)\n(?P<code>.*?)^```",
    re.DOTALL | re.MULTILINE,
)
# Names that a page takes for granted, with what stands for them.
NAMES = {"docs/formats.md": {"temperatures": [300.0] * 4000}}
# Words of a page, and what runs in their place; each must be there.
SMALLER = {
    "docs/closures.md": (("--epochs 10", "--epochs 10 --no-curve"),),
    "docs/overlaps.md": (("--rays 2000", "--rays 100"),),
    "docs/packings.md": (("--count 10000", "--count 1000"), ("packing(5000,", "packing(1500,")),
    "docs/raytrace.md": (
        ("4k.dump --rays 2000", "4k.dump --rays 100"),
        ("view_factors(bed, rays=2000, seed=1)", "view_factors(bed, rays=100, seed=1)"),
        ("rays=2000, seed=1, emitters", "rays=100, seed=1, emitters"),
        ("rel_error=0.01", "rel_error=0.03"),
        ("0.01 * result", "0.03 * result"),
    ),
}
# Verbs of the README's table that the test leaves out, for what they take; see their own tests.
LONG = {"quickstart"}


@dataclass(frozen=True)
class Block:
    """One fenced block of a page."""

    kind: str
    code: str
    line: int
    reason: str | None


def blocks_of(page: str) -> list[Block]:
    text = (ROOT / page).read_text()
    return [
        Block(m["kind"], m["code"], text.count("\n", 0, m.start("code")) + 1, m["reason"])
        for m in BLOCK.finditer(text)
    ]


def table_commands() -> list[tuple[str, str]]:
    """Verb and example of every row of the README's table of verbs."""
    rows = re.findall(
        r"^\| `(\w+)` \| `(greybed [^`]+)` \|$", (ROOT / "README.md").read_text(), re.M
    )
    return [(verb, command) for verb, command in rows]


def shell(code: str, folder: Path) -> subprocess.CompletedProcess[str]:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return subprocess.run(
        ["bash", "-euo", "pipefail", "-c", code],
        cwd=folder, env={**os.environ, "PATH": path}, capture_output=True, text=True, timeout=600,
    )  # fmt: skip


def run_shell(code: str, folder: Path) -> tuple[bool, str]:
    """Run a block: plain calls of a verb here, all other lines by the shell, in order."""
    lines = code.replace("\\\n", " ").splitlines()
    plain = [line.startswith("greybed ") and not re.search("[|<>&;$`]", line) for line in lines]
    for here, group in itertools.groupby(range(len(lines)), key=plain.__getitem__):
        part = [lines[k] for k in group]
        if not here:
            done = shell("\n".join(part), folder)
            if done.returncode:
                return False, f"{done.stdout}\n{done.stderr}"
            continue
        for line in part:
            if main(shlex.split(line, comments=True)[1:]):
                return False, line
    return True, ""


def check_named(code: str) -> None:
    """The make targets and the verbs of a block that is not run must exist."""
    for target in re.findall(r"^make (\w+)$", code, re.M):
        plan = subprocess.run(
            ["make", "--dry-run", target], cwd=ROOT, capture_output=True, text=True, timeout=30
        )
        assert plan.returncode == 0, plan.stderr
    for verb in re.findall(r"^greybed (\w+)", code, re.M):
        assert verb in VERBS
    for file in re.findall(r"-c (\S+\.txt)", code):
        assert (ROOT / file).is_file()


@pytest.fixture(scope="session")
def small_run(tmp_path_factory):
    """What ``make quickstart`` leaves, as far as the pages use it: a data set and one closure."""
    from greybed.closures import save
    from greybed.datasets.viewfactor import Design, PackingDesign, generate
    from greybed.training import train

    folder = tmp_path_factory.mktemp("small_run")
    splits = ((0.3, "train"), (0.5, "train"), (0.45, "calibrate"), (0.4, "test"))
    packings = [
        PackingDesign(fraction=phi, sizes="lognormal:1mm,1.3", count=120, split=split)
        for phi, split in splits
    ]
    design = Design(packing=tuple(packings), rays=2000, emitters=20)
    data = generate(design, folder / "viewfactors.h5")
    save(train(data, "mlp", "pencil", epochs=4), folder / "viewfactor_mlp_pencil.closure")
    return folder


def lay_out(page: str, folder: Path, small_run: Path, small_quickstart: Path) -> None:
    """Files of the checkout and the user's own that a page speaks of."""
    for name in ("greybed", "examples"):
        (folder / name).symlink_to(ROOT / name)
    own = {
        "README.md": {"runs/quickstart": small_run},
        "docs/export.md": {"bed.closure": small_run / "viewfactor_mlp_pencil.closure"},
        "docs/formats.md": {"bed.dump": ROOT / "greybed/datasets/packings/settled_mono_4k.dump"},
    }
    for name, place in own.get(page, {}).items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).symlink_to(place)
    if page == "docs/quickstart.md":  # its own test makes it; here the command finds it kept
        shutil.copytree(small_quickstart / "out", folder / "runs/small")
    if page == "docs/export.md":
        (folder / "build").mkdir()  # compile_cpp does not make its folder


@pytest.mark.parametrize("page", PAGES)
def test_blocks_run_as_printed(page, tmp_path, monkeypatch, capsys, small_run, small_quickstart):
    lay_out(page, tmp_path, small_run, small_quickstart)
    monkeypatch.chdir(tmp_path)
    namespace = {"__name__": "__main__", **NAMES.get(page, {})}
    smaller = set(SMALLER.get(page, ()))
    for block in blocks_of(page):
        if block.reason is None:
            for old, new in SMALLER.get(page, ()):
                if old in block.code:
                    smaller.discard((old, new))
                    block = replace(block, code=block.code.replace(old, new))
        if block.reason is not None:
            check_named(block.code)
        elif block.kind == "python":
            # Blank lines in front keep the line numbers of the page in tracebacks.
            code = "\n" * (block.line - 1) + block.code
            exec(compile(code, ROOT / page, "exec"), namespace)
        else:
            passed, said = run_shell(block.code, tmp_path)
            place = f"{page}, block at line {block.line}"
            assert passed, f"{place}\n{said}\n{capsys.readouterr().err}"
    assert not smaller, f"{page} no longer says {smaller}"


def test_commands_of_the_verb_table(tmp_path, monkeypatch, capsys, small_run, small_quickstart):
    lay_out("README.md", tmp_path, small_run, small_quickstart)
    monkeypatch.chdir(tmp_path)
    commands = table_commands()
    assert [verb for verb, _ in commands] == list(VERBS)
    lines = []
    for verb, command in commands:
        assert command.split()[1] == verb
        if verb not in LONG:
            lines.append(command)
    passed, said = run_shell("\n".join(lines), tmp_path)
    assert passed, f"{said}\n{capsys.readouterr().err}"
    assert (tmp_path / "runs/bed.vtu").is_file()
    for file in ("bed.h5", "traced/view_factors.h5", "small.h5", "heated_bed/summary.json"):
        assert (tmp_path / "runs" / file).is_file()


def test_quickstart_of_the_makefile_is_the_one_described():
    plan = subprocess.run(
        ["make", "--dry-run", "quickstart"], cwd=ROOT, capture_output=True, text=True, timeout=30
    )
    assert "greybed quickstart --out runs/quickstart" in plan.stdout


def test_pages_have_the_blocks_they_should():
    # A slip in a fence would leave blocks out silently.
    for page in PAGES:
        fences = re.findall(r"^```(?:sh|bash|python)$", (ROOT / page).read_text(), re.M)
        assert len(fences) == len(blocks_of(page)), page
