"""Numbers as people read them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipelines.report.style import (
    figure_style,
    format_number,
    format_unit,
    log_ticks,
    printable,
    to_one_place,
    with_std,
)


@pytest.mark.parametrize(("value", "text"), [
    (None, "–"), (math.nan, "–"), (math.inf, "∞"), (-math.inf, "−∞"), (0.0, "0"), (-0.0, "0"), (0, "0"), (True, "yes"),
    (1.93, "1.93"), (2.0, "2"), (-2.5, "−2.5"), (0.012345, "0.01235"), (0.001, "0.001"), (123456.7, "123\u202f457"),
    (9999.6, "10\u202f000"), (60000, "60\u202f000"), (-60000, "−60\u202f000"), (1234, "1234"), (1.2e-5, "1.2 × 10⁻⁵"),
    (-3.1416e8, "−3.142 × 10⁸"), (np.float64(0.5), "0.5"), (np.int64(12345), "12\u202f345"), (np.bool_(True), "yes")])
def test_format_number(value: float | None, text: str) -> None:
    assert format_number(value) == text


@pytest.mark.parametrize(("value", "std", "text"), [
    (1.93, 0.02, "1.930 ± 0.020"), (0.0996, 0.0996, "0.10 ± 0.10"), (1.93, None, "1.93"), (1.93, 0.0, "1.93"),
    (1.93, math.inf, "1.93 ± ∞"), (None, 0.1, "–"), (1234.5, 123.0, "1230 ± 120"), (0.0, 0.02, "0.000 ± 0.020"),
    (-1e-9, 0.02, "0.000 ± 0.020"), (1.234e-5, 2e-7, "(1.234 ± 0.020) × 10⁻⁵"), (3.0, 40.0, "3 ± 40"),
    (-41.37, 0.5, "−41.37 ± 0.50"), (5.0e7, 1e5, "(5.000 ± 0.010) × 10⁷"), (1.0, 1e-14, "1 ± 1 × 10⁻¹⁴")])
def test_with_std(value: float | None, std: float | None, text: str) -> None:
    assert with_std(value, std) == text


@given(st.floats(), st.one_of(st.floats(min_value=0.0), st.just(math.nan)))
def test_every_pair_of_numbers_has_a_short_text(value: float, std: float) -> None:
    assert 0 < len(format_number(value)) <= 20
    assert 0 < len(with_std(value, std)) <= 50


@given(st.floats(-1e5, 1e5, allow_subnormal=False))
def test_four_digits_are_kept(value: float) -> None:
    text = format_number(value).replace("−", "-").replace("\u202f", "")
    for sign, plain in zip("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789", strict=True):
        text = text.replace(sign, plain)
    assert float(text.replace(" × 10", "e")) == pytest.approx(value, rel=5.1e-4, abs=1e-300)


def test_units_and_texts() -> None:
    assert [format_unit(u) for u in ("rad/s^2", "rad/s^4", "N m^-1")] == ["rad/s²", "rad/s⁴", "N m⁻¹"]
    assert printable("a\x1b[31m\udc80\nb") == "a[31m? b"


def test_a_row_of_errors_is_rounded_at_one_place() -> None:
    """Three digits of the largest, two of the smallest; what is none stays none."""
    assert to_one_place([0.08783, 0.23728, 0.009995]) == [0.0878, 0.2373, 0.0100]
    assert to_one_place([0.0, math.nan, 0.0]) == [0.0, None, 0.0]
    assert to_one_place([1234.5, 99.4]) == [1234.0, 99.0]
    assert to_one_place([]) == []


@pytest.mark.parametrize(("ends", "least"), [((0.3, 8.0), 2), ((0.2, 0.8), 2), ((1.1, 4.4), 2), ((3.0, 70.0), 2), ((1.0, 1e3), 4),
                                              ((4e-3, 0.08), 2)])
def test_a_logarithmic_axis_can_be_read(ends: tuple[float, float], least: int) -> None:
    """At least two labels in view, each of which reads as the number it stands at; powers of ten alone where they do."""
    with figure_style("test"):
        from matplotlib.figure import Figure

        axes = Figure().subplots()
        axes.set_yscale("log")
        axes.set_ylim(*ends)
        log_ticks(axes.yaxis)
        found = {}
        for minor in (False, True):
            places = axes.yaxis.get_minorticklocs() if minor else axes.yaxis.get_majorticklocs()
            words = (axes.yaxis.get_minor_formatter() if minor else axes.yaxis.get_major_formatter()).format_ticks(places)
            found |= {float(x): text for x, text in zip(places, words, strict=True) if text and ends[0] <= x <= ends[1]}
    assert len(found) >= least
    assert all(float(text) == pytest.approx(x) for x, text in found.items() if text[:2] != "10")
    assert not (any("⁻" in text for text in found.values()) and any("." in text for text in found.values()))  # one way of writing
    if least == 4:
        assert list(found.values()) == ["1", "10", "100", "1000"]
