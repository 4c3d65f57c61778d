"""Strict cases: what is read, and that every refusal names file, key, value, bound and remedy."""

from dataclasses import dataclass
from pathlib import Path

import pytest

from greybed.core import InputError
from greybed.core.config import choice, quantity, read_case, read_toml, tables, vector, whole


@dataclass(frozen=True, kw_only=True)
class Ball:
    radius: float = quantity("length", above=0.0, at_most=1.0)


@dataclass(frozen=True, kw_only=True)
class Cube:
    edge: float = quantity("length", 1.0)


@dataclass(frozen=True, kw_only=True)
class Inner:
    temperature: float | None = quantity("temperature", None, above=0.0)
    rays: int = whole(5, at_least=1, at_most=10)


@dataclass(frozen=True, kw_only=True)
class Case:
    title: str = "none"
    fast: bool = False
    count: int = 1
    mode: str = choice(("steady", "transient"))
    file: Path | None = None
    point: tuple[float, float, float] = vector("length", (0.0, 0.0, 0.0))
    inner: Inner = Inner()
    body: tuple[Ball | Cube, ...] = tables("kind", {"ball": Ball, "cube": Cube}, ())

    def __post_init__(self) -> None:
        if self.title == "bad":
            raise InputError("title is bad; choose another.")


@pytest.fixture
def read(tmp_path):
    def run(text):
        path = tmp_path / "case.toml"
        path.write_text(text)
        return read_case(path, Case)

    return run


FULL = """
title = "a bed"
fast = true
count = 3
mode = "steady"
file = "bed.dump"
point = ["1 mm", 0, 2.5]
[inner]
temperature = "800 degC"
rays = 7
[[body]]
kind = "ball"
radius = "1.5 mm"
[[body]]
kind = "cube"
edge = 2
"""


def test_everything_is_read_in_base_si(read, tmp_path):
    case = read(FULL)
    assert case.inner == Inner(temperature=pytest.approx(1073.15), rays=7)
    assert case.body == (Ball(radius=pytest.approx(0.0015)), Cube(edge=2.0))
    assert case.point == pytest.approx((1e-3, 0.0, 2.5))
    assert case.file == tmp_path / "bed.dump"
    assert (case.title, case.fast, case.count) == ("a bed", True, 3)
    assert isinstance(case.body[1].edge, float)


def test_defaults(read):
    assert read('mode = "steady"') == Case(mode="steady")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            'mode = "steady"\ntitel = "x"',
            r"case.toml: titel is not a known key; did you mean 'title'",
        ),
        ('mode = "steady"\nzzz = 1', r"zzz is not a known key; known are title, fast"),
        ('mode = "steady"\n[inner]\nray = 3', r"inner.ray is not a known key; did you mean 'rays'"),
        ("", r"mode is missing; give one of 'steady', 'transient'"),
        ('mode = "stedy"', r"mode = 'stedy' must be one of .*did you mean 'steady'"),
        ('mode = "steady"\nfast = 1', r"fast = 1 must be true or false"),
        ('mode = "steady"\ncount = true', r"count = True is not a whole number"),
        ('mode = "steady"\ncount = 1.5', r"count = 1.5 must be a whole number"),
        ('mode = "steady"\ntitle = 5', r"title = 5 must be a string"),
        ('mode = "steady"\nfile = 5', r"file = 5 must be a path"),
        ('mode = "steady"\npoint = [1, 2]', r"point = \[1, 2\] must be three numbers"),
        ('mode = "steady"\ninner = 5', r"inner = 5 must be a table; write it as \[inner\]"),
        ('mode = "steady"\nbody = 5', r"body must be a list of tables; .* \[\[body\]\]"),
        ('mode = "steady"\n[[body]]\nradius = 1', r"body\[0\].kind is missing; .*'ball', 'cube'"),
        ('mode = "steady"\n[[body]]\nkind = "bal"', r"kind = 'bal' .* did you mean 'ball'"),
        (
            'mode = "steady"\n[[body]]\nkind = "ball"',
            r"body\[0\].radius is missing; .*length \[m\]",
        ),
        (
            'mode = "steady"\n[[body]]\nkind = "ball"\nradius = 0',
            r"radius = 0 \[m\] must be above 0",
        ),
        ('mode = "steady"\n[[body]]\nkind = "ball"\nradius = 2.0', r"radius = 2 .* at most 1"),
        (
            'mode = "steady"\n[[body]]\nkind = "ball"\nradius = nan',
            r"radius = nan \[m\] must be fin",
        ),
        (
            'mode = "steady"\n[[body]]\nkind = "ball"\nradius = true',
            r"radius = True must be a length",
        ),
        (
            'mode = "steady"\n[[body]]\nkind = "ball"\nradius = "1 kg"',
            r"body\[0\].radius: .*length",
        ),
        ('mode = "steady"\n[inner]\nrays = 0', r"rays = 0 \[-\] must be at least 1 and at most 10"),
        ('mode = "steady"\n[inner]\ntemperature = "-300 degC"', r"-26.85 \[K\] must be above 0"),
        ('mode = "steady"\ntitle = "bad"', r"case.toml: title is bad"),
        ("mode = = 1", r"case.toml: not valid TOML \(.*line 1"),
    ],
)
def test_refusals(read, text, message):
    with pytest.raises(InputError, match=message) as caught:
        read(text)
    assert "\n" not in str(caught.value)


def test_missing_or_binary_file_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"no.toml: cannot read this case \(No such file"):
        read_toml(tmp_path / "no.toml")
    (tmp_path / "b.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not valid TOML"):
        read_toml(tmp_path / "b.toml")


def test_a_path_with_a_null_is_refused():
    with pytest.raises(InputError, match=r"a\\0b\.toml: cannot read this case .*null"):
        read_toml("a\0b.toml")


def test_a_number_too_large_for_a_float_is_refused(tmp_path):
    path = tmp_path / "case.toml"
    path.write_text(f'mode = "steady"\n[inner]\ntemperature = {"9" * 400}\n')
    with pytest.raises(InputError, match=r"inner\.temperature = 9+ \[K\] must be finite"):
        read_case(path, Case)
    path.write_text(f'mode = "steady"\n[inner]\nrays = {"9" * 400}\n')
    with pytest.raises(InputError, match=r"inner\.rays = 9+ \[-\] must be at least 1 and at most"):
        read_case(path, Case)
