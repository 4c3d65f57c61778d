"""Figures and table helpers that later reports share."""

import numpy as np
import pytest

from greybed.report import figures
from greybed.report.elements import (
    Commands,
    Page,
    Section,
    Text,
    Verdict,
    count,
    duration,
    fixed,
    listed,
    number,
    percent,
    table,
)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "–"), (0.0, "0"), (4000, "4,000"), (0.01234, "0.0123"), (1.2e-7, "1.20×10⁻⁷"),
        (1e-14, "10⁻¹⁴"), (-3.5, "−3.50"), (1234.5, "1,234"), (2.5e6, "2.50×10⁶"),
        (float("nan"), "not a number"), (float("-inf"), "−∞"), (np.float64(0.5), "0.500"),
    ],
)  # fmt: skip
def test_numbers(value, text):
    assert number(value) == text


def test_words():
    assert [duration(s) for s in (None, 0.42, 12.3, 59.9, 185.0, 7300.0)] == [
        "–", "0.4 s", "12 s", "1 min 0 s", "3 min 5 s", "2 h 1 min",
    ]  # fmt: skip
    assert [listed("abc"[:n]) for n in range(4)] == ["", "a", "a and b", "a, b and c"]
    assert (count(1, "bed"), count(2000, "bed")) == ("1 bed", "2,000 beds")
    assert (percent(0.0042), percent(None), fixed(-0.5, 2)) == ("0.42 %", "–", "−0.50")


def test_binned_medians():
    x = np.repeat([1.0, 10.0, 100.0], 20)
    middle, median = figures.binned(x, np.log10(x), bins=3)
    np.testing.assert_allclose(median, [0.0, 1.0, 2.0])
    np.testing.assert_allclose(middle, 10.0 ** np.array([1 / 3, 1.0, 5 / 3]))
    assert figures.binned([2.0, 2.0], [3.0, 5.0])[1] == [4.0]


@pytest.mark.parametrize("n", [0, 1, 300])
def test_parity_of_any_number_of_pairs(n):
    truth = np.geomspace(1e-5, 0.07, n)
    svg = figures.parity_figure(truth, 0.9 * truth - 1e-4, 0.1 * truth, name="a $b$ <c>")
    assert svg.startswith('<svg viewBox="')
    assert "a $b$ &lt;c&gt; predicted" in svg
    assert "var(--series-1)" in svg or n < 2
    assert "http" not in svg


def test_error_by_regime_draws_the_noise_only_where_it_is_known():
    truth = np.geomspace(1e-4, 0.07, 500)
    a = {"truth": truth, "predicted": 1.1 * truth, "phi": np.linspace(0.1, 0.6, 500)}
    assert "ray noise alone" not in figures.error_figure({"net": a})
    with_noise = a | {"truth_stderr": 0.01 * truth}
    svg = figures.error_figure({"net": a, "forest": with_noise}, "phi", xlabel="phi", log=False)
    assert "ray noise alone" in svg
    assert "forest" in svg


def test_a_figure_is_the_same_every_time():
    z = np.linspace(0.0, 1.0, 50)
    draw = [figures.difference_figure(z, z - 0.5, xlabel="T [K]") for _ in range(2)]
    assert draw[0] == draw[1]
    flat = figures.difference_figure(z, np.zeros(50), xlabel="T [K]")
    assert "svg" in flat


def test_another_report_in_a_few_lines():
    page = Page(
        "Drag",
        "What was done.",
        (Verdict("fine", "all", "good"),),
        (
            Section("a", "A", "", (Text("T<", "L"), table(("x", "y"), [["n", "1"]]))),
            Section("b", "B", "lead", (Commands((("ls <dir>", "lists"),)),)),
        ),
    )
    html = page.html()
    assert "<b>L</b> T&lt;" in html
    assert '<td class="word">n</td>' in html
    assert '<td class="num">1</td>' in html
    assert "<code>ls &lt;dir&gt;</code>" in html
