"""How effects enter the simulation: every hook, judged by Pinocchio with the same effect written by hand."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pinocchio as pin
import pytest

from pipelines.dynamics.arm import Acting
from pipelines.dynamics.body import Motion
from pipelines.effects.base import ArmModel, Effect, Hooks, Parameters, Values, Words
from pipelines.io.log import Array, Controller
from pipelines.simulation import Plant, run
from tests.simulation.arms import KD, KP, TS, Case, experiment, rrr, rrr_friction, waving
from tests.simulation.pinocchio_loop import Loop

SAMPLES = 150


@dataclass(frozen=True)
class Hooked(Effect):
    """An effect that is nothing but its hooks."""

    name = "hooked"
    scope = "arm"
    parameters: ClassVar[Parameters] = Parameters()
    words = Words("For tests", *["none"] * 4)
    make: Callable[[ArmModel], Hooks] = lambda arm: Hooks()

    def columns(self, motion: Motion, arm: ArmModel) -> Array:
        return np.zeros((*motion.q.shape, 0))

    def simulate(self, arm: ArmModel, values: Values) -> Hooks:
        return self.make(arm)


def simulated(make: Callable[[ArmModel], Hooks], replicas: int = 2) -> Array:
    """True position (samples, joints) of the last of some replicas; one alone, whose body takes no arrays, moves as they do."""
    plant = Plant.of(rrr().arm.extended(Acting(Hooked(make=make), ())))
    controller = Controller("pd", KP, KD, velocity="backward-difference")
    found = run(plant, experiment(controller, SAMPLES), 8, seeds=range(replicas))
    np.testing.assert_array_equal(found.true_q[0], found.true_q[-1])
    alone = run(plant, experiment(controller, SAMPLES), 8)
    np.testing.assert_allclose(alone.true_q[0], found.true_q[-1], rtol=0.0, atol=1e-11)
    return found.true_q[-1]


@dataclass
class Judge(Loop):
    """Pinocchio's loop under PD with what effects change."""

    load: Callable[[float, Array, Array], Array] = lambda t, q, dq: np.zeros(3)
    drive: Callable[[Array], Array] = lambda tau: tau
    sense: Callable[[Array], Array] = lambda q: q

    def acceleration(self, q: Array, dq: Array, tau: Array) -> Array:
        return super().acceleration(q, dq, self.drive(tau) - self.load(0.0, q, dq))

    def position(self, samples: int = SAMPLES) -> Array:
        q_ref, dq_ref, _ = waving(samples)
        last: list[Array] = []

        def law(k: int, q: Array) -> Array:
            e = self.sense(q) - q_ref[k]
            de = (e - last[-1]) / TS if last else 0 * e
            last.append(e)
            return -KP * e - KD * de

        return self.run(q_ref[0], dq_ref[0], law, samples)[0]


def judge(**changes: object) -> Judge:
    return Judge(rrr().model, rrr_friction(), TS, 8, **changes)  # type: ignore[arg-type]


def differs(q: Array) -> bool:
    """Whether an effect did anything worth comparing."""
    return bool(np.abs(q - judge().position()).max() > 1e-4)


def test_a_load_is_what_the_drive_must_overcome() -> None:
    """Spring and drag, a function of position and speed."""
    stiffness, drag = np.array([0.0, 6.0, 2.0]), np.array([1.0, 0.0, 0.5])
    found = simulated(lambda arm: Hooks(load=lambda motion, _: stiffness * motion.q + drag * motion.dq * np.abs(motion.dq)))
    expected = judge(load=lambda t, q, dq: stiffness * q + drag * dq * np.abs(dq)).position()
    assert np.abs(found - expected).max() < 1e-8
    assert differs(expected)


def test_an_actuator_changes_the_command() -> None:
    """A clipped drive: the log holds the command, the arm feels the clip."""
    limit = np.array([12.0, 8.0, 2.0])
    found = simulated(lambda arm: Hooks(actuator=lambda command, motion, _: np.clip(command, -limit, limit)))
    expected = judge(drive=lambda tau: np.clip(tau, -limit, limit)).position()
    assert np.abs(found - expected).max() < 1e-7
    assert differs(expected)


def test_the_last_effect_meets_the_command_first() -> None:
    """Effects act around those before them: what is clipped last in the model of torque is clipped first on the way down."""
    gain, limit = np.array([1.5, 1.5, 1.5]), np.array([12.0, 8.0, 2.0])
    inner = Acting(Hooked(make=lambda arm: Hooks(actuator=lambda command, motion, _: gain * command)), ())
    outer = Acting(Hooked(make=lambda arm: Hooks(actuator=lambda command, motion, _: np.clip(command, -limit, limit))), ())
    controller = Controller("pd", KP, KD, velocity="backward-difference")
    found = run(Plant.of(rrr().arm.extended(inner, outer)), experiment(controller, SAMPLES), 8).true_q[0]
    expected = judge(drive=lambda tau: gain * np.clip(tau, -limit, limit)).position()
    assert np.abs(found - expected).max() < 1e-7


def test_a_sensor_is_in_the_loop() -> None:
    """An encoder crosstalk."""
    mix = np.array([[1.0, 0.0, 0.0], [0.02, 1.0, 0.0], [0.0, 0.0, 1.0]])
    found = simulated(lambda arm: Hooks(sensor=lambda q, _: q @ mix.T))
    expected = judge(sense=lambda q: mix @ q).position()
    assert np.abs(found - expected).max() < 1e-8
    assert differs(expected)


def test_the_arm_as_it_truly_is() -> None:
    """A body with other parameters, friction unchanged."""
    found = simulated(lambda arm: Hooks(arm=arm.with_body(arm.body, 1.3 * arm.p)))
    case = _heavier(rrr(), 1.3)
    expected = Judge(case.model, rrr_friction(), TS, 8).position()
    assert np.abs(found - expected).max() < 1e-8
    assert differs(expected)


def _heavier(case: Case, factor: float) -> Case:
    for i in range(1, len(case.model.inertias)):
        parameters = factor * np.asarray(case.model.inertias[i].toDynamicParameters())
        case.model.inertias[i] = pin.Inertia.FromDynamicParameters(parameters)
    return case


def test_a_state_in_continuous_time() -> None:
    """A lag of the drive, dx/dt = (u - x)/T: its torque within a sample is u + (x_k - u) exp(-t/T)."""
    lag = 4e-3

    def make(arm: ArmModel) -> Hooks:
        return Hooks(actuator=lambda command, motion, x: x, states=3, rate=lambda motion, command, x: (command - x) / lag)

    found = simulated(make)
    expected = _lagging(lag)
    assert np.abs(found - expected).max() < 1e-7
    assert differs(expected)


def _lagging(lag: float, limit: Array | float = np.inf) -> Array:
    """The lag's exact torque at the nodes of RK4, which Pinocchio's loop is given stage by stage."""
    loop, x, steps = judge(), np.zeros(3), 8
    q_ref, dq, _ = waving(SAMPLES)
    q, dq, last, rows = q_ref[0], dq[0], np.zeros(3), []
    h = TS / steps
    for k in range(SAMPLES):
        e = q - q_ref[k]
        command = np.clip(-KP * e - KD * ((e - last) / TS if k else 0 * e), -np.asarray(limit), limit)
        last = e
        rows.append(q)
        for s in range(steps):
            now, mid, end = (command + (x - command) * np.exp(-(s + part) * h / lag) for part in (0.0, 0.5, 1.0))
            a = loop.acceleration(q, dq, now)
            b = loop.acceleration(q + h / 2 * dq, dq + h / 2 * a, mid)
            c = loop.acceleration(q + h / 2 * (dq + h / 2 * a), dq + h / 2 * b, mid)
            d = loop.acceleration(q + h * (dq + h / 2 * b), dq + h * c, end)
            q, dq = q + h * dq + h**2 / 6 * (a + b + c), dq + h / 6 * (a + 2 * b + 2 * c + d)
        x = command + (x - command) * np.exp(-TS / lag)
    return np.array(rows)


@pytest.mark.parametrize("where", ["command", "encoder"])
def test_a_memory_from_sample_to_sample(where: str) -> None:
    """A line of one sample's delay: in the command the delay of the controller itself; in the encoder the position before."""
    if where == "command":
        hooks = Hooks(actuator=lambda command, motion, x: x[:, 3:], states=6,
                      update=lambda motion, command, x: np.concatenate([command, x[:, :3]], axis=1))
    else:
        hooks = Hooks(sensor=lambda q, x: x, states=3, start=lambda motion, tau: motion.q,
                      update=lambda motion, command, x: motion.q)
    found = simulated(lambda arm: hooks)
    controller = Controller("pd", KP, KD, velocity="backward-difference", delay=1)
    if where == "command":
        late = run(Plant.of(rrr().arm), experiment(controller, SAMPLES), 8).true_q[0]
        np.testing.assert_allclose(found, late, atol=1e-10)
    else:
        kept = [waving(1)[0][0]]

        def sense(q: Array) -> Array:
            kept.append(q)
            return kept[-2]

        assert np.abs(found - judge(sense=sense).position()).max() < 1e-8
