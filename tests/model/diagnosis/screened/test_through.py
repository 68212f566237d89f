"""A torque that is logged late hides a rotor's inertia; the lag is named, and the inertia comes out. SciPy makes the logs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lsim

from pipelines.log.experiment import Array, ExperimentLog, Signal
from pipelines.model.arm import Acting, Arm
from pipelines.model.diagnosis.asked.inputs import Logs, prepare
from pipelines.model.diagnosis.asked.settings import DiagnosisSettings
from pipelines.model.diagnosis.fitted.exact import Exact
from pipelines.model.diagnosis.fitted.nominal import fit_nominal, rigid_rows
from pipelines.model.diagnosis.fitted.refit import refine
from pipelines.model.diagnosis.fitted.slopes import slopes_of
from pipelines.model.diagnosis.screened.candidates import families, whole_motion
from pipelines.model.diagnosis.searched.case import Case
from pipelines.model.diagnosis.searched.search import Found, search
from pipelines.model.effects.base import Effect
from pipelines.model.effects.cogging import Cogging
from pipelines.model.effects.coulomb import Coulomb
from pipelines.model.effects.drive_lag import DriveLag
from pipelines.model.effects.encoder_eccentricity import EncoderEccentricity
from pipelines.model.effects.time_delay import TimeDelay
from pipelines.model.effects.torque_lag import TorqueLag
from pipelines.model.rigid.body import Motion
from pipelines.signal.first_order import lagging
from tests.diagnose.sessions import but

_ROBOT = """
name = "motor"
gravity = [0.0, 0.0, -9.81]
[kinematics]
convention = "dh"
[[joint]]
name = "rotor"
type = "revolute"
a = 0.0
alpha = 0.0
d = 0.0
offset = 0.0
"""
_INERTIA, _LAG, _ORDER = 2.5e-4, 0.1, 7.0
_FINE, _RATE, _SECONDS = 8000, 400, 10.0
_LIBRARY = but("cogging", "torque_lag", "drive_lag", "time_delay", "torque_offset", "asymmetric_friction")


def turned(seed: int, waves: Mapping[float, float] = {_ORDER: 0.04}, lag: float = _LAG, mean: float = 0.65,
           sharpness: float = 30.0) -> ExperimentLog:
    """A rotor that turns once in ten seconds, unevenly: its torque, and what a low-pass leaves of it in the log.

    Args:
        waves: amplitude [N m] of each order.
        mean: speed [rad/s].
        sharpness: [s/rad] of its Coulomb friction.
    """
    rng = np.random.default_rng(seed)
    t = np.arange(int(_FINE * _SECONDS)) / _FINE
    rates, phases = 2.0 * np.pi * np.array([0.7, 1.6, 3.1, 5.3]), rng.uniform(0.0, 2.0 * np.pi, 4)
    size = np.array([0.4, 0.4, 0.5, 0.5]) * 0.4  # [rad/s]
    q = mean * t + sum(a / w * np.sin(w * t + p) for a, w, p in zip(size, rates, phases, strict=True))
    dq = mean + sum(a * np.cos(w * t + p) for a, w, p in zip(size, rates, phases, strict=True))
    ddq = sum(-a * w * np.sin(w * t + p) for a, w, p in zip(size, rates, phases, strict=True))
    tau = _INERTIA * ddq + 0.01 * np.tanh(sharpness * dq) + 0.004 * dq
    tau += sum(amplitude * np.sin(order * q + 0.4) for order, amplitude in waves.items())
    late = lsim(([1.0], [lag, 1.0]), tau, t, X0=[tau[0] * lag])[1] if lag else tau
    every = _FINE // _RATE
    seen = (t[::every], (q[::every] + rng.normal(0.0, 1e-6, len(t[::every])))[:, None],
            (late[::every] + rng.normal(0.0, 2e-5, len(t[::every])))[:, None])
    signals = {name: Signal(x, unit, name) for name, x, unit in zip(("t", "q", "tau"), seen, ("s", "rad", "N m"), strict=True)}
    return ExperimentLog(f"turn-{seed}", "free", "identify", "measured", "motor", 1.0 / _RATE, _ROBOT, signals, torque="measured")


@pytest.fixture(scope="module")
def found() -> Found:
    settings = DiagnosisSettings(replicas=0, cutoff_hz=40.0)
    prepared = prepare(Logs((turned(1), turned(2))), settings)
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    model = Exact.start(columns, fit)
    every = families(columns.laws, whole_motion(prepared.data), model.arm, _LIBRARY)
    return search(Case(prepared.data, None, model, fit.weight, every, None), 2)


@pytest.mark.slow
def test_lag_and_ripple_are_named_and_the_inertia_comes_out(found: Found) -> None:
    assert abs(found.nominal.model.beta[0] / _INERTIA - 1.0) > 0.5  # the nominal model knows nothing of it
    named = {one.effect.name: one for one in found.final.model.effects}
    assert set(named) == {"cogging", "torque_lag"}
    assert named["torque_lag"].values["time_constant"] == pytest.approx(_LAG, rel=0.005)
    assert named["cogging"].values["order"] == pytest.approx(_ORDER, rel=1e-3)
    assert found.final.model.beta[0] == pytest.approx(_INERTIA, rel=0.01)


def test_slopes_of_a_model_behind_a_lag_are_those_of_its_torque(found: Found) -> None:
    """Every number moved by a little and the whole torque worked out again."""
    model, data = found.final.model, found.final.data
    done = refine(model, data, found.final.weight, steps=0)
    for k in range(len(model.beta)):
        shift = np.zeros(len(done.slopes))
        shift[k] = step = 1e-3 * (abs(model.beta[k]) or 1.0)
        moved = (model.moved(shift, list(done.names)).torque(data) - model.torque(data)) / step
        assert np.linalg.norm(moved - done.slopes[k]) < 1e-6 * np.linalg.norm(moved)


def test_sharpness_of_each_joint_is_found_behind_a_lag() -> None:
    """Of two rotors at right angles, whose friction changes sign over 1/30 and over 1/90 rad/s, the second one's torque is logged
    late."""
    first, second = turned(1, {}, lag=0.0, mean=0.1), turned(2, {}, mean=0.1, sharpness=90.0)
    both = {"q": np.column_stack([first.q, second.q]), "tau": np.column_stack([first.tau, second.tau])}
    signals = {name: replace(signal, values=both.get(name, signal.values)) for name, signal in first.signals.items()}
    joint = _ROBOT[_ROBOT.index("[[joint]]"):]
    robot = _ROBOT.replace("alpha = 0.0", "alpha = 1.5707963267948966") + joint.replace("rotor", "other")
    log = replace(first, signals=signals, robot_text=robot)
    prepared = prepare(Logs((log,)), DiagnosisSettings(replicas=0, cutoff_hz=40.0))
    columns, fit = fit_nominal(prepared.data, prepared.columns)
    done = refine(Exact.start(columns, fit).with_effect(TorqueLag(joint=2), np.array([_LAG])), prepared.data, fit.weight, steps=30)
    assert done.model.effects[0].values["time_constant"] == pytest.approx(_LAG, rel=0.005)
    found = [law.sharpness for law in done.model.columns.laws if isinstance(law, Coulomb)]
    assert found == pytest.approx([30.0, 90.0], rel=0.02)


@pytest.mark.parametrize(("effect", "amplitudes"), [(EncoderEccentricity(joint=1), [0.02, 0.0]), (TimeDelay(joint=1), [0.004]),
                                                    (DriveLag(joint=1), [0.004])], ids=["misread", "late", "slow drive"])
def test_how_sharply_friction_turns_over_is_sloped_as_the_whole_torque_is(effect: Effect, amplitudes: list[float]) -> None:
    """Friction is felt where the joint truly is, and comes late: a slope at the measured speed is off by a third and more."""
    prepared = prepare(Logs((turned(1, {}, lag=0.0, mean=0.1),)), DiagnosisSettings(replicas=0, cutoff_hz=40.0))
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
    prepared = prepare(Logs((turned(1),)), DiagnosisSettings(replicas=0, cutoff_hz=40.0))
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
    prepared = prepare(Logs((log,)), DiagnosisSettings(replicas=0, cutoff_hz=40.0))
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
