"""Thresholds of causes that act on several joints: what sums over the rows of each joint say is what replicas fitted anew show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.log.experiment import Array, ExperimentLog, Signal
from pipelines.log.robot import Joint, RobotDescription, format_robot
from pipelines.model.arm import Arm
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import Fit, fit_columns, fit_nominal
from pipelines.model.diagnosis.floor.thresholds import Thresholds
from pipelines.model.diagnosis.floor.twin import Twin
from pipelines.model.diagnosis.floor.wide import Wide
from pipelines.model.diagnosis.screened.candidates import Family, families, whole_motion
from pipelines.model.diagnosis.screened.screen import screen
from pipelines.model.effects import find_effect
from tests.model.diagnosis.arms import hidden

TRIED = ("gravity_tilt", "link_length", "base_resonance", "contact", "encoder_eccentricity")


@pytest.fixture(scope="module")
def there() -> tuple[Fit, Array, tuple[Family, ...], Arm]:
    """A nominal model, four replicas of noise on its rows [N m], and causes that act on several joints."""
    prepared = prepare(Logs((hidden(1),)), DiagnosisSettings())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    arm = Exact.start(columns, fit).nominal
    every = families(columns.laws, whole_motion(prepared.data), arm)
    noise = np.random.default_rng(3).standard_normal((4, prepared.data.rows)) * fit.rms[prepared.data.joint]
    return fit, noise, tuple(one for one in every if one.cause in TRIED), arm


def left(fit: Fit, noise: Array, weight: Array) -> tuple[Fit, Array]:
    fits = [fit_columns(fit.data, fit.table, one, weight) for one in noise]
    return fits[0], np.array([one.residual for one in fits])


@pytest.mark.parametrize("ratio", [(1.0, 1.0, 1.0), (3.0, 1.0, 1.0), (1.0, 0.3, 2.0), (0.5, 5.0, 0.8)])
def test_any_weights_give_what_fitting_anew_gives(there: tuple[Fit, Array, tuple[Family, ...], Arm],
                                                  ratio: tuple[float, float, float]) -> None:
    """Of causes that act always to the last digit; of an event its shapes are those of some weights, and no more are found."""
    fit, noise, every, arm = there
    first, residuals = left(fit, noise, fit.weight)
    wide = Wide.of_twin(first, residuals, every, np.zeros(3), np.zeros(3), arm)
    weight = fit.weight * np.array(ratio)
    now, anew = left(fit, noise, weight)
    wanted = np.array([one.gain.max() for one in screen(fit.data, now, every, arm, anew)])
    found = wide.at(weight)[1]
    for family, one, other in zip(every, found, wanted, strict=True):
        assert one == pytest.approx(other, rel=0.3 if family.event else 1e-6)


def test_what_an_error_of_an_angle_does_elsewhere_does_not_grow_with_its_joint(
        there: tuple[Fit, Array, tuple[Family, ...], Arm]) -> None:
    """Replicas whose third joint is quiet: what chance gives an eccentricity there stands in the rows of the joints before it, and
    does not grow with the weight of the third; a spring's, which acts on its own joint alone, does."""
    fit, noise, _, arm = there
    quiet = noise * np.array([1.0, 1.0, 1e-3])[fit.data.joint]
    fits = tuple(fit_columns(fit.data, fit.table, one, fit.weight) for one in quiet)
    every = tuple(Family(name, 3, tuple(effect.shapes(whole_motion(fit.data), arm))) for name in ("encoder_eccentricity", "spring")
                  for effect in find_effect(name).everywhere((True,) * 3) if effect.joint == 3)
    bounds = Thresholds.of_twin(*Twin(fits, (0,), np.zeros(3)).weighted(fit.weight), every, arm)
    grown = bounds.at(fit.weight * np.array([1.0, 1.0, 10.0])).own / bounds.own
    assert grown[1] == pytest.approx(100.0)
    assert grown[0] < 10.0


def test_what_happened_once_has_to_gain_twice_as_much(there: tuple[Fit, Array, tuple[Family, ...], Arm]) -> None:
    """No other log bears it out: six times what chance gives it in any replica, where what acts always needs three times that; by
    weights of now and by others."""
    fit, noise, every, arm = there
    bounds = Thresholds.of_twin(*left(fit, noise, fit.weight), every, arm)
    event = np.array([family.event for family in every])
    for weight in (fit.weight, fit.weight * np.array([1.0, 0.5, 2.0])):
        now = bounds.at(weight)
        assert (now.gain[event] >= 5.99 * now.own[event]).all()
        assert (now.gain[~event] >= 2.99 * now.own[~event]).all()
    assert event.any()


def test_longer_logs_give_chance_more_to_gain(there: tuple[Fit, Array, tuple[Family, ...], Arm]) -> None:
    fit, noise, every, arm = there
    wide = Wide.of_twin(*left(fit, noise, fit.weight), every, np.ones(3), np.ones(3), arm)
    for one, other in zip(wide.at(fit.weight), replace(wide, longer=2.0).at(fit.weight), strict=True):
        np.testing.assert_allclose(2.0 * one, other)


def test_a_touch_at_a_tip_that_no_joint_moves_gains_nothing() -> None:
    """A shaft that turns about its own tip: no force there has a torque, in any replica."""
    t = np.arange(4000) * 1e-3
    q, speed, rate = np.sin(6.0 * t), 6.0 * np.cos(6.0 * t), -36.0 * np.sin(6.0 * t)
    tau = 0.2 * rate + 0.5 * np.tanh(speed / 0.05) + 0.1 * speed
    robot = RobotDescription("shaft", (0.0, 0.0, -9.81), "dh", (Joint("axis 1", velocity=9.0, torque=20.0),))
    signals = {"t": Signal(t, "s", "time stamp"), "q": Signal(q[:, None], "rad", "measured joint position"),
               "tau": Signal(tau[:, None], "N m", "commanded joint torque")}
    log = ExperimentLog("shaft", "excitation", "identify", "measured", "shaft", 1e-3, format_robot(robot), signals)
    prepared = prepare(Logs((log,)), DiagnosisSettings())
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    arm = Exact.start(columns, fit).nominal
    touch = tuple(one for one in families(columns.laws, whole_motion(prepared.data), arm) if one.cause == "contact")
    noise = np.random.default_rng(4).standard_normal((2, prepared.data.rows))
    assert touch
    assert Wide.of_twin(*left(fit, noise, fit.weight), touch, np.zeros(1), np.zeros(1), arm).at(fit.weight)[1] == pytest.approx(0.0)
