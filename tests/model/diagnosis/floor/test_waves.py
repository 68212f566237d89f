"""Noise has no line along an angle: waves are taken out of it, and it stays as it was."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.floor.drive_noise import white
from pipelines.model.diagnosis.floor.waves import without_waves
from pipelines.model.diagnosis.given.clean import clean
from pipelines.model.diagnosis.screened.candidates import families, whole_motion
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.search import provisional
from pipelines.model.rigid.body import Motion
from tests.diagnose.sessions import but
from tests.model.diagnosis.arms import hidden

ROWS, STEP = 1500, 8e-3  # [s]


def rows_of(q: np.ndarray, *logs: np.ndarray) -> Any:
    """Data of one joint that moves like `q` (rows,) in each of `logs`."""
    one = SimpleNamespace(at_rows=lambda x: x, motion=SimpleNamespace(q=q[:, None]))
    return SimpleNamespace(n_joints=1, logs=[one] * len(logs), split=lambda x: iter(x.reshape(len(logs), 1, -1)))


@pytest.fixture
def angle() -> np.ndarray:
    t = STEP * np.arange(ROWS)
    return np.asarray(0.9 * np.sin(1.3 * t) + 0.6 * np.sin(2.9 * t + 1.0))


def noise(seed: int) -> np.ndarray:
    return 5e-3 * np.random.default_rng(seed).standard_normal(ROWS)


def test_a_ripple_and_its_harmonic_are_taken_out_and_the_noise_is_left(angle: np.ndarray) -> None:
    """0.1 N m of order 35, of another phase in the second log, and a third of it of order 70, under 5 mN m of noise."""
    drawn = [noise(1), noise(2)]
    ripple = [0.1 * np.sin(35.0 * angle + turn) + 0.035 * np.sin(70.0 * angle + 0.7) for turn in (0.3, 2.0)]
    logs = [x + y for x, y in zip(drawn, ripple, strict=True)]
    rest = without_waves(rows_of(angle, *logs), np.concatenate(logs))
    assert np.sqrt(np.mean(rest**2)) == pytest.approx(5e-3, rel=0.1)
    assert np.corrcoef(rest, np.concatenate(drawn))[0, 1] > 0.95


def test_noise_alone_is_left_alone(angle: np.ndarray) -> None:
    for seed in range(10):
        drawn = noise(seed)
        assert np.array_equal(without_waves(rows_of(angle, drawn), drawn), drawn)


def test_a_joint_at_rest_has_no_angle_to_speak_of() -> None:
    drawn = noise(1)
    assert np.array_equal(without_waves(rows_of(np.full(ROWS, 0.3), drawn), drawn), drawn)


def ripple(motion: Motion) -> np.ndarray:
    """0.1 N m at joint 3, 35 waves a turn, and a third of it with twice as many."""
    out = np.zeros_like(motion.q)
    out[:, 2] = 0.1 * np.sin(35.0 * motion.q[:, 2] + 0.3) + 0.035 * np.sin(70.0 * motion.q[:, 2] + 0.7)
    return out


def test_a_ripple_that_nobody_looks_for_is_no_noise_of_the_drive() -> None:
    """The twin would be as noisy as the ripple is quick, and nothing stand out of it."""
    seen = []
    for load in (None, ripple):
        prepared = prepare(Logs((hidden(1, load), hidden(2, load))), DiagnosisSettings())
        columns, fit = fit_nominal(prepared.data, prepared.columns)
        model = Exact.start(columns, fit)
        every = families(columns.laws, whole_motion(prepared.data), model.arm, but("torque_offset", "quadratic_drag"))
        rough = provisional(Case(prepared.data, None, model, fit.weight, every, None))
        seen.append(white(prepared.data, clean(rough[-1])))
    assert (seen[1] < 3.0 * seen[0]).all()  # fifteen times as much with the ripple in it


@pytest.mark.parametrize("rows", [40, 80, 106, 220])
def test_of_few_rows_noise_is_left_as_it_is(rows: int) -> None:
    """Of a thousand waves through a hundred samples of noise the best takes a quarter of their power, and is none."""
    t = 0.1 * np.arange(rows)
    angle = 0.9 * np.sin(1.3 * t) + 0.6 * np.sin(2.9 * t + 1.0)
    drawn = np.random.default_rng(rows).standard_normal((40, rows))
    kept = np.array([np.sum(without_waves(rows_of(angle, x), x)**2) / np.sum(x**2) for x in drawn])
    assert np.mean(kept < 1.0) <= 0.05
