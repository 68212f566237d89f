"""Logs agree on the size of a cause, or the parts of one log: a ripple that is there for half of it is none of the machine."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.log.experiment import ExperimentLog
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.fitted.refit import refine
from pipelines.model.diagnosis.named.findings import agreement, unlike
from pipelines.model.effects.backlash import Backlash
from pipelines.model.effects.cogging import Cogging
from tests.model.diagnosis.screened.test_through import turned

_SETTINGS = DiagnosisSettings(replicas=0, cutoff_hz=40.0)
_WAVES = {7.0: 0.04}


def rippled(share: float) -> ExperimentLog:
    """A rotor with a ripple of seven waves a turn for the first part of the log, and none after it."""
    with_it, without = (turned(1, waves, 0.0) for waves in (_WAVES, {}))
    there = (np.arange(with_it.n_samples) < share * with_it.n_samples)[:, None]
    tau = with_it.signals["tau"]
    return replace(with_it, signals={**with_it.signals, "tau": replace(tau, values=np.where(there, with_it.tau, without.tau))})


@pytest.mark.parametrize(("share", "agree"), [(1.0, True), (0.5, False)])
def test_parts_of_one_log_are_asked_where_there_is_no_other(share: float, agree: bool) -> None:
    prepared = prepare(Logs((rippled(share),)), _SETTINGS)
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    before = refine(Exact.start(columns, fit), prepared.data, fit.weight)
    ripple = Cogging(joint=1, order=7.0, harmonics=1)
    done = refine(before.model.with_effect(ripple, np.array([0.02, 0.01])), prepared.data, fit.weight)
    scales = np.array(agreement(done, 0, prepared))
    said = unlike(before, done, 0, prepared, 10)
    if agree:
        assert np.abs(scales - 1.0).max() < 0.05
        assert not said
    else:
        assert (scales < 0.2).any()
        assert (scales > 1.5).any()
        assert "parts of the log do not agree" in said or "larger" in said


@pytest.mark.parametrize(("held", "asked"), [(0, True), (100, True), (400, False)])
def test_a_log_that_hardly_shows_a_cause_is_not_asked_for_its_size(held: int, asked: bool) -> None:
    """Its power is 260 in 100 rows, in units of their noise; asked is from 90 on, and where noise is twice as loud from 360 on.
    Rows of joints that are held make it no quieter."""
    rows = np.r_[np.ones(100), np.zeros(held)]
    share, left = 1.7 * np.sqrt(90.0 / 100.0) * rows, rows * np.tile([1.0, -1.0], (100 + held) // 2)

    def model(torque: Any) -> Any:
        return SimpleNamespace(torque=lambda data: torque)

    def data(quiet: float) -> Any:
        return SimpleNamespace(y=share + quiet * left, joint=(rows < 1.0).astype(int), counts=rows > 0.0,
                               log_of=np.zeros(len(rows), dtype=int))

    whole: Any = SimpleNamespace(torque=lambda data: share, without=lambda place: model(np.zeros(len(rows))),
                                 effects=(SimpleNamespace(effect=Cogging(1)),))
    done: Any = SimpleNamespace(model=whole, weight=np.ones(2))
    prepared: Any = SimpleNamespace(data=data(1.0 if asked else 2.0), judge=data(1e-3))
    assert len(agreement(done, 0, prepared)) == (2 if asked else 1)


@pytest.mark.parametrize(("effect", "held", "asked"), [(Backlash(2), True, 1), (Backlash(2), False, 2), (Cogging(2), True, 2)])
def test_a_gap_is_asked_where_its_joint_moves(effect: Any, held: bool, asked: bool) -> None:
    """Of what its other side does to the next joint while its own is held, a log may ask for any part: here for none of it. Other
    causes act there as well, and are asked."""
    joint = np.repeat([0, 1], 50)

    def data(own: float, counts: Any) -> Any:
        return SimpleNamespace(y=own * np.ones(100), joint=joint, counts=counts, log_of=np.zeros(100, dtype=int))

    none: Any = SimpleNamespace(torque=lambda data: np.zeros(100))
    whole: Any = SimpleNamespace(torque=lambda data: np.ones(100), without=lambda place: none,
                                 effects=(SimpleNamespace(effect=effect),))
    prepared: Any = SimpleNamespace(data=data(1.0, np.full(100, True)), judge=data(0.9, joint == 0 if held else np.full(100, True)))
    done: Any = SimpleNamespace(model=whole, weight=np.ones(2))
    assert len(agreement(done, 0, prepared)) == asked
