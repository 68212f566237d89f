"""Machines whose base and joints give way, their recorded frequency-response experiments, and the truth of each."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bench import experiments
from bench.control import ComputedTorque
from bench.draw import draw_machine
from bench.dynamics import motor_share, typical_inertia
from bench.faults.sensor import TimeDelay
from bench.faults.structure import BaseResonance, JointElasticity
from bench.machine import Fault, Machine
from bench.plant import record
from pipelines.io.log import Array, ExperimentLog
from sample_logs.bench_session import ControllerModel, controllers_model
from tests.frf.linearised import Truth, linearised

__all__ = ["Case", "accuracy_case", "controller_inertia", "recorded", "sealed_case", "truth_of"]

_TURN = 8  # angles of the moving joint at which the plant is linearised


@dataclass(frozen=True, eq=False)
class Case:
    """One machine with what gives way, and the joints and postures to excite it in."""

    name: str
    machine: Machine
    faults: tuple[Fault, ...]
    kind: str  # "base", "joint", "rigid", "delay"; "both" of base and joint
    joint: int  # 1-based: where it gives way; 1 for base and rigid
    excited: tuple[tuple[int, Array], ...]  # joint and posture of each log
    seed: int
    duration: float  # [s]
    strength: float = 1.0  # of the excitation, beside the bench's own

    @property
    def model(self) -> ControllerModel:
        return controllers_model(self.machine)


def _machine(seed: int) -> Machine:
    return draw_machine(seed, "paper")


def _elastic(machine: Machine, joint: int, resonance: float, damping: float) -> JointElasticity:
    """Its free resonance at `resonance` [Hz] in the mean posture."""
    motor = motor_share(machine.robot, joint - 1)
    link = typical_inertia(machine.robot)[joint - 1] - motor
    stiffness = (2.0 * math.pi * resonance) ** 2 / (1.0 / motor + 1.0 / link)
    return JointElasticity(joint, stiffness, 2.0 * damping * math.sqrt(stiffness * link), motor, link)


def _postures(machine: Machine, joint: int) -> tuple[Array, Array]:
    """Two that differ in a joint that is held."""
    bent, straight, between = experiments.frf_postures(machine)
    return (bent, straight) if joint != 3 else (bent, between)


def accuracy_case(number: int, duration: float = 60.0) -> Case:
    """A base at 24-32 Hz and a joint with its resonance at 40-120 Hz, drawn by `number`."""
    rng = np.random.default_rng([41, number])
    machine, joint = _machine(4100 + number), (1, 1, 2, 1, 1, 3)[number % 6]
    base = BaseResonance(None, float(rng.uniform(24.0, 32.0)), float(rng.uniform(0.03, 0.06)), float(rng.uniform(8.0, 27.0)))
    resonance = float(rng.uniform(40.0, 120.0))
    soft = _elastic(machine, joint, resonance, float(rng.uniform(0.01, 0.03)))
    excited = [(joint, p) for p in _postures(machine, joint)]
    # Less than the usual excitation: the speed then stays near that of the turn, where the truth is linearised. The lower the
    # resonance and the lighter the motor, the more its damping is friction's.
    strength = (0.5 if resonance > 80.0 else 0.2) * (0.3 if joint == 3 else 1.0)
    return Case(f"accuracy-{number}", machine, (base, soft), "both", joint, tuple(excited), number, duration, strength)


def sealed_case(number: int, duration: float = 32.0) -> Case:
    """Base, joint, delay or nothing, at full strength or a third of it; drawn by `number`, and its answer with it."""
    rng = np.random.default_rng([42, number])
    machine = _machine(4200 + number)
    kind = ("base", "joint", "rigid", "delay")[int(np.random.default_rng([43, number // 4]).permutation(4)[number % 4])]
    weak = bool(rng.random() < 0.5)
    joint = int(rng.integers(1, 4)) if kind in ("joint", "delay") else 1
    faults: dict[str, tuple[Fault, ...]] = {
        "base": (BaseResonance(None, float(rng.uniform(24.0, 32.0)), 0.04, 27.0 if weak else 8.0),),
        "joint": (_elastic(machine, joint, float(rng.uniform(40.0, 120.0)), 0.03),),
        "rigid": (), "delay": (TimeDelay(joint, 1.5e-3 if weak else 5e-3),)}
    excited = tuple((joint, p) for p in _postures(machine, joint))
    return Case(f"sealed-{number}", machine, faults[kind], kind, joint, excited, number, duration)


def recorded(case: Case, which: Sequence[int] | None = None) -> Iterator[ExperimentLog]:
    """The log of every excited joint and posture, or of some of them."""
    for place, (joint, posture) in enumerate(case.excited):
        if which is None or place in which:
            plan = experiments.frf(case.machine, joint, posture, case.model, seed=10 * case.seed + place, duration=case.duration)
            assert isinstance(plan.law, ComputedTorque)
            plan = replace(plan, name=f"{case.name}-{place + 1}", law=replace(plan.law, v=case.strength * plan.law.v))
            (log,) = record(case.machine, case.faults, [plan], seed=100 * case.seed + place)
            yield log


def controller_inertia(model: ControllerModel, posture: Array) -> Array:
    """D̂ (n, n) [kg m^2]."""
    return np.array([model.inertia_times(posture.tolist(), unit.tolist()) for unit in np.eye(len(posture))]).T


def truth_of(case: Case, log: ExperimentLog) -> tuple[Truth, ...]:
    """The plant of that log's joint, linearised at its speed and at angles all along its turn."""
    assert log.joint is not None
    assert log.posture is not None
    assert log.controller is not None
    assert log.controller.kp is not None
    assert log.controller.kd is not None
    j = log.joint - 1
    speed = float(np.abs(log["dq_ref"][:, j]).max())
    low, high = log["q_ref"][:, j].min(), log["q_ref"][:, j].max()
    delay = sum(f.delay for f in case.faults if isinstance(f, TimeDelay) and f.joint == log.joint)
    found = []
    for angle in np.linspace(low, high, _TURN, endpoint=False) if j > 0 else (log.posture[j],):
        posture = log.posture.copy()
        posture[j] = angle
        inertia = controller_inertia(case.model, posture)
        found.append(linearised(case.machine, log.joint, posture, speed, inertia,
                                (float(log.controller.kp[j]), float(log.controller.kd[j])), case.faults, delay))
    return tuple(found)
