"""Numbers as people read them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipelines.report.style import (
    format_number,
    with_std,
)


@pytest.mark.parametrize(("value", "text"), [
    (None, "–"), (math.nan, "–"), (-math.inf, "−∞"), (True, "yes"), (-2.5, "−2.5"), (0.012345, "0.01235"),
    (123456.7, "123\u202f457"), (1.2e-5, "1.2 × 10⁻⁵"), (np.int64(12345), "12\u202f345")])
def test_format_number(value: float | None, text: str) -> None:
    assert format_number(value) == text


@pytest.mark.parametrize(("value", "std", "text"), [
    (1.93, 0.02, "1.930 ± 0.020"), (1.93, None, "1.93"), (1.93, math.inf, "1.93 ± ∞"), (1234.5, 123.0, "1230 ± 120"),
    (-1e-9, 0.02, "0.000 ± 0.020"), (1.234e-5, 2e-7, "(1.234 ± 0.020) × 10⁻⁵"), (3.0, 40.0, "3 ± 40")])
def test_with_std(value: float | None, std: float | None, text: str) -> None:
    assert with_std(value, std) == text
