"""The figure that proves a finding is drawn over what the cause depends on."""

from __future__ import annotations

import re
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.effects.angle import Cogging
from pipelines.estimation.estimate import Recipe
from pipelines.estimation.exact_model import Exact
from pipelines.estimation.model_fit import refine
from pipelines.estimation.nominal_fit import fit_nominal
from pipelines.estimation.preparation import Logs, prepare
from pipelines.estimation.residual_analysis import _fine_enough, binned, proof
from pipelines.report.diagnosis_finding import proof_figures
from tests.diagnosis.rotor import turned
from tests.report.test_diagnosis_words import found

_RINGS = 20.0  # [Hz]


def test_a_wave_of_the_angle_is_shown_over_the_angle() -> None:
    """A rotor that turns once, one way, tells the same over time; what it does then is what it does there."""
    prepared = prepare(Logs((turned(1, {7.0: 0.04, 28.0: 0.03}, 0.0),)), Recipe(cutoff_hz=40.0))
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    before = refine(Exact.start(columns, fit), prepared.data, fit.weight)
    waves = before.model.with_effect(Cogging(joint=1, order=7.0, harmonics=1), np.array([0.04, 0.0]))
    assert proof(before, refine(waves, prepared.data, fit.weight), 1).against == "position"


def test_what_rings_is_shown_over_frequency() -> None:
    """At 20 Hz, now stronger and now weaker, wherever the joint is: no signal tells it, and its line stands at its frequency."""
    log = turned(1, {}, 0.0)
    rng = np.random.default_rng(20261126)
    strength = np.interp(log.t, np.linspace(log.t[0], log.t[-1], 200), rng.standard_normal(200))
    ringing = 0.05 * strength * np.sin(2.0 * np.pi * _RINGS * log.t)
    rung = replace(log, signals=log.signals | {"tau": replace(log.signals["tau"], values=log.tau + ringing[:, None])})
    prepared = prepare(Logs((rung,)), Recipe(cutoff_hz=40.0))
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    before = refine(Exact.start(columns, fit), prepared.data, fit.weight)
    (rows,) = prepared.data.logs
    after: Any = SimpleNamespace(left=before.left - np.interp(rows.t, log.t, ringing))
    shown = proof(before, after, 1)
    assert (shown.against, shown.unit) == ("frequency", "Hz")
    for line in (shown.before, shown.predicted):
        assert abs(np.average(shown.x, weights=line**2) - _RINGS) < 2.0  # the line is as wide as its strength changes fast
    beside = np.abs(shown.x - _RINGS) < 2.0
    assert shown.after[beside].max() < 0.2 * shown.before[beside].max()
    caption = proof_figures(1, replace(found("base_resonance"), proof=shown))[0].caption
    size = re.search(r"amplitudes in the log .*: ([0-9.]+) N m rms without", caption)
    assert size is not None
    assert float(size[1]) == pytest.approx(float(before.rms[0]), rel=0.1)


def test_a_wave_has_eight_bins_a_period() -> None:
    """Of 15 periods in 300 rows, at uneven angles: bins of four rows are five a period, and cut its peaks."""
    rng = np.random.default_rng(20261127)
    q = np.sort(rng.uniform(0.0, 5.2, 300))
    wave = np.sin(18.0 * q)
    assert _fine_enough(q, wave) >= 8 * 15
    assert np.abs(binned(q, wave, _fine_enough(q, wave), 2).mean).max() > 0.95
    assert _fine_enough(np.sort(rng.uniform(0.0, 5.2, 6000)), np.sin(36.0 * q.repeat(20))) >= 8 * 30


@pytest.mark.parametrize("height", [0.0, 0.3, 1.0])
def test_what_scatters_makes_no_bins_finer(height: float) -> None:
    """Nor does what is alike all over: fewer rows a bin would show chance."""
    rng = np.random.default_rng(20261128)
    q = np.sort(rng.uniform(0.0, 5.2, 4000))
    assert {_fine_enough(q, height * np.sin(q) + rng.standard_normal(len(q))) for _ in range(50)} == {96}
    assert _fine_enough(q[:300], np.ones(300)) == 75


def test_what_happened_once_is_shown_over_the_time_of_its_log() -> None:
    """A blow of a tenth of a second in one of two logs, as high as it was and when it was: other logs say nothing of it, and an
    angle even less."""
    log = turned(1, {}, 0.0)
    prepared = prepare(Logs((log, replace(log, name="again"))), Recipe(cutoff_hz=40.0))
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    before = refine(Exact.start(columns, fit), prepared.data, fit.weight)
    first, second = prepared.data.logs
    when = float(second.t[second.rows // 3])
    blow = np.where(np.abs(second.t - when) < 0.05, 3.0, 0.0)
    after: Any = SimpleNamespace(left=before.left - np.concatenate([np.zeros(first.rows), blow]))
    shown = proof(before, after, 1, 1)
    assert (shown.against, shown.unit) == ("time", "s")
    assert shown.predicted.max() > 2.7
    assert abs(shown.x[np.argmax(shown.predicted)] - when) < 0.1
    assert shown.x[-1] <= second.t[-1]
    caption = proof_figures(1, replace(found("contact"), proof=shown, log="again"))[0].caption
    assert caption.startswith("Residual of joint 1 over the time of again, means in bins: ")
    angle: Any = SimpleNamespace(left=before.left - np.tile(np.where(first.at_rows(first.motion.q)[:, 0] > 9.0, 1.0, 0.0), 2))
    assert proof(before, angle, 1).against == "position"
    assert proof(before, angle, 1, event=True).against == "time"
