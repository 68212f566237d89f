"""Effects of encoders and of what gives way, against the faults of the same name on MuJoCo's plant.

Motion is what such a machine's ideal encoders read, so that what the effect corrects is in it; torque and motion pass the same
low-pass, as they do before any fit.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.signal import butter, sosfiltfilt

from bench.config import SAMPLE_TIME
from bench.plant import Recording, as_log
from pipelines.dynamics.arm import Acting
from pipelines.dynamics.body import Motion
from pipelines.effects import find_effect
from pipelines.effects.base import Effect
from pipelines.effects.encoders import EncoderCrosstalk, EncoderEccentricity, TimeDelay
from pipelines.effects.soft import JointElasticity
from pipelines.io.log import Array, Controller
from pipelines.simulation import Experiment, Plant, run, simulate_windows
from tests.effects.on_bench import arm, fault, faulty, healthy, machine, planned, rms
from tests.seeds import usually
from tests.simulation.arms import KD, KP, experiment

CUTOFF_HZ = 20.0
SENSORS = (("time_delay", 1), ("time_delay", 2), ("time_delay", 3), ("encoder_eccentricity", 1), ("encoder_eccentricity", 2),
           ("encoder_crosstalk", 1), ("encoder_crosstalk", 2), ("encoder_crosstalk", 3))
# The bench's motors and links start together and part with a jump, which rings for half a second and more.
COMPLIANT = (("base_resonance", None, 0.99), ("joint_elasticity", 1, 0.99), ("joint_elasticity", 2, 0.99),
             ("joint_elasticity", 3, 0.95), ("backlash", 1, 0.95), ("backlash", 2, 0.95), ("backlash", 3, 0.95))
RUNG_OUT = 700  # samples
SIMULATED = 200  # samples


def sealed(name: str, joint: int | None) -> tuple[Effect, dict[str, float]]:
    """The effect with the numbers of the sealed answer, and what else the fault is made of."""
    at_hand, kind = fault(name, joint), find_effect(name)
    effect = kind(joint) if kind.scope == "joint" else kind()
    told: dict[str, Any] = dict(at_hand.parameters())
    values = {q.name: float(told.get(q.name, getattr(at_hand, q.name, 1.0))) for q in effect.parameters}
    return effect.at(values), values


@lru_cache
def read(name: str, joint: int | None) -> tuple[Motion, Array]:
    """Motion as read and torque as logged, in the middle of each sample."""
    return _read(faulty(name, joint))


def _read(recording: Recording) -> tuple[Motion, Array]:
    spline = make_interp_spline(recording.t, recording.q, k=7, axis=0)
    t = recording.t[:-1] + 0.5 * SAMPLE_TIME
    return Motion(t, spline(t), spline(t, 1), spline(t, 2)), recording.tau[:-1]


def low_passed(x: Array) -> Array:
    return np.asarray(sosfiltfilt(butter(4, 2.0 * CUTOFF_HZ * SAMPLE_TIME, output="sos"), x, axis=0))


def left(tau: Array, torque: Array, first: int = 100) -> Array:
    return low_passed(tau - torque)[first:-100]


def explained(name: str, joint: int | None, values: dict[str, float], effect: Effect, first: int = 100) -> float:
    """Share of the power that the fault adds to the torque."""
    motion, tau = read(name, joint)
    before, after = (rms(left(tau, torque, first)) for torque in (arm().torque(motion), effect.apply(motion, arm(), values)))
    assert before > 3.0 * floor()
    return 1.0 - (after / before) ** 2


@lru_cache
def floor() -> float:
    """What is left of a healthy log: friction's change of sign between two samples."""
    motion, tau = _read(healthy())
    return rms(left(tau, arm().torque(motion)))


@pytest.mark.parametrize(("name", "joint"), usually(SENSORS, *SENSORS[::3]))
def test_the_log_of_a_wrong_encoder_is_explained(name: str, joint: int) -> None:
    """99.5 % of what the fault does to the torque, with the sealed numbers."""
    effect, values = sealed(name, joint)
    assert explained(name, joint, values, effect) > 0.995


@pytest.mark.parametrize(("name", "joint", "share"), usually(COMPLIANT, *COMPLIANT[:2], COMPLIANT[-1]))
def test_the_log_of_a_machine_that_gives_way_is_explained(name: str, joint: int | None, share: float) -> None:
    """Below 20 Hz, once the start has rung out."""
    effect, values = sealed(name, joint)
    assert explained(name, joint, values, effect, RUNG_OUT) > share


def test_the_opposite_sign_is_wrong() -> None:
    """The other way round the residual grows by half and more: no sign is right by chance."""
    for name, opposite in (("encoder_eccentricity", "amplitude"), ("encoder_crosstalk", "coefficient"), ("time_delay", "delay")):
        effect, values = sealed(name, 2)
        assert explained(name, 2, values | {opposite: -values[opposite]}, effect) < -0.5


@pytest.mark.parametrize(("name", "joint"), [*SENSORS, ("base_resonance", None), ("joint_elasticity", 1)])
def test_the_closed_loop_does_what_the_faulty_machine_does(name: str, joint: int | None) -> None:
    """Position as read under the same controller and reference: the difference that the fault makes is simulated to 0.5 %."""
    effect, values = sealed(name, joint)
    assert simulated_apart(effect, values, name, joint) <= 5e-3


def simulated_apart(effect: Effect, values: dict[str, float], name: str, joint: int | None) -> float:
    """Of what the fault does to the position, the share that the simulation has otherwise."""
    recording = faulty(name, joint)
    log = as_log(machine(), planned(), recording)
    acting = Acting(effect, Acting.of(effect, values).parameters if values else ())
    found = run(Plant.of(arm().extended(acting)), Experiment.of_log(log).part(0, SIMULATED), 4)
    made = rms((recording.q - healthy().q)[:SIMULATED])
    assert made > 1e-6
    return rms(found.q[0] - recording.q[:SIMULATED]) / made


def held(*acting: Acting) -> tuple[Array, Array]:
    """Positions and torques (samples, joints) as logged, of an arm without friction held where it stands, gravity balanced."""
    rigid = replace(arm(), friction=())
    q = np.tile(np.array([0.3, -0.7, 0.9]), (60, 1))
    gravity = rigid.torque(Motion(np.zeros(1), q[:1], 0.0 * q[:1], 0.0 * q[:1]))[0]
    controller = Controller("pd", KP, KD, velocity="backward-difference")
    planned = experiment(controller, 60, q_ref=q + gravity / KP, dq_ref=0.0 * q, ddq_ref=0.0 * q, q0=q[0], dq0=0.0 * q[0])
    found = run(Plant.of(rigid.extended(*acting)), planned, 8)
    return found.q[0], found.tau[0]


@pytest.mark.parametrize("acting", [
    Acting.of(TimeDelay(2), {"delay": 5e-3}), Acting.of(EncoderEccentricity(2), {"amplitude": 1e-3, "phase": 0.4}),
    Acting.of(EncoderCrosstalk(2, 1.0), {"coefficient": 1e-3, "from_joint": 1.0}),
    Acting.of(JointElasticity(2), {"stiffness": 14000.0, "damping": 4.0, "frequency": 30.0, "motor_inertia": 0.05})],
    ids=lambda acting: acting.effect.name)
def test_an_arm_at_rest_stays_at_rest(acting: Acting) -> None:
    """No run begins with a jump: at the first sample the encoder reads what it is said to, and nothing swings afterwards."""
    q, tau = held(acting)
    np.testing.assert_allclose(q[0], [0.3, -0.7, 0.9], atol=1e-6)
    assert np.abs(tau - tau[0]).max() < 0.02 * np.abs(tau).max()
    assert np.abs(q - q[0]).max() < 1e-4


@pytest.mark.parametrize(("name", "apart"), [("time_delay", 0.15), ("encoder_eccentricity", 0.03), ("encoder_crosstalk", 0.03)])
def test_windows_start_where_the_arm_truly_was(name: str, apart: float) -> None:
    """Of the position error of 50 ms windows hardly anything stays, where a wrong encoder tells how they start."""
    effect, values = sealed(name, 2)
    recording = faulty(name, 2)
    spline = make_interp_spline(recording.t, recording.q, k=7, axis=0)
    motion = Motion(recording.t, *(spline(recording.t, k) for k in range(3)))
    usable = (recording.t > 0.7) & (recording.t < 1.1)
    error = []
    for model in (arm(), arm().extended(Acting.of(effect, values))):
        found = simulate_windows(Plant.of(model), motion, recording.tau, SAMPLE_TIME, 50, usable).q
        error.append(rms((found - recording.q)[np.isfinite(found[:, 0])]))
    assert error[1] < apart * error[0]


@pytest.mark.parametrize(("effect", "values", "size"), [
    (TimeDelay(2), {"delay": 1.0}, 1e-8), (EncoderEccentricity(2), {"amplitude": 1.0, "phase": 0.7}, 1e-6),
    (EncoderCrosstalk(3, 1.0), {"coefficient": 1.0, "from_joint": 1.0}, 1e-6)], ids=lambda x: getattr(x, "name", ""))
def test_columns_are_the_slope_of_the_exact_form(effect: Effect, values: dict[str, float], size: float) -> None:
    """By central differences at zero strength, to 1e-5 of the largest."""
    motion, _ = _read(healthy())
    strength = next(iter(values))
    ahead, behind = (effect.apply(motion, arm(), values | {strength: sign * size}) for sign in (1.0, -1.0))
    columns = effect.columns(motion, arm()) @ effect.amplitudes(values)
    assert np.abs((ahead - behind) / (2.0 * size) - columns).max() <= 1e-5 * np.abs(columns).max()
