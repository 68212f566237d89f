"""Gains of a finding, on numbers that are made up: what is worse on one held-out log; and rows of a joint that is held do not
count."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.diagnosis.findings import gain_of
from pipelines.estimation.estimate import Recipe
from pipelines.estimation.exact_model import Exact
from pipelines.estimation.model_fit import TorqueGain, no_better, worse_log
from pipelines.estimation.nominal_fit import fit_nominal
from pipelines.estimation.preparation import Logs, prepare
from pipelines.simulation import comparison as gains
from pipelines.simulation.comparison import Simulation, simulation_errors
from pipelines.simulation.replay import Windows, simulate_windows
from tests.diagnose.sessions import session

RNG = np.random.default_rng(5)
NOISE = RNG.uniform(0.5, 1.5, 20)


def simulated(power: Any, how: Any = "closed-loop") -> Simulation:
    return Simulation(how, np.full(3, 1e-4), 1e-4, np.asarray(power))


def test_a_model_that_runs_away_has_no_simulated_gain() -> None:
    gone = Simulation.none(3)
    gain = gain_of(TorqueGain(np.ones(3), np.ones(3), np.zeros((3, 2))), simulated(NOISE), gone)
    assert (gain.simulated_position_rms, gain.tip_error_rms, gain.simulation) == (None, None, "none")


def test_a_window_in_which_the_arm_runs_away_is_not_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """One window of one arm without an end: that arm has no simulated error, the other keeps its own."""
    log = replace(session()[0], controller=None)
    prepared = prepare(Logs((log,)), Recipe())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    arm = Exact.start(columns, fit).arm
    calls = []

    def windows(*given: Any) -> Windows:
        calls.append(simulate_windows(*given))
        if len(calls) == 2:
            calls[1].q[calls[1].first[3]:calls[1].first[4]] = np.nan
        return calls[-1]

    monkeypatch.setattr(gains, "simulate_windows", windows)
    first, second = simulation_errors([arm, arm], prepared.motions)
    assert (first.how, second.how) == ("windowed", "none")


def two_logs() -> Any:
    """Two logs of 100 rows of each of two joints."""
    joint = np.tile(np.repeat([0, 1], 100), 2)
    return SimpleNamespace(
        logs=[SimpleNamespace(log=SimpleNamespace(name=name)) for name in ("first", "second")], log_of=np.repeat([0, 1], 200),
        counts=np.ones(400, dtype=bool), joint=joint,
        rms=lambda x: np.sqrt(np.bincount(joint, x**2) / np.bincount(joint)))


def test_no_held_out_log_may_get_worse_by_more_than_a_twentieth() -> None:
    """Better on the whole, and yet worse on the second; a joint of small torque counts as well as one of large."""
    data, large = two_logs(), np.tile(np.repeat([1.0, 0.01], 100), 2)
    first = data.log_of == 0
    assert not worse_log(data, large, 0.9 * large)
    assert not worse_log(data, large, np.where(first, 0.2, 1.04) * large)
    assert "second" in worse_log(data, large, np.where(first, 0.2, 1.06) * large)
    assert "second" in worse_log(data, large, np.where(first | (data.joint == 0), 1.0, 2.0) * large)


def test_a_further_cause_has_to_predict_held_out_torque_better() -> None:
    """By a thousandth at one joint, and not worse by as much at the other, however small its torque is."""
    data, large = two_logs(), np.tile(np.repeat([1.0, 0.01], 100), 2)
    assert not no_better(data, large, np.where(data.joint == 0, 0.999, 1.0) * large)
    assert no_better(data, large, large)
    assert no_better(data, large, np.where(data.joint == 0, 0.999, 1.002) * large)


def test_a_slide_counts_by_its_own_travel_beside_a_joint_that_turns() -> None:
    """A slide that moves over five centimetres is 5 mm off, then half a millimetre; a wrist that turns over two radians is 20 mrad
    off, then 25: metres beside radians would tell of the wrist alone."""
    t = np.linspace(0.0, 10.0, 2000)
    measured = np.stack([0.025 * np.sin(t), np.sin(1.3 * t)], axis=1)
    off = {"before": np.array([5e-3, 0.020]), "after": np.array([5e-4, 0.025])}
    log: Any = SimpleNamespace(name="log", t=t)
    found = {}
    for revolute in ((False, True), (True, True)):
        body = SimpleNamespace(tip=lambda q: q)
        for when, error in off.items():
            arm: Any = SimpleNamespace(n_joints=2, robot=SimpleNamespace(revolute=revolute), body=body)
            found[revolute, when] = gains._error(arm, [(log, Any)], [(measured + error, measured, 5e-3)], True)
    held = measured * np.array([1e-5, 1.0])  # a slide that is held is 20 um off, then 40: nobody asks it
    for when, error in (("held before", np.array([2e-5, 0.025])), ("held after", np.array([4e-5, 0.020]))):
        arm = SimpleNamespace(n_joints=2, robot=SimpleNamespace(revolute=(False, True)), body=SimpleNamespace(tip=lambda q: q))
        found[False, when] = gains._error(arm, [(log, Any)], [(held + error, held, 5e-3)], True)
    assert gains.nearer(found[False, "held before"], found[False, "held after"])
    slides, turns = (gains.nearer(found[kind, "before"], found[kind, "after"]) for kind in ((False, True), (True, True)))
    assert slides
    assert not turns
