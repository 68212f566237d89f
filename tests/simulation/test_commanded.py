"""What a described controller commanded is known: a torque of another unit, sign or clock differs from it, a fault does not."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from bench import experiments
from bench.draw import draw_machine
from bench.faults import make
from bench.plant import record
from pipelines.io.log import Array, ExperimentLog
from pipelines.quality.subject import Subject
from pipelines.simulation.commanded import against_command, commanded
from tests.healthy import with_signal
from tests.seeds import rarely


@lru_cache
def recorded(fault: str = "", joint: int = 2) -> ExperimentLog:
    """Four seconds of excitation of a machine of the test bench, whose controller is other code."""
    machine = draw_machine(7, "fault")
    peak = (40.0, 20.0, 5.0)
    faults = (make(fault, machine, joint, seed=4, strength=1.0, peak_torque=peak, duration=4.0),) if fault else ()
    log, = record(machine, faults, [experiments.excitation(machine, 3, 4.0, 1)], 3)
    return log


def with_torque(joint: int, change: Array | float, late: int = 0) -> ExperimentLog:
    """The torque of one joint (from 1) times `change`, so many samples later."""
    log = recorded()
    tau = log.tau.copy()
    tau[:, joint - 1] = np.interp(np.arange(len(tau)) - late, np.arange(len(tau)), change * tau[:, joint - 1])
    return with_signal(log, tau=tau)


def said(log: ExperimentLog) -> list[tuple[str, str]]:
    return [(check.code.removeprefix("RRID-"), check.message) for check in against_command(Subject(log))]


def test_what_was_commanded_is_what_was_logged() -> None:
    """To a fraction of a step of the torque, of three joints with a rounded encoder and command."""
    log = recorded()
    assert log.controller is not None
    assert log.controller.torque_resolution is not None
    wanted = commanded(log)
    assert wanted is not None
    assert (np.abs(wanted - log.tau[:len(wanted)]) < 0.5 * log.controller.torque_resolution).all()


@pytest.mark.parametrize("fault", ["", "torque_saturation", *rarely(
    "torque_lag", "torque_gain", "time_delay", "drive_lag", "encoder_eccentricity", "encoder_crosstalk", "torque_offset")])
def test_faults_of_the_arm_its_drives_and_encoders_are_no_mismatch(fault: str) -> None:
    """Full strength: what a drive makes of its command, or an encoder of an angle, the controller knows no more of than the log.
    A recorder that is late by five milliseconds is a cause as well."""
    assert said(recorded(fault)) == []


@pytest.mark.row("S15")
@pytest.mark.parametrize("joint", [1, 3])
@pytest.mark.parametrize("factor", [20.0, 0.2, 0.7])
def test_a_gear_ratio_of_one_torque_is_told_with_its_factor(factor: float, joint: int) -> None:
    """Of the torque; or, the other way round, of position and reference, from which the command follows."""
    (code, message), = said(with_torque(joint, factor))
    assert code == "S15"
    assert f"tau of joint {joint} is {factor:.3g} times what the controller" in message
    assert f"position and reference are {1.0 / factor:.3g} times as large" in message


@pytest.mark.row("S10")
@pytest.mark.parametrize("factor", [20.0, 0.2])
def test_amperes_are_told_with_their_factor(factor: float) -> None:
    """Of drives with a twentieth of an A/N m, or with five; whatever the description says of masses."""
    log = with_signal(recorded(), tau=factor * recorded().tau)
    found = said(log)
    assert [code for code, _ in found] == ["S10"] * 3
    assert all(f"is {factor:.3g} times what the controller" in message and "current" in message for _, message in found)


@pytest.mark.row("S14")
def test_a_torque_of_the_other_sign_is_told() -> None:
    (code, message), = said(with_torque(2, -1.0))
    assert (code, "joint 2 is -1 times" in message) == ("S14", True)


@pytest.mark.row("T06")
@pytest.mark.parametrize(("late", "words"), [(20, "20 ms after"), (-12, "12 ms before"), (5, ""), (-5, "")])
def test_a_torque_of_another_clock_is_told_with_its_time(late: int, words: str) -> None:
    found = said(with_torque(2, 1.0, late))
    assert [code for code, _ in found] == (["T06"] if words else [])
    assert all(f"tau of joint 2 is stamped {words} the controller" in message for _, message in found)


@pytest.mark.parametrize("time_constant", [5e-3, *(pytest.param(x, marks=pytest.mark.slow) for x in (1e-2, 3e-2))])
def test_a_recorder_that_smooths_is_a_cause_and_no_other_clock(time_constant: float) -> None:
    """As late as a shift of so many milliseconds, and not the same: `diagnose` names it."""
    log = recorded()
    keep = np.exp(-log.sample_time / time_constant)
    tau = log.tau.copy()
    for k in range(1, len(tau)):
        tau[k] = keep * tau[k - 1] + (1.0 - keep) * log.tau[k]
    assert said(with_signal(log, tau=tau)) == []


@pytest.mark.parametrize("spoiled", ["nobody", "open-loop", "gap"])
def test_without_a_controller_that_can_be_followed_nothing_is_said(spoiled: str) -> None:
    log = with_torque(2, 20.0)
    assert log.controller is not None
    if spoiled == "gap":
        q = log.q.copy()
        q[100, 1] = np.nan  # the controller saw a number there, and nobody knows which
        log = with_signal(log, q=q)
    else:
        log = replace(log, controller=None if spoiled == "nobody" else replace(log.controller, law="open-loop"))
    assert commanded(log) is None
    assert said(log) == []
