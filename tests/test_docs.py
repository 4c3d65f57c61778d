"""What the documentation promises: links that lead somewhere, docstrings, refusals as printed."""

import ast
import gzip
import importlib
import inspect
import json
import pkgutil
import re
from pathlib import Path

import numpy as np
import pytest

import greybed
from greybed.cli import main
from greybed.cli.main import VERBS
from greybed.closures import ViewFactorClosure, exact_view_factor, save
from greybed.core import GreybedError, Packing, Plane
from greybed.raytrace import view_factors

ROOT = Path(__file__).parents[1]
PAGES = sorted(
    str(p.relative_to(ROOT))
    for p in (*ROOT.glob("*.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("examples/**/*.md"))
)
SOURCES = sorted(str(p.relative_to(ROOT)) for p in ROOT.glob("greybed/**/*.py"))
_FOUND = pkgutil.walk_packages(greybed.__path__, "greybed.")
PACKAGES = ["greybed", *(m.name for m in _FOUND if m.ispkg)]
LONGEST = 400  # lines of a module


def slug(heading: str) -> str:
    """Anchor that a heading gets on common code hosts."""
    plain = re.sub(r"[^\w\- ]", "", heading.strip().lower())
    return plain.replace(" ", "-")


def anchors(page: Path) -> set[str]:
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)
    return {slug(heading) for heading in re.findall(r"^#+ (.+)$", text, re.M)}


@pytest.mark.parametrize("page", PAGES)
def test_links_lead_somewhere(page):
    place = ROOT / page
    text = re.sub(r"^```.*?^```", "", place.read_text(), flags=re.DOTALL | re.MULTILINE)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"[a-z]+:", target):
            continue
        file, _, anchor = target.partition("#")
        there = (place.parent / file).resolve() if file else place
        assert there.exists(), f"{page}: {target}"
        assert ROOT in there.parents, f"{page}: {target} leads out of the project"
        if anchor:
            assert anchor in anchors(there), f"{page}: {target}"


def test_every_page_is_in_the_index():
    index = (ROOT / "docs/index.md").read_text()
    for page in [*ROOT.glob("docs/*.md"), *ROOT.glob("docs/tutorials/*.md")]:
        name = str(page.relative_to(ROOT / "docs"))
        assert name == "index.md" or f"({name})" in index, name


def test_the_reference_names_every_room():
    named = "\n".join(page.read_text() for page in ROOT.glob("docs/api/*.rst"))
    modules = re.findall(r"^\.\. automodule:: (\S+)$", named, re.M)
    assert len(modules) == len(set(modules))
    for name in modules:
        assert importlib.import_module(name).__doc__
    # What a package exports is described there, or where a module of it is described.
    for name in PACKAGES:
        if getattr(importlib.import_module(name), "__all__", ()) and name != "greybed":
            assert name in modules or name in {"greybed.cli"}, name
    listed = (ROOT / "docs/api/index.md").read_text()
    for page in ROOT.glob("docs/api/*.rst"):
        assert f"({page.name})" in listed, page.name


def test_the_page_of_verification_is_what_was_found(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "examples/verification")
    run = importlib.import_module("run")
    recorded = json.loads(run.RESULTS.read_text())["groups"]
    page = run.PAGE.read_text()
    assert page.split(run.BEGIN)[1].split(run.END)[0].strip() == run.text(recorded).strip()
    assert set(recorded) == set(run.GROUPS)
    rows = {row["key"]: row for group in recorded.values() for row in group["rows"]}
    assert set(rows) == set(run.BOUNDS)
    for key, bound in run.BOUNDS.items():
        assert rows[key]["pass"] == bound.holds(rows[key]["value"])
        assert not bound.holds(float("nan"))
    for group in run.GROUPS.values():
        for file, _ in group.pictures:
            assert (ROOT / "docs/images" / file).is_file()


@pytest.mark.parametrize(
    ("kind", "bound", "good", "bad"),
    [
        ("within", 0.1, 2.05, 2.2),
        ("relative", 0.1, 2.15, 2.3),
        ("most", 3.0, -5.0, 3.1),
        ("least", 1.0, 7.0, 0.9),
    ],
)
def test_bounds_of_the_verification_can_fail(kind, bound, good, bad, monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "examples/verification")
    rule = importlib.import_module("bounds").Bound("x", 2.0, "", kind, bound)
    assert rule.holds(good)
    assert not rule.holds(bad)


def exported() -> list[tuple[str, object]]:
    """Functions and classes of every ``__all__`` in the package, each once."""
    found: dict[int, tuple[str, object]] = {}
    for name in PACKAGES:
        module = importlib.import_module(name)
        for word in getattr(module, "__all__", ()):
            item = getattr(module, word)  # that it is there is part of the test
            if inspect.isclass(item) or inspect.isroutine(item):
                found.setdefault(id(item), (f"{item.__module__}.{item.__qualname__}", item))
    return sorted(found.values(), key=lambda pair: pair[0])


@pytest.mark.parametrize(("name", "item"), [pytest.param(n, i, id=n) for n, i in exported()])
def test_exported_names_are_documented(name, item):
    doc = item.__doc__ or ""  # an inherited docstring speaks of something else
    assert len(doc.split("\n", 1)[0]) > 10, name
    if inspect.isclass(item):
        for word, member in vars(item).items():
            if not word.startswith("_") and inspect.isroutine(member):
                assert inspect.getdoc(getattr(item, word)), f"{name}.{word}"


# Types of parameters whose docstrings need a unit somewhere.
NUMBERS = re.compile(r"\b(float|array_like|ndarray|array)\b")


@pytest.mark.parametrize(("name", "item"), [pytest.param(n, i, id=n) for n, i in exported()])
def test_numbers_carry_units(name, item):
    doc = inspect.cleandoc(item.__doc__ or "")
    section = re.search(r"^Parameters\n-+\n(.*?)(?=^\w+\n-+\n|\Z)", doc, re.M | re.S)
    if section is None or not NUMBERS.search(section[1]):
        return
    assert re.search(r"\[[^\]\s][^\]]*\]", doc), f"{name}: numbers without a unit in brackets"


@pytest.mark.parametrize("file", SOURCES)
def test_sources_say_what_they_are_and_stay_short(file):
    text = (ROOT / file).read_text()
    doc = ast.get_docstring(ast.parse(text))
    assert doc, f"{file} has no docstring"
    assert text.lstrip().startswith(('"""', 'r"""')), f"{file}: the docstring comes first"
    assert len(text.splitlines()) <= LONGEST, file


@pytest.mark.parametrize("verb", VERBS)
def test_verbs_are_explained(verb, capsys):
    assert f"`greybed {verb} " in (ROOT / "README.md").read_text()
    with pytest.raises(SystemExit) as end:
        main([verb, "--help"])
    assert end.value.code == 0
    text = capsys.readouterr().out
    assert re.search(r"^examples?:", text, re.I | re.M)
    # The first example is that of the README's table, which tests/test_readme.py runs as printed.
    first = re.search(rf"greybed {verb} .*", text.split("xample", 1)[1])
    assert f"| `{verb}` | `{first[0].strip()}` |" in (ROOT / "README.md").read_text()


def test_every_dependency_has_its_reason():
    text = (ROOT / "pyproject.toml").read_text()
    reasons = (ROOT / "ARCHITECTURE.md").read_text().split("## Dependencies")[1]
    block = text.split("\ndependencies = [")[1].split("[project.scripts]")[0]
    names = re.findall(r'^ +"([A-Za-z-]+)>=', block, re.M)
    assert len(names) > 15
    for name in names:
        assert re.search(rf"\b{name}\b", reasons), name


# --- docs/bad_input.md: the sentences in its tables are what users see -------------------------

HEADER = "x [mm],y [mm],z [mm],radius [mm]\n"
DUMP = "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n{}\nITEM: BOX BOUNDS ff ff ff\n0 2\n0 2\n0 2\n"
COLUMNS = "ITEM: ATOMS id x y z radius\n"
FILES = {
    "empty.csv": "",
    "negative.csv": HEADER + "1.5,1.5,1.5,1.5\n4.5,1.5,1.5,-1.5\n",
    "no_unit.csv": "x,y,z,radius\n1.5,1.5,1.5,1.5\n",
    "kilograms.csv": "x [kg],y [mm],z [mm],radius [mm]\n1.5,1.5,1.5,1.5\n",
    "nan.csv": HEADER + "1.5,1.5,nan,1.5\n",
    "word.csv": HEADER + "1.5,1.5,abc,1.5\n",
    "no_radius.csv": "x [mm],y [mm],z [mm]\n1.5,1.5,1.5\n",
    "short.csv": HEADER + "1.5,1.5,1.5\n",
    "twice.csv": HEADER.replace("\n", ",id\n") + "1.5,1.5,1.5,1,7\n2,2,8,1,7\n",
    "inside.csv": HEADER + "1,1,1,2\n1,1,1,1\n",
    "bed.csv": HEADER + "1,1,1,1\n3,1,1,1\n",
    "cut.dump": DUMP.format(3) + COLUMNS + "1 1 1 1 0.5\n",
    "outside.dump": DUMP.format(1) + COLUMNS + "1 1 1 2.5 0.5\n",
    "typo.toml": 'kind = "thermal-bed"\n[packing]\nfil = "bed.csv"\n',
}
SPHERES = "diameter [mm],velocity [mm/s]\n" + "".join(f"{d},{d * d}\n" for d in range(1, 9))
STUDY = (
    '[data]\nfile = "{file}"\nresponse = "velocity"\n[model]\nname = "terminal-velocity"\n{model}'
    "[parameters]\nparticle_density = 1500.0\nfluid_density = 1100.0\n{viscosity}"
)
VISCOSITY = 'viscosity = "0.2 Pa s"\n'
FILES |= {
    "spheres.csv": SPHERES,
    "inches.csv": SPHERES.replace("mm/s", "furlong"),
    "hole.csv": SPHERES.replace("3,9", "3,nan"),
    "three.csv": "\n".join(SPHERES.splitlines()[:4]) + "\n",
    "typed.toml": STUDY.format(file="spheres.csv", model="", viscosity=VISCOSITY).replace(
        "response", "respons"
    ),
    "unit.toml": STUDY.format(file="inches.csv", model="", viscosity=VISCOSITY),
    "hole.toml": STUDY.format(file="hole.csv", model="", viscosity=VISCOSITY),
    "thin.toml": STUDY.format(file="spheres.csv", model="", viscosity=""),
    "effect.toml": STUDY.format(
        file="spheres.csv", model="effects = { wall = 2.1 }\n", viscosity=VISCOSITY
    ),
    "few.toml": STUDY.format(file="three.csv", model="", viscosity=VISCOSITY),
}
DIAGNOSED = ("missing", "typed", "unit", "hole", "thin", "effect", "few")
# Name, what of the example is changed, and into what.
CALIBRATED = {
    "rangeless": ("low = 0.1\n", ""),
    "reversed": ("low = 0.1\n", "low = 1.1\n"),
    "errorless": ('value = "65.6 deg"\nsd = "1 deg"', 'value = "65.6 deg"\nsd = 0'),
    "no_measure": ('measure = "mass_flow"', 'measure = "noise"'),
}
COMMANDS = [
    "info missing.csv",
    "info empty.csv",
    "info bed.csv.gz",
    "info no_unit.csv",
    "info kilograms.csv",
    "info bed.csv --length-unit mm",
    "info no_radius.csv",
    "info short.csv",
    "info word.csv",
    "info nan.csv",
    "info negative.csv",
    "info twice.csv",
    "info cut.dump",
    "info outside.dump",
    "info outside.dump --frame 3",
    "convert bed.csv bed.csv",
    "convert bed.csv bed.xyz",
    "pack --count 500 --fraction 0.5 --sizes mono:1 --out o.h5",
    "pack --count 5 --fraction 0.5 --sizes mono:1mm --out o.h5",
    "trace inside.csv --rays 100 --out o",
    "trace bed.csv --rays 0 --out o",
    "trace bed.csv --wall plane:0,0 --out o",
    "trace bed.csv --max-distance 5kg --out o",
    "check bed.csv",
    "check changed.closure",
    "simulate typo.toml --out o",
    "simulate wrong_unit.toml --out o",
    "simulate too_bright.toml --out o",
    *(f"diagnose {name}.toml --out o" for name in DIAGNOSED),
    *(f"calibrate {name}.toml --out o" for name in CALIBRATED),
]
FREE = {"radius_over_distance": 0.25, "radius_ratio": 1.0}
CALLS = {
    "exact_view_factor(1.0, 1.0, 1.5)": lambda: exact_view_factor(1.0, 1.0, 1.5),
    "closure.evaluate(radius_over_distance=0.25, radius_ratio=1.0)": lambda: (
        ViewFactorClosure.untrained().evaluate(**FREE)
    ),
    "closure.evaluate(..., blocked_fraction=1.2, blockers_per_line=0.3)": lambda: (
        ViewFactorClosure.untrained().evaluate(**FREE, blocked_fraction=1.2, blockers_per_line=0.3)
    ),
    "Packing([[0, 0, 0]], 1.0, periodic=(True, True, True))": lambda: Packing(
        [[0, 0, 0]], 1.0, periodic=(True, True, True)
    ),
    "Packing([[0, 0, 0]], 1.0, box=(1, 1, 1), periodic=(True, True, True))": lambda: Packing(
        [[0, 0, 0]], 1.0, box=(1, 1, 1), periodic=(True, True, True)
    ),
    "Plane((0, 0, 0), (0, 0, 0), 'floor')": lambda: Plane((0, 0, 0), (0, 0, 0), "floor"),
    "view_factors(bed, emitters=mask)": lambda: view_factors(
        Packing([[0, 0, 0]], 1.0), rays=10, emitters=np.array([True])
    ),
}


def rows(section: str) -> dict[str, str]:
    """Command or call -> sentence, as the page's table has them."""
    text = (ROOT / "docs/bad_input.md").read_text().split(f"## {section}")[1].split("\n## ")[0]
    return dict(re.findall(r"^\| `([^`]+)` \| (.+?) \|$", text, re.M))


@pytest.fixture(scope="module")
def bad_files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bad")
    for name, content in FILES.items():
        (folder / name).write_text(content)
    (folder / "bed.csv.gz").write_bytes(gzip.compress(FILES["bed.csv"].encode()))
    closure = bytearray(save(ViewFactorClosure.untrained(), folder / "good.closure").read_bytes())
    closure[3000] ^= 1
    (folder / "changed.closure").write_bytes(closure)
    case = (ROOT / "examples/heated_bed/case.toml").read_text()
    for name, old, new in (
        ("wrong_unit", "conductivity = 8.0", 'conductivity = "8 W"'),
        ("too_bright", "emissivity = 0.8", "emissivity = 1.8"),
    ):
        assert old in case
        (folder / f"{name}.toml").write_text(case.replace(old, new))
    study = (ROOT / "examples/calibration/twin.toml").read_text()
    for name, (old, new) in CALIBRATED.items():
        assert old in study
        (folder / f"{name}.toml").write_text(study.replace(old, new, 1))
    return folder


@pytest.mark.parametrize("command", COMMANDS)
def test_refusals_of_commands_are_as_printed(command, bad_files, monkeypatch, capsys):
    monkeypatch.chdir(bad_files)
    assert main(command.split()) == 2
    sentence = capsys.readouterr().err.strip().splitlines()[-1]
    verb = command.split()[0]
    assert sentence.startswith(f"greybed {verb}: ")
    assert rows("On the command line").get(command) == sentence.removeprefix(f"greybed {verb}: ")


@pytest.mark.parametrize("call", CALLS)
def test_refusals_of_calls_are_as_printed(call):
    with pytest.raises(GreybedError) as refusal:
        CALLS[call]()
    assert rows("In Python").get(call) == f"{type(refusal.value).__name__}: {refusal.value}"


def test_the_tables_hold_nothing_else():
    assert set(rows("On the command line")) == set(COMMANDS)
    assert set(rows("In Python")) == set(CALLS)
