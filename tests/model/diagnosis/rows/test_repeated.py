"""Noise is what differs from period to period, whatever repeats beside it, and however rows fall on the period."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from pipelines.model.diagnosis.rows import repeated
from pipelines.model.diagnosis.rows.data import Data
from pipelines.model.diagnosis.rows.repeated import unrepeated

STEP, PERIOD = 0.008, 8.0


def rows(period: float | None, seconds: float, noise: float, rng: np.random.Generator,
         missing: slice = slice(0, 0)) -> tuple[Any, Any]:
    """One joint's log of which some rows are missing, and its residual: waves of the motion's period, and noise below a quarter of
    the rows' rate."""
    t = STEP * np.arange(round(seconds / STEP))
    white = np.fft.rfft(rng.normal(size=len(t)))
    white[max(len(white) // 2, 2):] = 0.0
    quiet = np.fft.irfft(white, n=len(t))
    x = noise * quiet / max(quiet.std(), 1e-9)
    x += 0.5 * np.sin(2 * np.pi * 3.0 * t / PERIOD) ** 3 + 0.2 * np.sign(np.sin(2 * np.pi * t / PERIOD + 0.3))
    kept = np.delete(np.arange(len(t)), missing)
    one = SimpleNamespace(log=SimpleNamespace(period=period), t=t[kept], weighed=np.ones((1, len(kept)), dtype=bool))
    return one, x[None, kept]


def found(*logs: tuple[Any, Any]) -> float:
    data: Any = SimpleNamespace(logs=[one for one, _ in logs], n_joints=1, split=lambda left: [x for _, x in logs])
    return float(unrepeated(cast(Data, data), np.zeros(0))[0])


@pytest.mark.parametrize("noise", [0.01, 0.3])
def test_noise_beside_what_repeats(noise: float) -> None:
    """Of two logs of two periods; what repeats is up to fifty times as large."""
    rng = np.random.default_rng(1)
    assert found(rows(PERIOD, 16.0, noise, rng), rows(PERIOD, 16.0, noise, rng)) == pytest.approx(noise**2, rel=0.15)


def test_a_period_that_is_no_whole_number_of_rows() -> None:
    """The rows of a log of 8.0036 s, which repeats after 8.0036 s: the noise between rows is told to a tenth."""
    rng = np.random.default_rng(2)
    one, x = rows(None, 16.0, 0.1, rng)
    one.log.period = PERIOD + 0.45 * STEP
    x = x - rows(None, 16.0, 0.0, rng)[1]  # noise alone: nothing repeats after another period
    assert found((one, x)) == pytest.approx(0.01, rel=0.15)


def test_rows_that_are_missing_have_no_pair() -> None:
    """Nor those beside them."""
    rng = np.random.default_rng(3)
    one, x = rows(PERIOD, 16.0, 0.05, rng, slice(300, 420))
    here, _ = repeated._a_period_later(one, x, PERIOD)
    assert 1000 - 2 * 120 - 10 < here.shape[1] < 1000 - 120
    assert found((one, x)) == pytest.approx(0.05**2, rel=0.2)


@pytest.mark.parametrize(("period", "seconds"), [(None, 16.0), (PERIOD, 8.5), (PERIOD, 0.024)])
def test_where_nothing_repeats_nobody_knows(period: float | None, seconds: float) -> None:
    assert np.isnan(found(rows(period, seconds, 0.1, np.random.default_rng(4))))


def test_rows_that_do_not_count_are_not_asked() -> None:
    rng = np.random.default_rng(5)
    one, x = rows(PERIOD, 16.0, 0.05, rng)
    one.weighed[0, 200:260] = False
    x[0, 200:260] = 40.0
    assert found((one, x)) == pytest.approx(0.05**2, rel=0.2)
