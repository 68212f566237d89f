"""What is taken of a log: constant speed alone, without the reference; and what cannot be used is said, with what to record."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pipelines.errors import InputRejected
from pipelines.frequency.responses import measured_responses
from pipelines.frequency.signals import excitation_period, turned_joint
from pipelines.io.log import ExperimentLog, Signal
from tests.frf.loops import Loop, rigid

LOOP = Loop(rigid(1.0), seconds=20.0)


def test_reversal_and_reference_are_left_out() -> None:
    """Two stretches, forwards and backwards, each at the speed of the turn; what is left of the position is small."""
    log = LOOP.log()
    turned = turned_joint(log)
    assert [s.direction for s in turned.stretches] == [1, -1]
    for stretch in turned.stretches:
        np.testing.assert_allclose(np.abs(log["dq_ref"][stretch.start:stretch.stop, 0]), 0.3, rtol=0.03)
        assert np.abs(stretch.signals[:, turned.position]).max() < 0.02 < np.ptp(log.q[:, 0])
    assert turned.speed == pytest.approx(0.3, rel=1e-3)
    assert 0.1 < turned.left_out < 0.3


@pytest.mark.parametrize("period", [2000, 1024, None])
def test_the_period_of_v_is_found(period: int | None) -> None:
    """With and without its being declared; noise has none."""
    v = replace(LOOP, period=period).log()["v"][:, 0]
    assert excitation_period(v, None, 1e-3) == period
    assert excitation_period(v, 2.0, 1e-3) == period
    assert excitation_period(v, 0.7, 1e-3) == period


def _without(name: str) -> Callable[[ExperimentLog], ExperimentLog]:
    return lambda log: replace(log, signals={k: s for k, s in log.signals.items() if k != name})


def _jittery(log: ExperimentLog) -> ExperimentLog:
    t = log.t + 2e-4 * np.random.default_rng(3).uniform(-1.0, 1.0, log.n_samples)
    return replace(log, signals={**log.signals, "t": Signal(t, "s", "time")})


def _still(log: ExperimentLog) -> ExperimentLog:
    return replace(log, signals={**log.signals, "v": Signal(0.0 * log["v"], "rad/s^2", "excitation")})


def _no_input(log: ExperimentLog) -> ExperimentLog:
    return replace(log, signals={**log.signals, "r": Signal(0.0 * log["r"], "rad/s^2", "input")})


def _short(log: ExperimentLog) -> ExperimentLog:
    return replace(log, signals={k: Signal(s.values[:1500], s.units, s.long_name) for k, s in log.signals.items()})


@pytest.mark.parametrize(("spoil", "code", "words"), [
    (_without("v"), "S01", "record v"), (_without("r"), "S01", "record r"), (_without("q_ref"), "S01", "record q_ref"), (lambda log: replace(log, joint=None), "S01", "joint"),
    (_jittery, "T05", "timer"), (_still, "D09", "multisine"), (_no_input, "D04", "channel"), (_short, "T08", "20 s each way")])
def test_what_cannot_be_used_is_said(spoil: Callable[[ExperimentLog], ExperimentLog], code: str, words: str) -> None:
    """The code of the table of bad inputs, and what to record."""
    with pytest.raises(InputRejected) as caught:
        turned_joint(spoil(LOOP.log()))
    assert caught.value.code == f"RRID-{code}"
    assert words in caught.value.remedy


def test_only_like_logs_are_averaged() -> None:
    """Two realisations make one response; another gain or another posture makes a second one."""
    log = LOOP.log()
    twin = replace(LOOP, seed=2).log(name="second")
    (one,) = measured_responses([log, twin])
    assert [t.name for t in one.turned] == ["turned", "second"]
    other = replace(LOOP, kp=300.0).log()
    assert len(measured_responses([log, other])) == 2
    for v in (None, 1000):  # noise, or other lines
        assert len(measured_responses([log, replace(LOOP, period=v).log()])) == 2
    assert len(measured_responses([log, replace(LOOP, odd=True).log()])) == 2
