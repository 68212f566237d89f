"""Friction that turns over within a few mrad/s is as sharp as it is in the machine, not as smoothing leaves it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from itertools import product
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipelines.bench import experiments
from pipelines.bench.machine import draw_machine
from pipelines.bench.session import record
from pipelines.log.experiment import Array, ExperimentLog
from pipelines.model.arm import Acting
from pipelines.model.diagnosis.answered import unbiased
from pipelines.model.diagnosis.answered.unbiased import smoothed_away
from pipelines.model.diagnosis.asked.inputs import Logs, Prepared, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.fitted.refit import Refined, moved_by, refine
from pipelines.model.diagnosis.searched.search import Found, Step
from pipelines.model.effects.torque_lag import TorqueLag

MACHINES = (1501, 1502, 1503, 1505)


@lru_cache(maxsize=8)
def recorded(number: int, seed: int) -> ExperimentLog:
    machine = draw_machine(number, "fault")
    log, = record(machine, (), [experiments.excitation(machine, seed, 6.0, 2)], seed)
    return log


def as_recorded(log: ExperimentLog) -> ExperimentLog:
    return log


def of_no_controller(log: ExperimentLog) -> ExperimentLog:
    return replace(log, controller=None)


@lru_cache(maxsize=8)
def fitted(number: int, seed: int, spoiled: Callable[[ExperimentLog], ExperimentLog] = as_recorded) -> tuple[Refined, Prepared]:
    """Of the machine of this number; none of these tests changes it."""
    log = recorded(number, seed)
    prepared = prepare(Logs((spoiled(log),)), DiagnosisSettings())
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
        done, prepared = fitted(number, seed)
        artefact = smoothed_away(done.model.arm, np.array(machine.amplifier_noise), done.data, prepared, seed)
        assert artefact is not None
        before.append(sharpness(done) / truth - 1.0)
        after.append(sharpness(moved_by(done, -artefact)) / truth - 1.0)
    return np.array(before), np.array(after)


@pytest.mark.slow
def test_the_wrist_is_fitted_too_sharp_and_put_right(errors: tuple[Array, Array]) -> None:
    """Its drive is the least noisy of all, and what is left of it the smallest."""
    before, after = (one[:, 2] for one in errors)
    assert (before > 0.0).all()
    assert np.sqrt(np.mean(after**2)) < 0.5 * np.sqrt(np.mean(before**2))


def test_of_the_arm_as_a_whole_less_is_wrong(errors: tuple[Array, Array]) -> None:
    before, after = (np.sqrt(np.mean(one**2)) for one in errors)
    assert after < 0.7 * before


@pytest.mark.slow
@pytest.mark.parametrize("lag", [0.0, 0.02])
def test_the_noise_of_a_run_moves_next_to_nothing(lag: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Amplifiers of ten times the noise: what the rigid body's numbers differ by from one run to the next is half at most of what
    it is where a log has what the drives were asked for; also of torque that is logged late."""
    done, prepared = fitted(1501, 0)
    noise = 10.0 * np.array(draw_machine(1501, "fault").amplifier_noise)
    rigid = slice(len(done.model.columns.kept))
    deviation = np.sqrt(np.diag(done.covariance()))[rigid]

    arm = done.model.arm if lag == 0.0 else done.model.arm.extended(Acting.of(TorqueLag(2), {"time_constant": lag}))

    def scatter() -> float:
        left = [smoothed_away(arm, noise, done.data, prepared, 10 * k) for k in range(5)]
        moved = [moved_by(done, -one).model.beta[rigid] / deviation for one in left if one is not None]
        return float(np.sqrt(np.mean(np.var(moved, axis=0, ddof=1))))

    known = scatter()
    monkeypatch.setattr(unbiased, "torque_noise", lambda _, seeds, samples: np.zeros((len(seeds), samples, 3)))
    assert known < 0.5 * scatter()


@pytest.mark.slow
@pytest.mark.parametrize("known", [True, False])
def test_every_model_of_a_search_is_moved_by_what_the_arm_that_was_found_leaves(known: bool) -> None:
    """The nominal one, that of the only step, before and after, and the final one; none where no log can be run."""
    done, prepared = fitted(1501, 0, as_recorded if known else of_no_controller)
    other = refine(done.model, done.data, 2.0 * done.weight)
    nothing: Any = Step(other, None, (), (), None, ())  # type: ignore[arg-type]
    case: Any = SimpleNamespace(beside=())
    found = unbiased.unbiased(Found(other, (nothing,), done), prepared, case, 0)
    if not known:
        assert (found.nominal, found.final) == (other, done)
        return
    artefact = smoothed_away(done.model.nominal, unbiased._amplifiers(done), done.data, prepared, 0)
    assert artefact is not None
    for there, before in ((found.nominal, other), (found.final, done), (found.steps[0].before, other)):
        np.testing.assert_allclose(sharpness(there), sharpness(moved_by(before, -artefact)), rtol=1e-12)
        assert (sharpness(there) != sharpness(before)).any()


def test_logs_that_no_controller_is_known_of_leave_nothing() -> None:
    done, prepared = fitted(1501, 0, of_no_controller)
    assert smoothed_away(done.model.arm, np.zeros(3), done.data, prepared, 0) is None


@pytest.mark.slow
@pytest.mark.parametrize(("name", "missing"), [("q", 3), ("tau", 60), ("q", 600), *(
    pytest.param(name, missing, marks=pytest.mark.slow) for name, missing in product(["q", "tau"], [20, 200]))])
def test_a_log_with_a_hole_is_run_with_the_hole(name: str, missing: int) -> None:
    """What it leaves there is in the log's own rows, and as large as beside none."""
    def spoiled(log: ExperimentLog) -> ExperimentLog:
        values = log.signals[name].values.copy()
        values[3000:3000 + missing] = np.nan
        return replace(log, signals={**log.signals, name: replace(log.signals[name], values=values)})

    machine = draw_machine(1501, "fault")
    done, prepared = fitted(1501, 0, spoiled)
    artefact = smoothed_away(done.model.arm, np.array(machine.amplifier_noise), done.data, prepared, 0)
    assert artefact is not None
    assert artefact.shape == (done.data.rows,)
    rms = done.data.rms(artefact)
    assert (rms > 0.0).all()
    assert (rms < 1.2 * done.rms).all()


def test_rows_that_a_run_does_not_come_to_count_as_if_it_left_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """Samples that a log lacks for a reason of its own, spikes say, no simulated one lacks."""
    machine = draw_machine(1501, "fault")
    done, prepared = fitted(1501, 0)
    spikes = np.arange(prepared.motions[0][0].n_samples)[:, None] // 50 == 60
    monkeypatch.setattr(unbiased, "_as_missing", lambda x, measured: np.where(spikes, np.nan, x))
    artefact = smoothed_away(done.model.arm, np.array(machine.amplifier_noise), done.data, prepared, 0)
    assert artefact is not None
    np.testing.assert_array_equal(artefact, np.zeros(done.data.rows))
