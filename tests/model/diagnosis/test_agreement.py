"""Logs agree on the size of a cause, or the parts of one log: a ripple that is there for half of it is none of the machine."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.log.experiment import ExperimentLog
from pipelines.model.diagnosis.exact import Exact
from pipelines.model.diagnosis.findings import agreement, unlike
from pipelines.model.diagnosis.inputs import Logs, prepare
from pipelines.model.diagnosis.nominal import fit_nominal
from pipelines.model.diagnosis.refit import refine
from pipelines.model.diagnosis.settings import DiagnosisSettings
from pipelines.model.effects.cogging import Cogging
from tests.model.diagnosis.test_through import turned

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
