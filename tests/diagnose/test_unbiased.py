"""Friction that turns over within a few mrad/s is as sharp as it is in the machine, not as smoothing leaves it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.bench import experiments
from pipelines.bench.machine import Machine, draw_machine
from pipelines.bench.session import record
from pipelines.log.experiment import Array
from pipelines.model.diagnosis.exact import Exact
from pipelines.model.diagnosis.inputs import Logs, Prepared, prepare
from pipelines.model.diagnosis.nominal import fit_nominal
from pipelines.model.diagnosis.refit import Refined, moved_by, refine
from pipelines.model.diagnosis.settings import DiagnosisSettings
from pipelines.model.diagnosis.unbiased import smoothed_away

MACHINES = (1501, 1502, 1503, 1505)


def fitted(machine: Machine, seed: int, controlled: bool = True) -> tuple[Refined, Prepared]:
    log, = record(machine, (), [experiments.excitation(machine, seed, 6.0, 2)], seed)
    prepared = prepare(Logs((log if controlled else replace(log, controller=None),)), DiagnosisSettings())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    return refine(Exact.start(columns, fit), replace(prepared.data, steady=True), fit.weight), prepared


def sharpness(done: Refined) -> Array:
    """(joints,) [s/rad]"""
    return np.array([one.effect.sharpness for one in done.model.arm.friction if one.effect.name == "coulomb"])


@pytest.fixture(scope="module")
def errors() -> tuple[Array, Array]:
    """(machines, joints) relative error of the sharpness, before and after."""
    before, after = [], []
    for seed, number in enumerate(MACHINES):
        machine = draw_machine(number, "fault")
        truth = np.array([one.sharpness for one in machine.friction])
        done, prepared = fitted(machine, seed)
        artefact, = smoothed_away([(done.model.arm, np.array(machine.amplifier_noise))], done.data, prepared, seed)
        before.append(sharpness(done) / truth - 1.0)
        after.append(sharpness(moved_by(done, -artefact)) / truth - 1.0)
    return np.array(before), np.array(after)


def test_the_wrist_is_fitted_too_sharp_and_put_right(errors: tuple[Array, Array]) -> None:
    """Its drive is the least noisy of all, and what is left of it the smallest."""
    before, after = (one[:, 2] for one in errors)
    assert (before > 0.0).all()
    assert np.sqrt(np.mean(after**2)) < 0.5 * np.sqrt(np.mean(before**2))


def test_of_the_arm_as_a_whole_less_is_wrong(errors: tuple[Array, Array]) -> None:
    before, after = (np.sqrt(np.mean(one**2)) for one in errors)
    assert after < 0.7 * before


def test_logs_that_no_controller_is_known_of_leave_nothing() -> None:
    done, prepared = fitted(draw_machine(1501, "fault"), 0, controlled=False)
    assert smoothed_away([(done.model.arm, np.zeros(3))], done.data, prepared, 0) == []
