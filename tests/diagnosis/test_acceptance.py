"""Gains of a finding, on numbers that are made up: what is worse on one held-out log; and rows of a joint that is held do not
count."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bench import experiments
from bench.draw import draw_machine
from bench.plant import record
from pipelines.diagnosis.findings import gain_of
from pipelines.dynamics.body import Motion
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


@pytest.fixture(scope="module")
def long() -> tuple[Any, Any]:
    """Six seconds of one log, and an arm fitted to them."""
    prepared = prepare(Logs((session(seconds=6.0, logs=1)[0],)), Recipe())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    return prepared.motions[0], Exact.start(columns, fit).arm


def test_the_simulated_span_is_where_the_measured_arm_counts(long: tuple[Any, Any]) -> None:
    """In closed loop: behind the seconds that are told a measured position changes nothing, before their end it does."""
    (log, found), arm = long
    first = simulation_errors([arm], ((log, found),))[0]
    span = first.span[0]
    assert (first.how, span.log) == ("closed-loop", log.name)
    assert 1.0 < span.seconds < 5.9
    end = round(span.seconds / log.sample_time)
    for sample, same in ((end, True), (end - 1, False)):
        q = log.q.copy()
        q[sample] += 0.1
        moved = replace(log, signals={**log.signals, "q": replace(log.signals["q"], values=q)})
        assert (simulation_errors([arm], ((moved, found),))[0].tip_rms == first.tip_rms) == same


@pytest.mark.slow
def test_longer_stretches_are_simulated_where_the_last_arm_comes_no_nearer(long: tuple[Any, Any]) -> None:
    """An arm that is worse first, and then the fitted one: what is short tells. The same two the other way round, and one arm
    twice, are told apart by all of the log."""
    (log, found), arm = long
    heavy = replace(arm, base=tuple(replace(one, value=1.2 * one.value) for one in arm.base))
    assert [one.span[0].seconds for one in simulation_errors([heavy, arm], ((log, found),))] == [5.0, 5.0]
    for arms in ([arm, heavy], [arm, replace(arm)]):
        both = simulation_errors(arms, ((log, found),))
        assert [one.span[0].seconds for one in both] == pytest.approx([6.0, 6.0], abs=0.01)


def test_the_simulated_span_of_windows_is_all_that_they_cover(long: tuple[Any, Any]) -> None:
    """Without a controller nearly all of the log is simulated, 0.1 s at a time, and half of it where half can be used."""
    (log, found), arm = long
    bare = replace(log, controller=None)
    good = found.good.fit & (np.arange(len(found.good.fit)) < len(found.good.fit) / 2)
    half: Any = replace(found, good=SimpleNamespace(kept=found.good.kept, fit=good))
    whole, part = (simulation_errors([arm], ((bare, motion),))[0] for motion in (found, half))
    assert (whole.how, part.how) == ("windowed", "windowed")
    assert 5.0 < whole.span[0].seconds <= 6.01
    assert part.span[0].seconds == pytest.approx(0.5 * whole.span[0].seconds, abs=0.3)


def test_a_fast_log_drives_its_windows_by_the_mean_torque_of_a_millisecond() -> None:
    """Five samples of 0.2 ms make one; none is left of a millisecond of which a sample is missing, or of no use."""
    t = np.delete(2e-4 * np.arange(61), 23)
    tau = RNG.normal(size=(60, 3))
    usable = np.arange(60) != 11
    motion = Motion(t, *(RNG.normal(size=(60, 3)) for _ in range(3)))
    thin, mean, left, every = gains._coarser(motion, tau, usable, 2e-4)
    assert every == 5
    np.testing.assert_array_equal(thin.q, motion.q[::5])
    np.testing.assert_allclose(mean[1], tau[5:10].mean(axis=0), rtol=1e-12)
    assert left.tolist() == [k not in (2, 4) for k in range(12)]
    assert gains._coarser(motion, tau, usable, 1e-3) == (motion, tau, usable, 1)


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


def test_rows_of_a_joint_that_is_held_do_not_count() -> None:
    """Joint 1 to and fro, the others at rest: they stick, and no law tells their torque. In the other log all three count."""
    machine = draw_machine(7, "fault")
    (fro,) = record(machine, (), [experiments.reversal(machine, 1, 2.0)], 3)
    data = prepare(Logs((session()[0], replace(fro, role="identify"))), Recipe()).data
    counted = {(log, joint): bool(data.counts[(data.log_of == log) & (data.joint == joint)].all())
               for log in (0, 1) for joint in (0, 1, 2)}
    assert counted == {(0, 0): True, (0, 1): True, (0, 2): True, (1, 0): True, (1, 1): False, (1, 2): False}


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
