"""What acts only while a touch lasts is not told from it; what acts at other times as well is, and a touch is no name for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.believed.momentary import at_other_times, only_then
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal
from pipelines.model.diagnosis.fitted.refit import Refined, refine
from pipelines.model.effects.base import Effect
from pipelines.model.effects.cogging import Cogging
from pipelines.model.effects.contact import Contact
from pipelines.model.effects.torque_saturation import TorqueSaturation
from tests.model.diagnosis.arms import hidden

LASTING = 0.4  # [s]
PUSH, WAVE = np.array([0.0, 180.0, 240.0]), np.array([0.1, 0.0])  # [N]; [N m]


class Touched:
    """Two logs, in one of which the arm is pushed just when the drive of joint 2 works hardest."""

    def __init__(self) -> None:
        self.prepared = prepare(Logs((hidden(1), hidden(2))), DiagnosisSettings())
        columns, fit = fit_nominal(self.prepared.data, self.prepared.columns)
        self.plain, self.weight = Exact.start(columns, fit), fit.weight
        data = self.prepared.data
        torque = np.where(data.joint == 1, np.abs(self.plain.torque(data)), 0.0)
        peak = int(np.argmax(torque))
        self.log, self.start = int(data.log_of[peak]), float(data.t[peak]) - 0.5 * LASTING
        then = (data.log_of == self.log) & (np.abs(data.t - data.t[peak]) < 0.5 * LASTING)
        self.highest, self.otherwise = float(torque[then].max()), float(torque[~then].max())

    def beside(self, effect: Effect, amplitudes: np.ndarray) -> Refined:  # type: ignore[type-arg]
        push = Contact(start=self.start, duration=LASTING)
        model = self.plain.with_effect(push, PUSH, log=self.log).with_effect(effect, amplitudes)
        return refine(model, self.prepared.data, self.weight, steps=0)


@pytest.fixture(scope="module")
def touched() -> Touched:
    return Touched()


def test_a_drive_that_is_clipped_only_while_the_tip_is_pushed(touched: Touched) -> None:
    assert touched.highest > 1.02 * touched.otherwise
    done = touched.beside(TorqueSaturation(2, limit=0.5 * (touched.highest + touched.otherwise)), np.ones(1))
    assert only_then(done, 1)
    assert not only_then(done, 0)  # the push itself


def test_what_acts_at_other_times_as_well(touched: Touched) -> None:
    assert not only_then(touched.beside(TorqueSaturation(2, limit=0.5 * touched.otherwise), np.ones(1)), 1)
    assert not only_then(touched.beside(Cogging(2, order=11.0, harmonics=1), WAVE), 1)


def test_a_touch_is_no_name_for_what_shows_at_other_times(touched: Touched) -> None:
    """Its moment alone is 50 floors high: that is the touch's. Half a second of it at another time is not, unless it has a name."""
    data = touched.prepared.data
    floor = np.full(data.n_joints, 0.05)
    push = touched.plain.with_effect(Contact(start=touched.start, duration=LASTING), PUSH, log=touched.log)
    done = refine(push, data, touched.weight, steps=0)
    then = (data.log_of == touched.log) & (np.abs(data.t - touched.start - 0.5 * LASTING) < 0.4 * LASTING)
    assert not at_other_times(replace(done, left=np.where(then, 2.5, 0.0)), floor)
    elsewhere = (data.log_of != touched.log) & (data.t < data.t.min() + 1.0)
    assert at_other_times(replace(done, left=np.where(elsewhere, 2.5, 0.0)), floor)
    named = touched.beside(Cogging(2, order=11.0, harmonics=1), WAVE)
    assert not at_other_times(replace(named, left=np.where(elsewhere, 2.5, 0.0)), floor)
