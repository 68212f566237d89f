"""A touch happens once or twice; bursts that come again and again are no touch, whatever they are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.log.experiment import Array, ExperimentLog
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.fitted.refit import refine
from pipelines.model.diagnosis.screened.candidates import families, whole_motion
from pipelines.model.diagnosis.screened.screen import Screened, screen
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.search import search
from pipelines.model.diagnosis.worth.held_out import cross_validated
from pipelines.model.effects import all_effects
from pipelines.model.effects.viscous_drift import ViscousDrift
from pipelines.model.rigid.body import Motion
from tests.model.diagnosis.arms import arm, hidden


def bumps(*starts: float, joints: tuple[float, ...] = (1.0, 0.7, 0.2)) -> Screened:
    """Half-sines of 0.2 s in the torque of all joints of one of two logs, and what an event gains."""
    def load(motion: Motion) -> Array:
        since = [(motion.t - start) / 0.2 for start in starts]
        return np.array(joints) * sum(np.where((x > 0.0) & (x < 1.0), np.sin(np.pi * x), 0.0) for x in since)[:, None]

    prepared = prepare(Logs((hidden(1, load), hidden(2))), DiagnosisSettings())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    arm = Exact.start(columns, fit).arm
    events = tuple(kind.name for kind in all_effects() if not kind.per_log)
    every = families(columns.laws, whole_motion(prepared.data), arm, events)
    return next(one for one in screen(prepared.data, fit, every, arm) if one.family.event)


@pytest.mark.slow
@pytest.mark.parametrize(("starts", "out"), [((3.0,), True), ((2.0, 5.5), True), ((1.0, 2.3, 3.1, 4.6, 6.0), False)])
def test_few_moments_stand_out(starts: tuple[float, ...], out: bool) -> None:
    one = bumps(*starts)
    assert one.gain[0] > 0.0
    assert one.stands_out == out


def test_other_time_is_not_asked_for_what_happened_once() -> None:
    """Blocks of one log judge: without that of the touch nothing tells its numbers, and the error there was a thousandfold."""
    def touch(motion: Motion) -> Array:
        since = (motion.t - 3.0) / 0.2
        return np.array([1.0, 0.7, 0.2]) * np.where((since > 0.0) & (since < 1.0), np.sin(np.pi * since), 0.0)[:, None]

    data = (case := only(("contact", "torque_offset"), Logs((hidden(1, touch),)))).data
    found = search(case, 1)
    assert [one.effect.name for one in found.final.model.effects] == ["contact"]
    done = refine(found.final.model, data, found.final.weight)
    held, fitted = (data.rms(x) for x in (cross_validated(done, 10), done.left))
    assert (held < 1.3 * fitted).all()


def touched(motion: Motion) -> Array:
    """A push of 12 N on the tip, three seconds after the start."""
    since, out = (motion.t - 3.0) / 0.3, np.zeros_like(motion.q)
    window = np.where((since > 0.0) & (since < 1.0), np.sin(np.pi * since), 0.0)
    for j in range(3):
        moved = motion.q.copy()
        moved[:, j] += 1e-6
        out[:, j] = -window * ((arm().body.tip(moved) - arm().body.tip(motion.q)) / 1e-6 @ np.array([0.0, 6.0, 10.0]))
    return out


def begun(log: ExperimentLog, clock: float) -> ExperimentLog:
    """The same log where the session's clock says `clock` [s] when it begins."""
    return replace(log, signals={**log.signals, "t": replace(log.signals["t"], values=log.t + clock)})


def only(causes: tuple[str, ...], logs: Logs) -> Case:
    """A case that asks for some causes."""
    prepared = prepare(logs, DiagnosisSettings())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit)
    others = tuple(kind.name for kind in all_effects() if kind.name not in causes)
    every = families(columns.laws, whole_motion(prepared.data), model.arm, others)
    return Case(prepared.data, prepared.judge, model, fit.weight, every, None)


@pytest.mark.slow
@pytest.mark.parametrize("clocks", [(0.0, 0.0, 0.0), (0.0, 300.0, 1e4)])
def test_a_touch_that_comes_again_in_every_log_is_one_whatever_their_clocks_say(clocks: tuple[float, float, float]) -> None:
    """Three seconds after the start of each: held-out time confirms it, so that it belongs to none of them."""
    logs = [begun(hidden(k, touched, role), clock)
            for k, role, clock in zip((1, 2, 3), ("identify", "identify", "validate"), clocks, strict=True)]
    best = search(only(("contact",), Logs(tuple(logs[:2]), (logs[2],))), 1).steps[0].best
    assert best is not None
    assert best.log is None
    values = best.done.model.effects[0].values
    assert values["start"] == pytest.approx(3.0, abs=0.01)
    assert values["force"] == pytest.approx(np.hypot(6.0, 10.0), rel=0.05)


def test_how_fast_a_drift_is_goes_by_the_logs_and_not_by_the_time_between_them() -> None:
    """Two logs of eight seconds, five minutes apart: from a fifth to five times eight seconds."""
    case = only(("viscous_drift",), Logs((hidden(1), begun(hidden(2), 300.0))))
    for family in case.families:
        times = [shape.time_constant for shape in family.shapes if isinstance(shape, ViscousDrift)]
        assert times == pytest.approx([1.6, 4.0, 12.0, 40.0], rel=1e-3)
