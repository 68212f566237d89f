"""Numbers as people read them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipelines.report.style import (
    figure_style,
    format_number,
    log_ticks,
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
