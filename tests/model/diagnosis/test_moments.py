"""A touch happens once or twice; bursts that come again and again are no touch, whatever they are."""

from __future__ import annotations

import numpy as np
import pytest

from pipelines.log.experiment import Array
from pipelines.model.diagnosis.candidates import families, whole_motion
from pipelines.model.diagnosis.case import Case
from pipelines.model.diagnosis.exact import Exact
from pipelines.model.diagnosis.held_out import cross_validated
from pipelines.model.diagnosis.inputs import Logs, prepare
from pipelines.model.diagnosis.nominal import fit_nominal
from pipelines.model.diagnosis.refit import refine
from pipelines.model.diagnosis.screen import Screened, screen
from pipelines.model.diagnosis.search import search
from pipelines.model.diagnosis.settings import DiagnosisSettings
from pipelines.model.effects import all_effects
from pipelines.model.rigid.body import Motion
from tests.model.diagnosis.arms import hidden


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

    prepared = prepare(Logs((hidden(1, touch),)), DiagnosisSettings())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit)
    others = tuple(kind.name for kind in all_effects() if kind.name not in ("contact", "torque_offset"))
    every = families(columns.laws, whole_motion(prepared.data), model.arm, others)
    found = search(Case(prepared.data, None, model, fit.weight, every, None), 1)
    assert [one.effect.name for one in found.final.model.effects] == ["contact"]
    done = refine(found.final.model, prepared.data, found.final.weight)
    held, fitted = (prepared.data.rms(x) for x in (cross_validated(done, 10), done.left))
    assert (held < 1.3 * fitted).all()
