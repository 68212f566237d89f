"""Torque logging delay hides a rotor's inertia; the lag is named, and the inertia comes out. SciPy makes the logs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipelines.diagnosis.config import DiagnosisConfig
from pipelines.diagnosis.engine import pose
from pipelines.diagnosis.screening import best_of
from pipelines.dynamics.arm import Acting, Arm
from pipelines.dynamics.body import Motion
from pipelines.dynamics.first_order import lagging
from pipelines.effects.angle import Cogging
from pipelines.effects.base import Effect
from pipelines.effects.drives import DriveLag, LoadFriction, TorqueLag
from pipelines.effects.encoders import EncoderEccentricity, TimeDelay
from pipelines.effects.friction import Coulomb, ViscousDrift
from pipelines.estimation.estimate import Recipe
from pipelines.estimation.exact_model import Exact, nominal_slopes, slopes_of
from pipelines.estimation.model_fit import refine
from pipelines.estimation.nominal import fit_nominal, rigid_rows
from pipelines.estimation.preparation import Logs, prepare
from pipelines.io.log import Array
from tests.diagnose.sessions import but
from tests.diagnosis.asking import diagnosed, effects
from tests.diagnosis.rotor import INERTIA, LAG, ORDER, ROTOR, turned

_LIBRARY = but("cogging", "torque_lag", "drive_lag", "time_delay", "torque_offset", "asymmetric_friction")


@pytest.mark.slow
def test_lag_and_ripple_are_named_and_the_inertia_comes_out() -> None:
    found = diagnosed(turned(1), turned(2), exclude=_LIBRARY, cutoff_hz=40.0)
    selection = found.look.selection
    assert abs(selection.start.model.beta[0] / INERTIA - 1.0) > 0.5  # the nominal model knows nothing of it
    named = {one.effect.name: one for one in effects(found)}
    assert found.decision.verdict == "cause"
    assert set(named) == {"cogging", "torque_lag"}
    assert named["torque_lag"].values["time_constant"] == pytest.approx(LAG, rel=0.005)
    assert named["cogging"].values["order"] == pytest.approx(ORDER, rel=1e-3)
    assert selection.end.model.beta[0] == pytest.approx(INERTIA, rel=0.01)


def test_slopes_of_a_model_behind_a_lag_are_those_of_its_torque() -> None:
    """Every number moved by a little and the whole torque worked out again."""
    prepared = prepare(Logs((turned(1),)), Recipe(cutoff_hz=40.0))
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    rippled = Exact.start(columns, fit).with_effect(Cogging(joint=1, order=ORDER, harmonics=1), np.array([0.04, 0.0]))
    model, data = rippled.with_effect(TorqueLag(joint=1), np.array([LAG])), prepared.data
    done = refine(model, data, fit.weight, steps=0)
    for k in range(len(model.beta)):
        shift = np.zeros(len(done.slopes))
        shift[k] = step = 1e-3 * (abs(model.beta[k]) or 1.0)
        moved = (model.moved(shift, list(done.names)).torque(data) - model.torque(data)) / step
        assert np.linalg.norm(moved - done.slopes[k]) < 1e-6 * np.linalg.norm(moved)
    by_nominal = nominal_slopes(model)  # what a diagnosis steps along
    assert by_nominal is not None
    for one, other in zip(data.lay_each(by_nominal), done.slopes, strict=False):
        assert np.linalg.norm(one - other) < 1e-9 * np.linalg.norm(other)


def test_a_lag_shows_in_the_ripple_that_it_delays() -> None:
    """Ripple is most of this torque: beside it the lag explains ten times what it does beside the nominal model, at its length."""
    prepared = prepare(Logs((turned(1), turned(2))), Recipe(cutoff_hz=40.0))
    later = pose(prepared, DiagnosisConfig())
    ripple = later.dataset.model.with_effect(Cogging(joint=1, order=ORDER, harmonics=1), np.array([0.04, 0.0]))
    state = later.start(ripple)
    before, beside = (next(one for key, one in best_of(some.screened(state)).items() if key == ("torque_lag", 1))
                      for some in (later, later.composed(state.model)))
    assert beside.gain > 10.0 * max(before.gain, 0.0)
    assert beside.amplitudes == pytest.approx([LAG])


def test_sharpness_of_each_joint_is_found_behind_a_lag() -> None:
    """Of two rotors at right angles, whose friction changes sign over 1/30 and over 1/90 rad/s, the second one's torque is logged
    late."""
    first, second = turned(1, {}, lag=0.0, mean=0.1), turned(2, {}, mean=0.1, sharpness=90.0)
    both = {"q": np.column_stack([first.q, second.q]), "tau": np.column_stack([first.tau, second.tau])}
    signals = {name: replace(signal, values=both.get(name, signal.values)) for name, signal in first.signals.items()}
    joint = ROTOR[ROTOR.index("[[joint]]"):]
    robot = ROTOR.replace("alpha = 0.0", "alpha = 1.5707963267948966") + joint.replace("rotor", "other")
    log = replace(first, signals=signals, robot_text=robot)
    prepared = prepare(Logs((log,)), Recipe(cutoff_hz=40.0))
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    done = refine(Exact.start(columns, fit).with_effect(TorqueLag(joint=2), np.array([LAG])), prepared.data, fit.weight, steps=30)
    assert done.model.effects[0].values["time_constant"] == pytest.approx(LAG, rel=0.005)
    found = [law.sharpness for law in done.model.columns.laws if isinstance(law, Coulomb)]
    assert found == pytest.approx([30.0, 90.0], rel=0.02)


@pytest.mark.parametrize(("effect", "amplitudes"), [
    (EncoderEccentricity(joint=1), [0.02, 0.0]), (TimeDelay(joint=1), [0.004]), (DriveLag(joint=1), [0.004]),
    (LoadFriction(joint=1, behind=1.0, input_side=1.0), [0.1]), (ViscousDrift(joint=1), [0.3])],
    ids=["misread", "late", "slow drive", "load friction", "drift"])
def test_nominal_numbers_are_sloped_as_the_whole_torque_is(effect: Effect, amplitudes: list[float]) -> None:
    """A fit that steps along the slopes of the arm without the effect stops away from the best numbers."""
    prepared = prepare(Logs((turned(1, {}, lag=0.0, mean=0.1),)), Recipe(cutoff_hz=40.0))
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model, data = Exact.start(columns, fit).with_effect(effect, np.array(amplitudes)), prepared.data
    model = model.moved(np.zeros(len(model.beta)), [])  # what an effect shares with friction is that of its joint now
    by_nominal = nominal_slopes(model)
    assert by_nominal is not None
    for k, slope in enumerate(data.lay_each(by_nominal)):
        step = 1e-3 * model.beta[k] * np.eye(len(model.beta))[k]
        moved = (model.moved(step, []).torque(data) - model.torque(data)) / (1e-3 * model.beta[k])
        assert np.linalg.norm(moved - slope) < 1e-6 * np.linalg.norm(slope)


@pytest.mark.parametrize(("effect", "amplitudes"), [(EncoderEccentricity(joint=1), [0.02, 0.0]), (TimeDelay(joint=1), [0.004]),
                                                    (DriveLag(joint=1), [0.004])], ids=["misread", "late", "slow drive"])
def test_how_sharply_friction_turns_over_is_sloped_as_the_whole_torque_is(effect: Effect, amplitudes: list[float]) -> None:
    """Friction is felt where the joint truly is, and comes late: a slope at the measured speed is off by a third and more."""
    prepared = prepare(Logs((turned(1, {}, lag=0.0, mean=0.1),)), Recipe(cutoff_hz=40.0))
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    done = refine(Exact.start(columns, fit).with_effect(effect, np.array(amplitudes)), prepared.data, fit.weight, steps=0)
    k = len(done.model.beta) + done.names.index((0, 0, "sharpness"))
    shift = np.zeros(len(done.slopes))
    shift[k] = 1e-4
    ahead, behind = (done.model.moved(by, done.names).torque(prepared.data) for by in (shift, -shift))
    slope = (ahead - behind) / 2e-4
    assert np.linalg.norm(slope - done.slopes[k]) < 0.01 * np.linalg.norm(slope)


def test_slopes_of_a_ripple_behind_a_lag_are_taken_where_the_joint_truly_is() -> None:
    """A disc 0.02 rad beside its axis turns the phase of thirty waves a turn by more than half a radian."""
    prepared = prepare(Logs((turned(1),)), Recipe(cutoff_hz=40.0))
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    wave = Cogging(joint=1, order=30.0, harmonics=1)
    model = (Exact.start(columns, fit).with_effect(TorqueLag(joint=1), np.array([0.1])).with_effect(wave, np.array([0.04, 0.0]))
             .with_effect(EncoderEccentricity(joint=1), np.array([0.02, 0.0])))
    slopes, names = slopes_of(model, prepared.data, rigid_rows(prepared.data, columns))
    first, here = len(model.beta), model.torque(prepared.data)
    for k, (kind, place, name) in enumerate(names):
        if (kind, place) == (1, 1) and name.isdigit():
            shift = np.zeros(len(slopes))
            shift[first + k] = step = 1e-5
            moved = (model.moved(shift, names).torque(prepared.data) - here) / step
            assert np.linalg.norm(moved - slopes[first + k]) < 0.01 * np.linalg.norm(moved), name


def test_what_changes_the_record_stays_outermost() -> None:
    """Cogging that was found after the lag is logged late like everything else."""
    log = turned(1)
    prepared = prepare(Logs((log,)), Recipe(cutoff_hz=40.0))
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    arm: Arm = Exact.start(columns, fit).arm
    lag = Acting.of(TorqueLag(joint=1), {"time_constant": 0.1})
    wave = Acting.of(Cogging(joint=1, order=7.0, harmonics=1), Cogging(joint=1, order=7.0, harmonics=1).values([0.04, 0.0]))
    motion: Motion = prepared.data.logs[0].motion
    either, other = arm.extended(lag, wave).torque(motion), arm.extended(wave, lag).torque(motion)
    whole: Array = arm.extended(wave).torque(motion)
    assert np.allclose(either, other, rtol=0.0, atol=1e-15)
    assert motion.logged is not None
    late = lagging(whole[:, 0], motion.t, 0.1, float(motion.logged[0]), motion.since)
    assert np.allclose(either[:, 0], late, rtol=0.0, atol=1e-12)
