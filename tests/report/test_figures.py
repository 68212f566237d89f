"""Figures tell the truth about long and damaged logs."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pipelines.errors import Check
from pipelines.report.figures import (
    envelope,
    joint_signal_figure,
)
from pipelines.report.render import render_report
from pipelines.report.report import Figure, Report, Section
from pipelines.report.sections import checks_table, level_tone

SIGNALS = arrays(np.float64, st.integers(0, 400), elements=st.one_of(
    st.floats(-1e3, 1e3), st.just(np.nan), st.just(np.inf)))


def drawn(figure: Figure) -> str:
    files = render_report(Report("", "", sections=(Section("", figures=(figure,)),)), {})
    return files[f"figures/{figure.name}.svg"].decode()


@given(SIGNALS, st.integers(2, 60))
def test_an_envelope_keeps_every_extreme_and_every_gap(x: np.ndarray, points: int) -> None:
    t = np.arange(x.size, dtype=float)
    small_t, small = envelope(t, x, points)
    assert small.size <= max(points, 7 * (points // 2 + 1), 0)
    assert (np.diff(small_t) >= 0.0).all()
    kept = np.isfinite(small)
    assert (small[kept] == x[small_t[kept].astype(int)]).all(), "a point that was never measured"
    assert np.isnan(small).any() == (~np.isfinite(x)).any()
    width = max(1, -(-x.size // (points // 2)))
    for start in range(0, x.size, width):
        part = x[start:start + width][np.isfinite(x[start:start + width])]
        inside = kept & (small_t >= start) & (small_t < start + width)
        if part.size:
            assert small[inside].min() == part.min()
            assert small[inside].max() == part.max()


@given(SIGNALS, st.integers(2, 60))
def test_an_envelope_draws_no_line_across_a_gap(x: np.ndarray, points: int) -> None:
    small_t, small = envelope(np.arange(x.size, dtype=float), x, points)
    for (t0, t1), (x0, x1) in zip(pairwise(small_t), pairwise(small), strict=True):
        if np.isfinite(x0) and np.isfinite(x1):
            assert np.isfinite(x[int(t0):int(t1) + 1]).all()


TIMES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "even": lambda t: t, "backwards": lambda t: t[::-1], "constant": lambda t: t * 0.0, "missing": lambda t: t * np.nan,
    "one missing": lambda t: np.where(t == t[3], np.nan, t), "huge": lambda t: t * 1e300, "jumps": lambda t: t % 0.1}
VALUES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "signal": np.sin, "all missing": lambda t: t * np.nan, "infinite": lambda t: t * np.inf, "zero": lambda t: t * 0.0,
    "huge spike": lambda t: np.where(t == t[5], 1e308, np.sin(t)), "far and small": lambda t: 1e6 + 1e-9 * np.sin(t)}


USUAL = [("backwards", "signal"), ("missing", "signal"), ("huge", "signal"), ("even", "infinite"), ("even", "huge spike"),
         ("jumps", "all missing")]
RARE = [pair for pair in (*((times, "signal") for times in TIMES), *(("even", values) for values in VALUES)) if pair not in USUAL]


@pytest.mark.parametrize(("times", "values"), [*USUAL, *(pytest.param(*pair, marks=pytest.mark.slow) for pair in RARE)])
@pytest.mark.filterwarnings("ignore:invalid value encountered in multiply:RuntimeWarning")
def test_a_damaged_log_can_be_drawn(times: str, values: str) -> None:
    base = np.arange(2000) / 1000.0
    t, x = TIMES[times](base), VALUES[values](base)[:, None]
    assert "<path" in drawn(joint_signal_figure("a", "", t, x, "position [rad]", flagged=~np.isfinite(x)))


def test_the_worst_check_comes_first_and_sets_the_tone() -> None:
    checks = [Check.of("F01", "ok", "fine"), Check.of("T05", "repair", "gap"), Check.of("S02", "reject", "missing")]
    table = checks_table(checks)
    assert [str(row[-1]).split()[0] for row in table.rows] == ["RRID-S02", "RRID-T05", "RRID-F01"]
    assert table.rows[1][-1] == "RRID-T05 uneven sampling"
    assert table.tones == ("bad", "attention", "good")
    assert level_tone(check.level for check in checks) == "bad"
    assert level_tone(()) == "good"
