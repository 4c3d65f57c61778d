"""The quickstart page: complete, self-contained, escaped, honest on what failed or did not run."""

import base64
import re
from copy import deepcopy
from html.parser import HTMLParser

import numpy as np
import pytest

from greybed.core.files import OutputError
from greybed.report import picture, render_page

NAME = "viewfactor_mlp_pencil"
SCORE = {
    "r2": 0.9971, "r2_ci95": [0.9962, 0.9978], "r2_noise": 0.9991, "rmse": 4e-4, "mae": 1e-4,
    "bias": -3e-6, "mape_above_1e-2": 0.021, "mape_above_1e-3": 0.057, "negative": 0,
    "above_exact": 0, "unobstructed_error": 2e-16, "unobstructed_pairs": 10, "coverage95": 0.957,
    "extrapolated": 0.004, "rows": 4000, "pairs": 2100, "packings": 6,
}  # fmt: skip
SIDE = {
    "seconds": 3.0, "mean_K": 700.0, "min_K": 500.0, "max_K": 1000.0, "energy_error": 1e-13,
    "wall_heat_W": {"floor": {"conduction": 1.5, "radiation": 20.0}},
}  # fmt: skip
RESULTS = {
    "version": "9.8.7",
    "seed": 5,
    "machine": {"processors": 2, "python": "3.11.7", "system": "Linux"},
    "seconds": 75.0,
    "beds": [{"name": "mono", "file": "m.dump", "spheres": 60, "radii_mm": [1.5], "overlaps": 0,
              "largest_overlap": 0.0, "solid_fraction": 0.6, "coordination": 5.9}],
    "dataset": {"file": "v.h5", "rows": 12345, "fractions": [0.1, 0.6], "sizes": ["mono:1mm"],
                "packings": {"train": 27, "calibrate": 4, "test": 6}, "data_sha256": "ab" * 32,
                "seconds": 9.0},
    "closures": [{"name": NAME, "file": "c.closure", "kind": "mlp", "markers": "pencil",
                  "hash": "cd", "seconds": 4.0, "score": SCORE}],
    "limits": [{"closure": NAME, "case": "nothing between: F <= F_exact", "bound": 1e-14,
                "errors": {"untrained": 3e-16, "trained": 0.0, "reloaded": 0.0, "C++": None},
                "passed": True}],
    "exports": [{"closure": NAME, "target": "cpp", "file": "c.hpp", "max_relative_error": 2e-15,
                 "rows": 512, "bound": 1e-12, "seconds": 2.0, "note": ""}],
    "cases": [{"bed": "mono", "spheres": 60, "emissivity": 0.9,
               "wall_temperatures": {"floor": 1073.15}, "traced": {**SIDE, "rays": 20000},
               "closure": {**SIDE, "closure": NAME, "extrapolated": 0.01},
               "difference": {"rms_K": 0.5, "max_K": 2.25, "span_K": 500.0,
                              "flux_relative": {"floor": 0.004}}}],
    "timings": [{"stage": "beds", "seconds": 1.0}, {"stage": "dataset", "seconds": 70.0}],
    "files": [{"path": "report.html", "what": "this page"}],
    "next": [{"command": "greybed check c.closure", "what": "the limits of a closure"}],
    "notes": ["No compiler was found."],
}  # fmt: skip


def make_arrays():
    rng = np.random.default_rng(0)
    truth = 10 ** rng.uniform(-4, -1.2, 400)
    t = rng.uniform(500.0, 1000.0, 60)
    return {
        f"parity_{NAME}": {
            "truth": truth,
            "predicted": truth * rng.normal(1.0, 0.05, 400),
            "stderr": 0.05 * truth,
            "solid_fraction": rng.uniform(0.1, 0.6, 400),
        },
        "bed_mono": {
            "centres": rng.uniform(-5e-3, 5e-3, (60, 3)),
            "radii": np.full(60, 1e-3),
            "traced": t,
            "closure": t + rng.normal(0, 1, 60),
        },
    }


class Reader(HTMLParser):
    """Collects what a page refers to, its ids, its visible text, and whether tags match."""

    VOID = frozenset({"meta", "img", "br", "link", "input", "wbr"})

    def __init__(self, html):
        super().__init__()
        self.references, self.ids, self.tags, self.open, self.texts = [], [], [], [], []
        self.feed(html)
        assert not self.open

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        if tag not in self.VOID:
            self.open.append(tag)
        for name, value in attributes:
            if name in ("src", "href", "xlink:href", "action", "data"):
                self.references.append(value)
            if name == "id":
                self.ids.append(value)

    def handle_startendtag(self, tag, attributes):
        self.handle_starttag(tag, attributes)
        if tag not in self.VOID:
            self.open.pop()

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not self.open or self.open[-1] not in ("style", "script"):
            self.texts.append(data)

    @property
    def text(self):
        return re.sub(r"\s+", " ", " ".join(self.texts))


@pytest.fixture(scope="module", autouse=True)
def coarse_pictures():
    """One ray a pixel: these tests look at the page, not at the edges in its pictures."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(picture, "SUPERSAMPLING", 1)
        yield


@pytest.fixture(scope="module")
def full(tmp_path_factory):
    path = render_page(RESULTS, make_arrays(), tmp_path_factory.mktemp("page") / "report.html")
    return path.read_text(encoding="utf-8")


def test_nothing_is_fetched_from_elsewhere(full):
    references = Reader(full).references
    assert references
    assert all(r.startswith(("data:", "#")) for r in references)
    assert not re.findall(r"@import|url\((?!#)", full)
    assert "default-src 'none'" in full


def test_every_reference_inside_the_page_has_its_target_and_ids_are_unique(full):
    reader = Reader(full)
    assert len(reader.ids) == len(set(reader.ids))
    targets = [r[1:] for r in reader.references if r.startswith("#")]
    targets += re.findall(r"url\(#([^)]*)\)", full)
    assert set(targets) <= set(reader.ids)


def test_pictures_and_figures_are_there(full):
    uris = [r for r in Reader(full).references if r.startswith("data:image/png;base64,")]
    pictures = [base64.b64decode(u.split(",")[1]) for u in uris]
    assert len(pictures) == 4  # traced, closure, difference, and the cloud of dots
    assert all(p.startswith(b"\x89PNG") and len(p) > 2000 for p in pictures)
    assert Reader(full).tags.count("svg") == 5  # two profiles, parity, two regimes
    assert "#0102" not in full
    assert "#0103" not in full
    assert len(full) < 4e6


def test_the_outcome_stands_in_plain_words(full):
    text = Reader(full).text
    for words in (
        "1 view-factor closure from 37 ray-traced packings, put to work in 1 heated bed",
        "✓ All limits hold", "R² 0.9971", "95 %: 0.9962 to 0.9978", "2.25 K off at most",
        "✓ 1 export agrees", "walls: floor 800 °C", "426.9", "not run", "✓ holds", "0.9991",
        "1 min 10 s", "greybed check c.closure", "No compiler was found.", "12,345",
        "3.0×10⁻¹⁶", "abababababababab",
    ):  # fmt: skip
        assert words in text, words


def test_failures_are_told(tmp_path):
    results = deepcopy(RESULTS)
    results["limits"].append({**results["limits"][0], "passed": False, "errors": {"ONNX": 2e-5}})
    results["limits"].append(
        {**results["limits"][0], "errors": {"ONNX": 4e-8}, "bounds": {"ONNX": 1e-6}}
    )
    results["limits"].append({**results["limits"][0], "passed": False, "errors": {"ONNX": np.nan}})
    results["exports"][0]["max_relative_error"] = 1e-3
    text = Reader(render_page(results, {}, tmp_path / "p.html").read_text()).text
    for words in (
        "✗ 2 of 4 limits fail", "✗ fails: 2.0×10⁻⁵", "✓ 4.0×10⁻⁸ bound 10⁻⁶", "2 of 4 fail",
        "✗ fails: not a number", "✗ 1 of 1 export wrong", "✗ differs",
    ):  # fmt: skip
        assert words in text, words


def without_floats(value):
    """The same results with None for every measured number."""
    if isinstance(value, dict):
        return {k: without_floats(v) for k, v in value.items()}
    if isinstance(value, list):
        return [without_floats(v) for v in value if not isinstance(v, float)]
    return None if isinstance(value, float) else value


@pytest.mark.parametrize("results", [{}, {"version": "1", "limits": [], "closures": None}])
def test_a_page_of_nothing(tmp_path, results):
    text = Reader(render_page(results, {}, tmp_path / "p.html").read_text()).text
    assert "No limits checked" in text


def test_unknown_numbers_leave_gaps(tmp_path):
    results = without_floats(RESULTS)
    results["closures"][0]["score"]["r2_ci95"] = None
    text = Reader(render_page(results, make_arrays(), tmp_path / "p.html").read_text()).text
    assert "None" not in text
    assert "not replayed" in text
    assert "– K" not in text


def test_missing_parts_leave_gaps(tmp_path):
    results = deepcopy(RESULTS)
    del results["machine"], results["notes"], results["closures"][0]["score"]["r2_ci95"]
    results["closures"].append({"name": "other", "score": None})
    results["exports"].append({"closure": NAME, "target": "onnx", "max_relative_error": None})
    results["cases"].append({"bed": "gone", "spheres": 3, "traced": None, "closure": None})
    results["cases"][0]["traced"]["mean_K"] = None
    arrays = make_arrays()
    del arrays["bed_mono"], arrays[f"parity_{NAME}"]["solid_fraction"]
    del arrays[f"parity_{NAME}"]["stderr"]
    text = Reader(render_page(results, arrays, tmp_path / "p.html").read_text()).text
    assert "not replayed" in text
    assert "Gone bed." in text
    assert "Error by density" not in text


def test_everything_is_escaped(tmp_path):
    evil = "<script>alert('x & $y$')</script>\""
    results = deepcopy(RESULTS)
    results["closures"][0]["name"] = results["limits"][0]["closure"] = evil
    results["cases"][0]["closure"]["closure"] = evil
    results["limits"][0]["case"] = results["notes"][0] = results["version"] = evil
    results["next"][0]["command"] = results["files"][0]["path"] = evil
    results["cases"][0]["wall_temperatures"] = {evil: 300.0}
    arrays = {f"parity_{evil}": make_arrays()[f"parity_{NAME}"]}
    html = render_page(results, arrays, tmp_path / "p.html").read_text()
    assert html.count("<script>") == 1
    assert "alert('x" not in html.replace("&#39;", "'").split("<script>")[1].split("<body>")[0]
    reader = Reader(html)
    assert reader.tags.count("script") == 1
    assert reader.text.count(evil) >= 8


def test_a_folder_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(OutputError, match="cannot write this file"):
        render_page({}, {}, tmp_path / "missing" / "p.html")
